"""Receipts of evaluations: who played what, on what, and a digest of every state."""

from rollouts.receipts.receipt import EpisodeReceipt, Receipt, ReceiptError
from rollouts.receipts.verification import Verification, verify

__all__ = ["EpisodeReceipt", "Receipt", "ReceiptError", "Verification", "verify"]

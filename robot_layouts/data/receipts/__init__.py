"""Receipts of evaluations: who played what, on what, and a digest of every state."""

from robot_layouts.data.receipts.receipt import EpisodeReceipt, Receipt, ReceiptError
from robot_layouts.data.receipts.verification import Verification, verify

__all__ = ["EpisodeReceipt", "Receipt", "ReceiptError", "Verification", "verify"]

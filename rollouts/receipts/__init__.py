"""Receipts of evaluations: who played what, on what, and a digest of every state."""

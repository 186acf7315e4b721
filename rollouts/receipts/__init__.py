"""Receipts of evaluations: who played what, on what, and a digest of every state."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rollouts.receipts.receipt import EpisodeReceipt, Receipt, ReceiptError
    from rollouts.receipts.verification import Verification, verify

__all__ = ["EpisodeReceipt", "Receipt", "ReceiptError", "Verification", "verify"]

_HOMES = dict.fromkeys(["Verification", "verify"], "rollouts.receipts.verification")


def __getattr__(name: str) -> Any:
    """Load what is asked for, once; playing needs torch and sapien."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    home = _HOMES.get(name, "rollouts.receipts.receipt")
    value = globals()[name] = getattr(import_module(home), name)
    return value

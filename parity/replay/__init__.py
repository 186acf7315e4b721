"""Recorded actions played beside native, and episodes kept as arrays."""

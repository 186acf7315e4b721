"""Reads recorded episodes, from files that may be damaged or hostile."""

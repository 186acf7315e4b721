"""Robots of other packages that this library has not seen, and what it makes of their files."""

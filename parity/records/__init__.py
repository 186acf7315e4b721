"""The recorded results, and the tables that docs/parity.md shows of them."""

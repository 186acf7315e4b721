"""Suites: tasks × seeds × layouts in one file that names itself by hash, played with receipts."""

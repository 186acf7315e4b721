"""Cells: what two to eight arms of any make do together, in stages; one file each."""

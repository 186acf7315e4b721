"""Worker processes: how they start, how they end with this one, how their errors come home."""

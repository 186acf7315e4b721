"""Worker processes of this machine: how they start, what they are asked for, how they end."""

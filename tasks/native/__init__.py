"""What only native says in this way: its state dicts, its outlines, its counts of pixels."""

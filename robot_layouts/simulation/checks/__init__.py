"""Whether robots stand and move as they should, and what is wrong where they do not."""

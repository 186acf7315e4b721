"""Datasets as a whole: certified by replays, reported on one page, and pushed with a card."""

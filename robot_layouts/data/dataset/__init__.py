"""Datasets as a whole: certified by replays, and reported on one page."""

"""Paths, how fast they may be followed, and trajectories of all coordinates."""

"""Writes episodes as they are played, and goes on after a crash where it stopped."""

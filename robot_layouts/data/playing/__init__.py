"""Plays episodes: in this process, in workers, or on a Ray cluster."""

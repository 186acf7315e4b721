"""Worlds that vary: what is drawn anew for each episode, from which distribution, and how."""

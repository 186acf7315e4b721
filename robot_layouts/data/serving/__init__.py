"""Environments that another process steps, over a socket."""

"""Policies that another process serves, over a socket."""

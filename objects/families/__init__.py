"""The families that come with this library: each makes convex parts from a few lengths.

What collides is what is drawn, so that no mesh has to be taken apart and nothing is fetched.
"""

"""Whether anything collides: a broad phase, a narrow phase, straight edges, whole curves."""

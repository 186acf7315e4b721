"""What a motion moves in: bodies, obstacles, the poses of links, curves through knots."""

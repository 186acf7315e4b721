"""What tasks are written in: bodies, areas, geometry, and terms of rewards."""

"""A survey of robots that this library has not seen: what becomes of each URDF of other packages."""

"""Things from files: meshes and MJCFs become convex parts, ways to rest, and places to grasp."""

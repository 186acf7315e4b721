"""The simulator behind the seam: SAPIEN 3 with PhysX on the CPU, one scene for each world."""

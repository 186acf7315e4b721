"""MuJoCo behind the seam."""

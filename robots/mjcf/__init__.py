"""Robots from MuJoCo's MJCF files: read without trust, compiled by MuJoCo, converted to URDF."""

"""Thousands of worlds of MuJoCo's on one device, read and reset as tensors."""

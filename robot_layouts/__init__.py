"""Robots, layouts and tasks under one name; ``python -m robot_layouts`` lists the commands."""

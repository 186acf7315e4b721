"""Robots, layouts and tasks under one name; ``python -m robot_layouts`` lists the commands."""

from kinematics.own_rooms import expect_own

expect_own("robots", "layouts", "tasks")

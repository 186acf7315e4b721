"""Placements and presets as users write them, for type checkers: robots by name."""

from dataclasses import replace

from layouts import Layout, Placement, face_to_face, ring
from robots import RobotRegistry

named = Placement("panda", (0.0, 0.0, 0.0), on="roof")
given = Placement(RobotRegistry.load("panda"), qpos_noise=0.0)
robot: str = named.robot.name
other = replace(given, keyframe="rest")
cell = Layout({"arm": named})
pair = face_to_face({"left": "panda", "right": "panda_stick"}, spacing=1.5)
many = ring({"a": "panda", "b": given.robot}, radius="auto")

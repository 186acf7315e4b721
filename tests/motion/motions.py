"""A motion with everything: obstacles that stand and move, a body that is held, a table."""

from __future__ import annotations

import numpy as np

from layouts import face_to_face
from robot_layouts.motion import Motion
from robot_layouts.motion.model.obstacles import Held, Track, box, sphere
from tests.experts.free_motions import swing

LAYOUT = face_to_face({"left": "panda", "right": "so100"}, spacing=0.9)


def busy_motion() -> Motion:
    motion = swing(LAYOUT)
    there = np.diag([-1.0, -1.0, 1.0, 1.0])
    there[0, 3] = 0.5
    track = Track(np.array([0.0, 1.0]), np.array([np.eye(4), there]))
    ball = sphere("ball", 0.05).moved(track)
    return Motion(
        LAYOUT,
        motion.times,
        motion.positions,
        motion.velocities,
        obstacles=(box("wall", (0.1, 0.2, 0.3), (0.0, 1.0, 0.15)), ball),
        held=(Held("left", box("cube", (0.04, 0.04, 0.04), (0.0, 0.0, 0.1))),),
        table=(-1.0, -0.5, 1.0, 0.5),
        clearance=0.02,
        largest_velocities={"left": [2.0] * 8 + [np.inf]},
        largest_accelerations={"right": [5.0] * 6},
    )

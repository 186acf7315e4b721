"""A cell of two arms that get in each other's way, for tests of plans."""

from functools import lru_cache

import numpy as np

from layouts import Layout, face_to_face
from robot_layouts.motion import TcpGoal

DOWN = (0.0, 1.0, 0.0, 0.0)  # wxyz; a gripper that points down


@lru_cache(maxsize=1)
def cell() -> Layout:
    return face_to_face({"left": "panda", "right": "panda"}, spacing=1.4)


def turned(name, angle):
    """Joint positions at the start of the layout, with the first joint turned (rad)."""
    qpos = np.array(cell()[name].start_qpos)
    qpos[0] += angle
    return qpos


def aside():
    """Both arms turned away from the middle."""
    return {"left": turned("left", 1.4), "right": turned("right", 1.4)}


def in_the_middle():
    """Where only one of the arms can be."""
    return TcpGoal((0.0, 0.0, 0.3), DOWN)

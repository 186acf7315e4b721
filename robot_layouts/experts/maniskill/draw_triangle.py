"""Drawing along the outline of a triangle: down at one corner, along the sides, back to it."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from robot_layouts.experts.geometry import gripper_facing, turn, yaw_of
from robot_layouts.experts.rehearsal import first_success
from robot_layouts.experts.script import Pose, Scene, Script, Waypoint
from robot_layouts.kinematics.rotations import Floats, rotate
from tasks import TaskEnv
from tasks.maniskill.draw_triangle import CANVAS_TOP, SIDE

ARM, TRIANGLE = "arm", "goal_tri"
ABOVE = CANVAS_TOP + 0.04  # m; too high to draw
ON_CANVAS = CANVAS_TOP + 0.003  # m; between the canvas and where a stick stops drawing
STROKE = 0.02  # m; between waypoints. The dots of two steps may lie 5 cm apart.
NEAR = 0.02  # rad; 2 cm at the stick's tip at the very most, within what a dot may stray
TURNS = np.radians(range(0, 360, 45))  # of the stick about itself; the quickest is taken


def draw_outline(task: TaskEnv, seed: int) -> NDArray[np.float32]:
    """Return the actions that draw the outline, (T, A).

    Args:
        task: A DrawTriangle; says layout and physics.
        seed: The episode.

    Raises:
        TaskError: If the arm cannot reach the triangle.
    """
    return first_success(task, seed, _scripts)


def _scripts(scene: Scene) -> Sequence[Script]:
    """Start at the nearest corner, either way round, and then at the others."""
    centre, quaternion = scene.body(TRIANGLE)
    corners = [rotate(turn("z", yaw_of(quaternion) + angle), _CORNER) for angle in _CORNER_ANGLES]
    corners = [(centre + corner)[:2] for corner in corners]
    tip = scene.tcp(ARM)[0][:2]
    first = min(range(3), key=lambda i: float(np.linalg.norm(corners[i] - tip)))
    starts = [first, (first + 1) % 3, (first + 2) % 3]
    return [
        _script([corners[(start + way * i) % 3] for i in range(4)])
        for start in starts
        for way in (1, -1)
    ]


def _script(corners: Sequence[Floats]) -> Script:
    path = _along(corners)
    return {
        ARM: (
            Waypoint("above", partial(_tip_at, place=path[0], height=ABOVE), near=0.05),
            *(
                Waypoint(f"stroke {i}", partial(_tip_at, place=place, height=ON_CANVAS), near=NEAR)
                for i, place in enumerate(path)
            ),
        )
    }


def _tip_at(scene: Scene, place: Floats, height: float) -> list[Pose]:
    return [(np.array([*place, height]), gripper_facing(angle, 0.0)) for angle in TURNS]


def _along(corners: Sequence[Floats]) -> list[Floats]:
    """Return places at most `STROKE` apart on the way past ``corners``, ends included."""
    count = int(np.ceil(SIDE / STROKE))
    shares = np.arange(1, count + 1) / count
    sides = zip(corners[:-1], corners[1:], strict=True)
    return [
        corners[0],
        *(start + share * (end - start) for start, end in sides for share in shares),
    ]


_CORNER = np.array([SIDE / np.sqrt(3), 0.0, 0.0])
_CORNER_ANGLES = np.radians((-90, 30, 150))

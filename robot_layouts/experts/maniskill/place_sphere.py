"""PlaceSphere: grasp the ball from above and let go of it in the bin."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from math import pi

import numpy as np
from numpy.typing import NDArray

from robot_layouts.experts.geometry import gripper_facing
from robot_layouts.experts.grasps import held_at, is_near, need_fingers, pick
from robot_layouts.experts.rehearsal import first_success
from robot_layouts.experts.script import CLOSED, OPEN, Pose, Scene, Script, Waypoint
from tasks import TaskEnv
from tasks.maniskill.place_sphere import RADIUS, WALL

ARM, BALL, BIN = "arm", "sphere", "bin"
IN_BIN = (0.0, 0.0, RADIUS + WALL)  # from the bin to where the ball is to lie (m)
HEADINGS = tuple(i * pi / 4 for i in range(8))  # of the gripper, to choose from (rad)


@dataclass(frozen=True)
class Style:
    """How the ball travels.

    Attributes:
        grip: How far above the ball's middle it is held, so that the fingers stay out of the
            bin (m).
        clearance: How high above its place the ball is before it is lowered (m).
        drop: How high above its place it is let go (m).
        limit: How far from there it may be, along each axis (m).
    """

    grip: float = 0.005
    clearance: float = 0.05
    drop: float = 0.006
    limit: float = 0.003


# How the gripper may turn about the vertical on its way to the bin; the quickest is taken (rad).
YAWS = (0.0, -0.3, 0.3, -0.6, 0.6)

# Tried in this order. The first solves 98 of 100 seeds.
STYLES = (Style(), Style(drop=0.003), Style(grip=0.01), Style(grip=0.0), Style(drop=0.001))


def place_sphere(task: TaskEnv, seed: int) -> NDArray[np.float32]:
    """Return the actions that put the ball into the bin, (T, A).

    Args:
        task: A PlaceSphere; says layout and physics.
        seed: The episode.

    Raises:
        TaskError: If the arm has no fingers, or cannot reach what it should.
    """
    need_fingers(task, "placing the ball", ARM)
    return first_success(task, seed, lambda scene: [_script(style) for style in STYLES])


def _script(style: Style) -> Script:
    def grips(scene: Scene) -> list[Pose]:
        place = scene.body(BALL)[0] + np.array([0.0, 0.0, style.grip])
        return [(place, gripper_facing(heading, 0.0)) for heading in HEADINGS]

    let_go = (0.0, 0.0, IN_BIN[2] + style.drop)
    in_place = partial(is_near, body=BALL, other=BIN, offset=let_go, limit=style.limit)
    return {
        ARM: (
            *pick(ARM, BALL, grips),
            Waypoint("over", partial(_place, up=style.clearance, yaws=YAWS), CLOSED),
            Waypoint("lower", partial(_place, up=style.drop), CLOSED, near=0.03, until=in_place),
            Waypoint("release", None, OPEN),
        )
    }


def _place(scene: Scene, up: float, yaws: Sequence[float] = (0.0,)) -> list[Pose]:
    place = scene.body(BIN)[0] + IN_BIN + np.array([0.0, 0.0, up])
    return held_at(scene, ARM, BALL, place, yaws)

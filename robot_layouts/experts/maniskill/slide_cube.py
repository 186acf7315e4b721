"""Sliding a cube over the table onto its target with the closed gripper: pushing and pulling."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from robot_layouts.experts.geometry import gripper_facing, heading
from robot_layouts.experts.rehearsal import first_success
from robot_layouts.experts.script import CLOSED, Pose, Scene, Script, Waypoint
from robot_layouts.kinematics.rotations import Floats
from tasks import TaskEnv

ARM, CUBE, TARGET = "arm", "cube", "goal_region"

ABOVE = 0.08  # of the TCP over the table on its way across the cube (m)
NEAR = 0.1  # rad; the arm flows through its waypoints
# How the gripper may lean, from straight down; what is quickest to reach is taken (rad).
LEANS = np.radians((0, 20, 40))


@dataclass(frozen=True)
class Style:
    """How the gripper slides the cube.

    Attributes:
        gap: Between the TCP and the cube's middle when the gripper comes down (m).
        height: Of the TCP over the table while it slides the cube (m).
        legs: In how many parts it does so; between them the arm's joints go straight, not the TCP.
    """

    gap: float = 0.045
    height: float = 0.02
    legs: int = 3


STYLES = (Style(), Style(gap=0.06), Style(height=0.03), Style(gap=0.06, legs=6))


def slide(task: TaskEnv, seed: int) -> NDArray[np.float32]:
    """Return the actions that slide the cube onto its target, (T, A).

    The gripper comes down on the cube's far side, seen from the target: before it where it is to
    be pushed, behind it where it is to be pulled.

    Args:
        task: A PushCube or a PullCube; says layout and physics.
        seed: The episode.

    Raises:
        TaskError: If the arm cannot reach the cube.
    """
    return first_success(task, seed, lambda scene: [_script(style, scene) for style in STYLES])


def _script(style: Style, scene: Scene) -> Script:
    cube, target = scene.body(CUBE)[0], scene.body(TARGET)[0]
    way = np.array([*(target - cube)[:2], 0.0])
    start = cube - style.gap * way / np.linalg.norm(way)
    start[2] = style.height
    shares = np.arange(style.legs + 1) / style.legs
    outward = way if way @ (cube - scene.base(ARM)) > 0 else -way
    through = partial(_through, direction=heading(np.zeros(3), outward))
    return {
        ARM: (
            through("above", np.array([*start[:2], ABOVE])),
            *(through(f"along {share:.0%}", start + share * way) for share in shares),
        )
    }


def _through(name: str, place: Floats, direction: float) -> Waypoint:
    poses = [(place, gripper_facing(direction, lean)) for lean in LEANS]

    def to(scene: Scene) -> Sequence[Pose]:
        return poses

    return Waypoint(name, to, CLOSED, near=NEAR)

"""Poking a cube onto its target with a peg that the gripper holds near its tail."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from math import radians

import numpy as np
from numpy.typing import NDArray

from robot_layouts.experts.geometry import backed_off, gripper_facing, heading, turn, yaw_of
from robot_layouts.experts.grasps import holding, need_fingers
from robot_layouts.experts.rehearsal import first_success
from robot_layouts.experts.script import CLOSED, OPEN, Pose, Scene, Script, Waypoint
from robot_layouts.kinematics.rotations import Floats, multiply
from tasks import TaskEnv
from tasks.maniskill.poke_cube import CUBE_HALF_SIZE, PEG_HALF_LENGTH, PEG_HALF_WIDTH

ARM, CUBE, PEG, TARGET = "arm", "cube", "peg", "goal_region"
LIFT = 0.005  # of the peg over the table while it moves (m)


@dataclass(frozen=True)
class Style:
    """How the cube is poked.

    Attributes:
        along: How far from the peg's middle towards its tail it is held (m).
        tilt: Angle of the gripper from straight down, towards the peg's head (rad).
        gap: Between the peg's head and the cube before it is poked (m).
        short: How far before the target's middle the cube should come to rest (m).
    """

    along: float = 0.06
    tilt: float = 0.0
    gap: float = 0.03
    short: float = 0.02


STYLES = (
    Style(),
    Style(tilt=radians(15)),
    Style(along=0.08),
    Style(along=0.08, tilt=radians(15)),
    Style(tilt=radians(30)),
    Style(gap=0.01),
    Style(short=0.0),
)


def poke(task: TaskEnv, seed: int) -> NDArray[np.float32]:
    """Return the actions that poke the cube onto its target, (T, A).

    Args:
        task: A PokeCube; says layout and physics.
        seed: The episode.

    Raises:
        TaskError: If the arm has no fingers, or cannot reach the peg.
    """
    need_fingers(task, "poking with a peg", ARM)
    return first_success(
        task, seed, lambda scene: [_Poke(style, scene).script() for style in STYLES]
    )


class _Poke:
    """One poke, worked out from where cube and target are at first."""

    def __init__(self, style: Style, scene: Scene) -> None:
        self.style = style
        self.cube, self.target = scene.body(CUBE)[0], scene.body(TARGET)[0]
        self.direction = heading(self.cube, self.target)
        self.ahead = np.array([np.cos(self.direction), np.sin(self.direction), 0.0])

    def script(self) -> Script:
        held = partial(Scene.grasps, robot=ARM, body=PEG)
        head = PEG_HALF_LENGTH + CUBE_HALF_SIZE
        before = self.cube - (head + self.style.gap) * self.ahead
        behind = self.target - (head + self.style.short) * self.ahead
        return {
            ARM: (
                Waypoint("above", partial(self.pick, back=0.05), OPEN, near=0.1),
                Waypoint("around", partial(self.pick, back=0.0), OPEN, near=0.05),
                Waypoint("grasp", None, CLOSED, steps=2, until=held),
                Waypoint("aim", partial(self.bring, place=before), CLOSED, near=0.06),
                Waypoint("poke", partial(self.bring, place=behind), CLOSED, near=0.02),
            )
        }

    def pick(self, scene: Scene, back: float) -> list[Pose]:
        middle, quaternion = scene.body(PEG)
        yaw = yaw_of(quaternion)
        place = middle - self.style.along * np.array([np.cos(yaw), np.sin(yaw), 0.0])
        return [backed_off((place, gripper_facing(yaw, self.style.tilt)), back)]

    def bring(self, scene: Scene, place: Floats) -> list[Pose]:
        yaw = yaw_of(scene.body(PEG)[1])
        orientation = multiply(turn("z", self.direction - yaw), scene.tcp(ARM)[1])
        level = np.array([*place[:2], PEG_HALF_WIDTH + LIFT])
        return [holding(scene, ARM, PEG, level, orientation)]

"""The hand-over: the left arm lifts the cube, the right arm takes it in the air."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from math import radians

import numpy as np
from numpy.typing import NDArray

from robot_layouts.experts.geometry import (
    backed_off,
    gripper_facing,
    heading,
    squared,
    turn,
    yaw_of,
)
from robot_layouts.experts.grasps import QUARTERS, holding, need_fingers
from robot_layouts.experts.rehearsal import first_success
from robot_layouts.experts.script import CLOSED, OPEN, Pose, Scene, Script, Waypoint
from robot_layouts.kinematics.rotations import Floats, multiply
from tasks import TaskEnv

GIVER, TAKER, CUBE, GOAL = "left", "right", "cube", "goal_site"


@dataclass(frozen=True)
class Style:
    """How the cube changes hands.

    Both grippers hold it by the same two faces, each by its own half: they lean towards each
    other far enough that the hands stay clear of one another.

    Attributes:
        pick_tilt: Angle of the giving gripper from straight down when it picks the cube (rad).
        give_tilt: The same when it gives the cube (rad).
        take_tilt: Angle of the taking gripper from straight down (rad).
        height: Of the cube when it changes hands (m).
        half: How far from the cube's middle each gripper holds it (m).
        beyond: How far beyond the middle between the bases it changes hands, towards the taker (m).
        any_side: Whether the giver picks by any two faces, not only from where the taker is not:
            for arms that stand side by side.
    """

    pick_tilt: float = radians(15)
    give_tilt: float = radians(45)
    take_tilt: float = radians(45)
    height: float = 0.22
    half: float = 0.014
    beyond: float = 0.0
    any_side: bool = False


# How the taker may lean on its way to the goal, as changes of its tilt; the quickest is taken.
CARRY_LEANS = np.radians((0, -15, -30, -45, -60, 15, 30))

# Tried in this order. The first solves every seed of the default layout.
STYLES = (
    Style(),
    Style(height=0.3),
    Style(height=0.15),
    Style(beyond=0.04),
    Style(beyond=-0.04),
    Style(pick_tilt=0.0, give_tilt=radians(40), take_tilt=radians(50)),
    Style(pick_tilt=0.0, height=0.3, give_tilt=radians(50), take_tilt=radians(40)),
    *(
        Style(pick_tilt=0.0, give_tilt=lean, take_tilt=lean, height=height, any_side=True)
        for height in (0.22, 0.3, 0.36, 0.15)
        for lean in (radians(60), radians(75))
    ),
    # Wide pads touch each other unless each gripper holds less of the cube.
    Style(half=0.018),
    Style(half=0.018, give_tilt=radians(60), take_tilt=radians(30)),
    *(
        Style(
            half=half,
            pick_tilt=radians(30),
            give_tilt=radians(30),
            take_tilt=radians(30),
            height=height,
        )
        for half, height in ((0.018, 0.22), (0.022, 0.3))
    ),
)


def hand_over(task: TaskEnv, seed: int) -> NDArray[np.float32]:
    """Return the actions of the hand-over, (T, A).

    Args:
        task: A TwoRobotPickCube; says layout and physics.
        seed: The episode.

    Raises:
        TaskError: If an arm has no fingers, or cannot reach what it should.
    """
    need_fingers(task, "the hand-over", GIVER, TAKER)
    return first_success(
        task,
        seed,
        lambda scene: [
            _HandOver(style, scene.base(GIVER), scene.base(TAKER)).script() for style in STYLES
        ],
    )


class _HandOver:
    """One hand-over between two bases: where each gripper goes, worked out from the scene."""

    def __init__(self, style: Style, giver_base: Floats, taker_base: Floats) -> None:
        self.style = style
        self.forward = heading(giver_base, taker_base)
        self.ahead = np.array([np.cos(self.forward), np.sin(self.forward), 0.0])
        middle = (giver_base + taker_base) / 2
        # Between the arms, and as far to the side as (0, 0), about which cube and goal are.
        aside = middle @ self.ahead * self.ahead - middle
        meeting = middle + aside + style.beyond * self.ahead
        self.meeting = np.array([*meeting[:2], style.height])

    def script(self) -> Script:
        cube_held = partial(Scene.grasps, robot=GIVER, body=CUBE)
        cube_taken = partial(Scene.grasps, robot=TAKER, body=CUBE)
        return {
            GIVER: (
                Waypoint("above", partial(self.pick, back=0.06), OPEN, near=0.08),
                Waypoint("around", partial(self.pick, back=0.0), OPEN, near=0.02),
                Waypoint("grasp", None, CLOSED, steps=3, until=cube_held),
                Waypoint("present", self.present, CLOSED, near=0.03),
                Waypoint("release", None, OPEN, steps=2, after=("right.take",)),
                Waypoint("retreat", self.retreat, OPEN),
            ),
            TAKER: (
                Waypoint("ready", partial(self.expect, back=0.07), OPEN, near=0.05),
                Waypoint("around", self.take, OPEN, near=0.02, after=("left.present",)),
                Waypoint("take", None, CLOSED, steps=3, until=cube_taken),
                Waypoint("carry", self.carry, CLOSED, near=0.02, after=("left.release",)),
            ),
        }

    def pick(self, scene: Scene, back: float) -> list[Pose]:
        position, quaternion = scene.body(CUBE)
        yaw, tilt = yaw_of(quaternion), self.style.pick_tilt
        if self.style.any_side:
            sides = [yaw + turn * np.pi / 2 for turn in QUARTERS]
        else:
            sides = [squared(self.forward, yaw)]
        return [self._grip(position, side, tilt, back) for side in sides]

    def present(self, scene: Scene) -> list[Pose]:
        return [
            holding(
                scene, GIVER, CUBE, self.meeting, gripper_facing(self.forward, self.style.give_tilt)
            )
        ]

    def retreat(self, scene: Scene) -> list[Pose]:
        return [backed_off(scene.tcp(GIVER), 0.1)]

    def expect(self, scene: Scene, back: float) -> list[Pose]:
        return [self._grip(self.meeting, self.forward + np.pi, self.style.take_tilt, back)]

    def take(self, scene: Scene) -> list[Pose]:
        cube, _ = scene.body(CUBE)
        opposite = 2 * cube - scene.tcp(GIVER)[0]
        return [(opposite, gripper_facing(self.forward + np.pi, self.style.take_tilt))]

    def carry(self, scene: Scene) -> list[Pose]:
        goal, _ = scene.body(GOAL)
        _, now = scene.tcp(TAKER)
        leaning = [multiply(now, turn("y", lean)) for lean in CARRY_LEANS]
        return [holding(scene, TAKER, CUBE, goal, quaternion) for quaternion in leaning]

    def _grip(self, cube: Floats, direction: float, tilt: float, back: float = 0.0) -> Pose:
        """Hold the cube's half that faces the gripper, or stay ``back`` (m) before that."""
        towards = np.array([np.cos(direction), np.sin(direction), 0.0])
        pose = cube - self.style.half * towards, gripper_facing(direction, tilt)
        return backed_off(pose, back)

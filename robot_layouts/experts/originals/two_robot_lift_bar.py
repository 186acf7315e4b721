"""TwoRobotLiftBar: each arm takes one end of the bar, and both raise it step by step together."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from math import pi

import numpy as np
from numpy.typing import NDArray

from robot_layouts.experts.geometry import gripper_facing, turn, yaw_of
from robot_layouts.experts.grasps import bringing, need_fingers, pick
from robot_layouts.experts.rehearsal import first_success
from robot_layouts.experts.script import CLOSED, Pose, Scene, Script, Waypoint
from robot_layouts.kinematics.rotations import rotate
from tasks import TaskEnv
from tasks.originals.two_robot_lift_bar import GRIP, HALF_THICKNESS, HEIGHT

BAR = "bar"
SIDES = {"left": -1.0, "right": 1.0}  # whose end of the bar, along its own x axis


@dataclass(frozen=True)
class Style:
    """How the bar is lifted.

    Attributes:
        legs: In how many parts; between them the arms' joints go straight, not the bar.
        beyond: How far above the height that counts it is brought (m).
        near: How near each arm must come to the end of a part before the next (rad).
        ready: How near each gripper must come to its place above the bar before it goes down (rad).
    """

    legs: int = 4
    beyond: float = 0.02
    near: float = 0.04
    ready: float = 0.1


STYLES = (
    Style(),
    Style(ready=0.02),
    Style(legs=8, near=0.02, ready=0.02),
    Style(legs=4, beyond=0.04, near=0.08, ready=0.02),
)


def lift_for_two(task: TaskEnv, seed: int) -> NDArray[np.float32]:
    """Return the actions of both arms, (T, A).

    Args:
        task: A TwoRobotLiftBar; says layout and physics.
        seed: The episode.

    Raises:
        TaskError: If an arm has no fingers, or cannot reach what it should.
    """
    need_fingers(task, "lifting the bar", *SIDES)
    return first_success(task, seed, lambda scene: [_script(style, scene) for style in STYLES])


def _script(style: Style, scene: Scene) -> Script:
    start, quaternion = scene.body(BAR)
    level = turn("z", yaw_of(quaternion))
    tops = np.linspace(HALF_THICKNESS, HEIGHT + style.beyond, style.legs + 1)[1:]

    def raised(scene: Scene, robot: str, height: float) -> list[Pose]:
        place = np.array([*start[:2], height])
        return [bringing(scene, robot, BAR, (place, level))]

    script: dict[str, tuple[Waypoint, ...]] = {}
    for robot, other in (("left", "right"), ("right", "left")):
        before = [f"{other}.grasp {BAR}", *(f"{other}.raise {i}" for i in range(style.legs))]
        lift = [
            Waypoint(
                f"raise {i}",
                partial(raised, robot=robot, height=height),
                CLOSED,
                after=(before[i],),
                near=style.near,
            )
            for i, height in enumerate(tops)
        ]
        script[robot] = (*pick(robot, BAR, partial(_grips, robot=robot), ready=style.ready), *lift)
    return script


def _grips(scene: Scene, robot: str) -> list[Pose]:
    """The gripper straight down over its end, its fingers on the bar's long sides."""
    position, quaternion = scene.body(BAR)
    place = position + rotate(quaternion, np.array([SIDES[robot] * GRIP, 0.0, 0.0]))
    along = yaw_of(quaternion)
    return [(place, gripper_facing(along + turned, 0.0)) for turned in (0.0, pi)]

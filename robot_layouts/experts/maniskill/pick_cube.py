"""PickCube: grasp the cube from above and carry it to the goal."""

from __future__ import annotations

from dataclasses import dataclass
from math import radians

import numpy as np
from numpy.typing import NDArray

from robot_layouts.experts.grasps import cube_grips, held_at, need_fingers, pick
from robot_layouts.experts.rehearsal import first_success
from robot_layouts.experts.script import CLOSED, Pose, Scene, Script, Waypoint
from tasks import TaskEnv

ARM, CUBE, GOAL = "arm", "cube", "goal_site"


@dataclass(frozen=True)
class Style:
    """How the cube is picked and carried.

    Attributes:
        above: How high above the cube the gripper gets ready (m).
        ready: How near it must come to that place before it goes down (rad).
        yaws: Turns about the vertical to choose from at the goal (rad).
    """

    above: float = 0.05
    ready: float = 0.1
    yaws: tuple[float, ...] = (0.0,)


# How the gripper may lean at the goal; the quickest is taken (rad).
LEANS = tuple(map(radians, (0, -20, -40, 20, 40)))

# Tried in this order. The first solves each of the seeds 0 … 99.
STYLES = (
    Style(),
    Style(yaws=(0.0, -0.3, 0.3, -0.6, 0.6)),
    Style(above=0.08, ready=0.05),
)


def pick_cube(task: TaskEnv, seed: int) -> NDArray[np.float32]:
    """Return the actions that bring the cube to the goal, (T, A).

    Args:
        task: A PickCube; says layout and physics.
        seed: The episode.

    Raises:
        TaskError: If the arm has no fingers, or cannot reach what it should.
    """
    need_fingers(task, "picking the cube", ARM)
    return first_success(task, seed, lambda scene: [_script(style) for style in STYLES])


def _script(style: Style) -> Script:
    def carry(scene: Scene) -> list[Pose]:
        return held_at(scene, ARM, CUBE, scene.body(GOAL)[0], style.yaws, LEANS)

    picking = pick(ARM, CUBE, _grips, above=style.above, ready=style.ready)
    return {ARM: (*picking, Waypoint("carry", carry, CLOSED, near=0.0))}


def _grips(scene: Scene) -> list[Pose]:
    return cube_grips(scene.body(CUBE))

"""Pulling a cube nearer with an L-shaped tool that passes it aside and hooks it from behind."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from math import radians

import numpy as np
from numpy.typing import NDArray

from robot_layouts.experts.geometry import (
    backed_off,
    gripper_facing,
    heading,
    planar_distance,
    turn,
    yaw_of,
)
from robot_layouts.experts.grasps import holding, need_fingers
from robot_layouts.experts.rehearsal import first_success
from robot_layouts.experts.script import CLOSED, OPEN, Pose, Scene, Script, Waypoint
from robot_layouts.kinematics.rotations import Floats, multiply, rotate
from tasks import TaskEnv
from tasks.maniskill.pull_cube_tool import (
    CUBE_HALF_SIZE,
    HANDLE_LENGTH,
    HEIGHT,
    HOOK_LENGTH,
    PULLED_DISTANCE,
)

ARM, CUBE, TOOL = "arm", "cube", "l_shape_tool"
LIFT = 0.003  # of the tool over the table while it moves (m)
BESIDE = 0.06  # of the cube's middle from the handle's, where the hook catches it (m)
BEYOND = 0.05  # nearer than the distance asked for, so that the cube surely gets there (m)
CLEARANCE = 0.05  # between the tool and the cube's middle while the tool turns there (m)


@dataclass(frozen=True)
class Style:
    """How the cube is pulled.

    Attributes:
        along: How far from the handle's end it is held (m).
        tilt: Angle of the gripper from straight down, towards the hook (rad).
        gap: Between the hook and the cube before it is pulled (m).
        swing: How far aside the tool passes the cube, as an angle seen from the arm (rad).
    """

    along: float = 0.02
    tilt: float = 0.0
    gap: float = 0.01
    swing: float = radians(8)


STYLES = (
    Style(),
    Style(gap=0.005, along=0.04, tilt=radians(10)),
    Style(gap=0.0, along=0.04, tilt=radians(10)),
    Style(gap=0.02),
    Style(gap=0.005),
    Style(gap=0.0),
    Style(gap=0.005, swing=radians(7)),
    Style(tilt=radians(15)),
    Style(swing=radians(10)),
)


def pull(task: TaskEnv, seed: int) -> NDArray[np.float32]:
    """Return the actions that pull the cube near, (T, A).

    Args:
        task: A PullCubeTool; says layout and physics.
        seed: The episode.

    Raises:
        TaskError: If the arm has no fingers, or cannot reach the tool.
    """
    need_fingers(task, "pulling with a tool", ARM)
    return first_success(
        task, seed, lambda scene: [_Pull(style, scene.base(ARM)).script() for style in STYLES]
    )


class _Pull:
    """One pull.

    The tool always points the same way as seen from the arm's base to the cube, or is swung aside
    from there about the base. Distances are those of the handle's end from the base.
    """

    def __init__(self, style: Style, base: Floats) -> None:
        self.style, self.base = style, base
        # from the handle's end to the cube's middle, when the hook is behind it
        self.inside = HANDLE_LENGTH - HOOK_LENGTH - CUBE_HALF_SIZE - style.gap

    def script(self) -> Script:
        swing = self.style.swing
        held = partial(Scene.grasps, robot=ARM, body=TOOL)
        return {
            ARM: (
                Waypoint("above", partial(self.pick, back=0.06), OPEN, near=0.1),
                Waypoint("around", partial(self.pick, back=0.0), OPEN, near=0.05),
                Waypoint("grasp", None, CLOSED, steps=2, until=held),
                _drawn("aside", partial(self.extend, share=0.0, swing=swing), near=0.1),
                _drawn("past", partial(self.extend, share=0.5, swing=swing), near=0.1),
                _drawn("beyond", partial(self.extend, share=1.0, swing=swing), near=0.06),
                _drawn("behind", partial(self.extend, share=1.0, swing=0.0), near=0.04),
                _drawn("pull", partial(self.retract, share=0.5), near=0.1),
                _drawn("near", partial(self.retract, share=1.0), near=0.1),
            )
        }

    def pick(self, scene: Scene, back: float) -> list[Pose]:
        end, quaternion = scene.body(TOOL)
        place = end + rotate(quaternion, np.array([self.style.along, 0.0, 0.0]))
        return [backed_off((place, gripper_facing(yaw_of(quaternion), self.style.tilt)), back)]

    def extend(self, scene: Scene, share: float, swing: float) -> list[Pose]:
        """Go a share of the way from where the tool can turn before the cube to behind it."""
        cube = planar_distance(self.base, scene.body(CUBE)[0])
        turning = min(
            planar_distance(self.base, scene.body(TOOL)[0]), cube - HANDLE_LENGTH - CLEARANCE
        )
        return [self._tool_at(scene, turning + share * (cube - self.inside - turning), swing)]

    def retract(self, scene: Scene, share: float) -> list[Pose]:
        """Go a share of the way from behind the cube to where it counts as pulled, and further."""
        start = planar_distance(self.base, scene.body(CUBE)[0]) - self.inside
        near = PULLED_DISTANCE - self.inside - self.style.gap - BEYOND
        return [self._tool_at(scene, start + share * (near - start), swing=0.0)]

    def _tool_at(self, scene: Scene, distance: float, swing: float) -> Pose:
        direction = heading(self.base, scene.body(CUBE)[0]) - swing
        turned = direction - yaw_of(scene.body(TOOL)[1])
        orientation = multiply(turn("z", turned), scene.tcp(ARM)[1])
        end = self.base + rotate(turn("z", direction), np.array([distance, -BESIDE, 0.0]))
        end[2] = HEIGHT / 2 + LIFT
        return holding(scene, ARM, TOOL, end, orientation)


def _drawn(name: str, to: Callable[[Scene], Sequence[Pose]], near: float) -> Waypoint:
    return Waypoint(name, to, CLOSED, near=near)

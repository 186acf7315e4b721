"""Inserting a peg: grasped from above near its tail, lined up with the hole, pushed in.

A peg whose tail is out of reach is pulled nearer by its middle first.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from math import pi, radians

import numpy as np
from numpy.typing import NDArray

from robot_layouts.experts.geometry import backed_off, gripper_facing, yaw_of
from robot_layouts.experts.grasps import bringing, need_fingers
from robot_layouts.experts.rehearsal import first_success
from robot_layouts.experts.script import CLOSED, OPEN, Pose, Scene, Script, Waypoint
from robot_layouts.kinematics.rotations import Floats, rotate
from tasks import TaskEnv
from tasks.maniskill.peg_insertion_side import INSERTED, PegDesign

ARM, PEG, BOX = "arm", "peg", "box_with_hole"
STANDOFF = 0.02  # m; of the peg's head from the box when it is lined up
SPARE = 0.01  # m; pushed further than success asks for
STROKE = 0.01  # m; between waypoints along the hole's axis: joints move on arcs in between


@dataclass(frozen=True)
class Style:
    """How the peg is held.

    Attributes:
        behind: How far behind the peg's middle it is grasped (m).
        tilt: Angle of the gripper from straight down, its hand towards the peg's tail (rad).
        turned: Whether the gripper is turned about its approach by half a turn.
        pulled: How far the peg is pulled towards the arm first (m).
    """

    behind: float = 0.06
    tilt: float = 0.0
    turned: bool = False
    pulled: float = 0.0


# Tried in this order. The first solves 96 % of seeds 0 … 449.
STYLES = (
    Style(),
    Style(tilt=radians(15)),
    Style(behind=0.05),  # for pegs whose tail is out of reach
    Style(turned=True),
    Style(tilt=radians(30)),
    Style(tilt=radians(15), turned=True),
    Style(pulled=0.1),
)


def insert_peg(task: TaskEnv, seed: int) -> NDArray[np.float32]:
    """Return the actions that insert the peg, (T, A).

    Args:
        task: A PegInsertionSide; says layout and physics.
        seed: The episode.

    Raises:
        TaskError: If the arm has no fingers, or cannot reach what it should.
    """
    need_fingers(task, "inserting a peg", ARM)
    return first_success(
        task,
        seed,
        lambda scene: [
            _Insertion(style, scene.design, scene.base(ARM)).script() for style in STYLES
        ],
    )


class _Insertion:
    """One way for an arm at ``base`` (m) to insert a peg of one design."""

    def __init__(self, style: Style, design: PegDesign, base: Floats) -> None:
        self.style, self.design, self.base = style, design, base

    def script(self) -> Script:
        outside = -2 * self.design.half_length - STANDOFF  # of the peg's middle, along the hole
        inside = -self.design.half_length + INSERTED + SPARE
        depths = np.linspace(outside, inside, 1 + round((inside - outside) / STROKE))[1:]
        return {
            ARM: (
                *(self.pull() if self.style.pulled else ()),
                *self.grasp("tail", self.style.behind),
                Waypoint("lift", self.lifted, CLOSED, near=0.05),
                Waypoint("face", partial(self.in_hole, depth=outside), CLOSED, near=0.05),
                Waypoint("line up", partial(self.in_hole, depth=outside), CLOSED, near=0.01),
                *(
                    Waypoint(f"push {i}", partial(self.in_hole, depth=depth), CLOSED, near=0.015)
                    for i, depth in enumerate(depths)
                ),
            )
        }

    def pull(self) -> tuple[Waypoint, ...]:
        return (
            *self.grasp("middle", behind=0.0),
            Waypoint("pull", self.nearer, CLOSED, near=0.05),
            Waypoint("let go", None, OPEN, steps=2),
            Waypoint("off", self.lifted, OPEN, near=0.05),
        )

    def grasp(self, part: str, behind: float) -> tuple[Waypoint, ...]:
        held = partial(Scene.grasps, robot=ARM, body=PEG)
        return (
            Waypoint(f"above {part}", partial(self.grip, behind=behind, back=0.06), near=0.08),
            Waypoint(f"around {part}", partial(self.grip, behind=behind, back=0.0), near=0.02),
            Waypoint(f"grasp {part}", None, CLOSED, steps=2, until=held),
        )

    def grip(self, scene: Scene, behind: float, back: float) -> list[Pose]:
        position, quaternion = scene.body(PEG)
        place = position - behind * rotate(quaternion, _X)
        direction, tilt = yaw_of(quaternion), self.style.tilt
        if self.style.turned:
            direction, tilt = direction + pi, -tilt
        return [backed_off((place, gripper_facing(direction, tilt)), back)]

    def lifted(self, scene: Scene) -> list[Pose]:
        position, quaternion = scene.tcp(ARM)
        return [(position + [0.0, 0.0, 0.03], quaternion)]

    def nearer(self, scene: Scene) -> list[Pose]:
        position, quaternion = scene.tcp(ARM)
        way = (self.base - position) * (1.0, 1.0, 0.0)
        return [(position + self.style.pulled * way / np.linalg.norm(way), quaternion)]

    def in_hole(self, scene: Scene, depth: float) -> list[Pose]:
        """Bring the peg's middle onto the hole's axis, ``depth`` (m) beyond the box's middle."""
        position, quaternion = scene.body(BOX)
        place = position + rotate(quaternion, np.array([depth, *self.design.hole_centre]))
        return [bringing(scene, ARM, PEG, (place, quaternion))]


_X: Floats = np.array([1.0, 0.0, 0.0])

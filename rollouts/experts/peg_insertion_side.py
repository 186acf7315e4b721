"""Inserting a peg: grasped from above near its tail, lined up with the hole, pushed in."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from math import pi, radians

import numpy as np
from numpy.typing import NDArray

from rollouts.experts.geometry import Floats, backed_off, gripper_facing, rotate, yaw_of
from rollouts.experts.grasps import bringing, need_fingers
from rollouts.experts.rehearsal import first_success
from rollouts.experts.script import CLOSED, OPEN, Pose, Scene, Script, Waypoint
from tasks import MultiRobotTask
from tasks.peg_insertion_side import INSERTED, PegDesign

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
    """

    behind: float = 0.06
    tilt: float = 0.0
    turned: bool = False


# Tried in this order. The first solves 96 % of seeds 0 … 449.
STYLES = (
    Style(),
    Style(tilt=radians(15)),
    Style(behind=0.05),  # for pegs whose tail is out of reach
    Style(turned=True),
    Style(tilt=radians(30)),
    Style(tilt=radians(15), turned=True),
)


def insert_peg(task: MultiRobotTask, seed: int) -> NDArray[np.float32]:
    """Return the actions that insert the peg, (T, A).

    Args:
        task: A PegInsertionSide; says layout and physics.
        seed: The episode.

    Raises:
        TaskError: If the arm has no fingers, or cannot reach what it should.
    """
    need_fingers(task, "inserting a peg", ARM)
    return first_success(
        task, seed, lambda scene: [_Insertion(style, scene.design).script() for style in STYLES]
    )


class _Insertion:
    """One way to insert a peg of one design."""

    def __init__(self, style: Style, design: PegDesign) -> None:
        self.style, self.design = style, design

    def script(self) -> Script:
        held = partial(Scene.grasps, robot=ARM, body=PEG)
        outside = -2 * self.design.half_length - STANDOFF  # of the peg's middle, along the hole
        inside = -self.design.half_length + INSERTED + SPARE
        depths = np.linspace(outside, inside, 1 + round((inside - outside) / STROKE))[1:]
        return {
            ARM: (
                Waypoint("above", partial(self.grip, back=0.06), OPEN, near=0.08),
                Waypoint("around", partial(self.grip, back=0.0), OPEN, near=0.02),
                Waypoint("grasp", None, CLOSED, steps=2, until=held),
                Waypoint("lift", self.lift, CLOSED, near=0.05),
                Waypoint("face", partial(self.in_hole, depth=outside), CLOSED, near=0.05),
                Waypoint("line up", partial(self.in_hole, depth=outside), CLOSED, near=0.01),
                *(
                    Waypoint(f"push {i}", partial(self.in_hole, depth=depth), CLOSED, near=0.015)
                    for i, depth in enumerate(depths)
                ),
            )
        }

    def grip(self, scene: Scene, back: float) -> list[Pose]:
        position, quaternion = scene.body(PEG)
        place = position - self.style.behind * rotate(quaternion, _X)
        direction, tilt = yaw_of(quaternion), self.style.tilt
        if self.style.turned:
            direction, tilt = direction + pi, -tilt
        return [backed_off((place, gripper_facing(direction, tilt)), back)]

    def lift(self, scene: Scene) -> list[Pose]:
        position, quaternion = scene.tcp(ARM)
        return [(position + [0.0, 0.0, 0.03], quaternion)]

    def in_hole(self, scene: Scene, depth: float) -> list[Pose]:
        """Bring the peg's middle onto the hole's axis, ``depth`` (m) beyond the box's middle."""
        position, quaternion = scene.body(BOX)
        place = position + rotate(quaternion, np.array([depth, *self.design.hole_centre]))
        return [bringing(scene, ARM, PEG, (place, quaternion))]


_X: Floats = np.array([1.0, 0.0, 0.0])

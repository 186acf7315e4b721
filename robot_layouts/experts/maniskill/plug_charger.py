"""Plugging a charger in: grasped from above, lined up with the receptacle, pushed in."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from math import pi, radians

import numpy as np
from numpy.typing import NDArray

from robot_layouts.experts.geometry import backed_off, gripper_facing, turn, yaw_of
from robot_layouts.experts.grasps import bringing, need_fingers
from robot_layouts.experts.rehearsal import first_success
from robot_layouts.experts.script import CLOSED, OPEN, Pose, Scene, Script, Waypoint
from robot_layouts.kinematics.rotations import Floats, multiply, rotate
from tasks import TaskEnv
from tasks.maniskill.plug_charger import PRONG_HALF_SIZE

ARM, CHARGER, RECEPTACLE = "arm", "charger", "receptacle"
STANDOFF = 2 * PRONG_HALF_SIZE[0] + 0.01  # m; of the charger's body from the plate in line
CORRECTIONS = 3  # of the line before pushing: prongs have half a millimetre of play
STROKE = 0.003  # m; between waypoints along the way in


@dataclass(frozen=True)
class Style:
    """How the charger is held.

    Attributes:
        behind: How far behind its prongs' roots it is grasped; its body is 4 cm long (m).
        tilt: Angle of the gripper from straight down, its hand away from the receptacle (rad).
        turned: Whether the gripper is turned about its approach by half a turn.
    """

    behind: float = 0.03
    tilt: float = 0.0
    turned: bool = False


# Tried in this order. The first solves 47 of the seeds 0 … 49, the second the others.
STYLES = (
    Style(),
    Style(tilt=radians(15)),
    Style(behind=0.02),
    Style(behind=0.02, tilt=radians(15)),
    Style(tilt=radians(30)),
    Style(turned=True),
)


def plug_in(task: TaskEnv, seed: int) -> NDArray[np.float32]:
    """Return the actions that plug the charger in, (T, A).

    Args:
        task: A PlugCharger; says layout and physics.
        seed: The episode.

    Raises:
        TaskError: If the arm has no fingers, or cannot reach what it should.
    """
    need_fingers(task, "plugging a charger in", ARM)
    return first_success(task, seed, lambda scene: [_Plugging(style).script() for style in STYLES])


class _Plugging:
    """One way to plug the charger in."""

    def __init__(self, style: Style) -> None:
        self.style = style

    def script(self) -> Script:
        held = partial(Scene.grasps, robot=ARM, body=CHARGER)
        distances = np.linspace(STANDOFF, 0.0, 1 + round(STANDOFF / STROKE))[1:]
        in_line = partial(self.before, distance=STANDOFF)
        return {
            ARM: (
                Waypoint("above", partial(self.grip, back=0.06), OPEN, near=0.08),
                Waypoint("around", partial(self.grip, back=0.0), OPEN, near=0.01),
                Waypoint("grasp", None, CLOSED, steps=3, until=held),
                Waypoint("lift", self.lift, CLOSED, near=0.05),
                Waypoint("face", in_line, CLOSED, near=0.02),
                *(
                    Waypoint(f"line up {i}", in_line, CLOSED, near=0.001)
                    for i in range(CORRECTIONS)
                ),
                *(
                    Waypoint(f"push {i}", partial(self.before, distance=x), CLOSED, near=0.003)
                    for i, x in enumerate(distances)
                ),
            )
        }

    def grip(self, scene: Scene, back: float) -> list[Pose]:
        position, quaternion = scene.body(CHARGER)
        place = position + rotate(quaternion, np.array([-self.style.behind, 0.0, 0.0]))
        direction, tilt = yaw_of(quaternion), self.style.tilt
        if self.style.turned:
            direction, tilt = direction + pi, -tilt
        return [backed_off((place, gripper_facing(direction, tilt)), back)]

    def lift(self, scene: Scene) -> list[Pose]:
        position, quaternion = scene.tcp(ARM)
        return [(position + [0.0, 0.0, 0.05], quaternion)]

    def before(self, scene: Scene, distance: float) -> list[Pose]:
        """Bring the charger in line with the receptacle, ``distance`` (m) from plugged in."""
        position, quaternion = scene.body(RECEPTACLE)
        place = position + rotate(quaternion, np.array([distance, 0.0, 0.0]))
        return [bringing(scene, ARM, CHARGER, (place, multiply(quaternion, _FACING)))]


_FACING: Floats = turn("z", pi)

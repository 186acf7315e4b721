"""Standing a peg up: held loosely by one end, it turns between the fingers as that end rises."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from math import radians

import numpy as np
from numpy.typing import NDArray

from robot_layouts.experts.geometry import backed_off, gripper_facing, heading
from robot_layouts.experts.grasps import need_fingers
from robot_layouts.experts.rehearsal import first_success
from robot_layouts.experts.script import OPEN, Pose, Scene, Script, Waypoint
from robot_layouts.kinematics.rotations import Floats, rotate
from tasks import TaskEnv
from tasks.maniskill.lift_peg_upright import PEG_HALF_LENGTH

ARM, PEG = "arm", "peg"
HELD_AT = 0.09  # from the peg's middle (m)
CORRECTIONS = 10  # of where the held end goes, once it is nearly up


@dataclass(frozen=True)
class Style:
    """How the peg is stood up.

    Attributes:
        end: Which end is held, 1 for the one nearer to the arm, -1 for the other.
        grip: Action number of the gripper meanwhile: tight enough for the peg's weight, loose
            enough that the peg turns. At 0.32 the fingers would only just touch it.
        shift: How far the held end goes towards the other one while it rises (m).
        tilt: Angle of the gripper from straight down when it grasps, away from the arm (rad).
        upright_tilt: The same when the peg stands (rad).
    """

    end: int = 1
    grip: float = 0.2
    shift: float = 0.05
    tilt: float = radians(-15)
    upright_tilt: float = radians(20)


STYLES = (
    Style(),
    Style(shift=0.1),
    Style(shift=0.1, tilt=0.0),
    Style(tilt=0.0, upright_tilt=0.0),
    Style(end=-1, tilt=0.0, upright_tilt=0.0),
    Style(end=-1, tilt=0.0, upright_tilt=0.0, shift=0.1),
)


def stand_up(task: TaskEnv, seed: int) -> NDArray[np.float32]:
    """Return the actions that stand the peg up, (T, A).

    Args:
        task: A LiftPegUpright; says layout and physics.
        seed: The episode.

    Raises:
        TaskError: If the arm has no fingers, or cannot reach the peg.
    """
    need_fingers(task, "standing a peg up", ARM)
    return first_success(
        task, seed, lambda scene: [_StandUp(style, scene).script() for style in STYLES]
    )


class _StandUp:
    """One way to stand the peg up, worked out from how it lies."""

    def __init__(self, style: Style, scene: Scene) -> None:
        self.style = style
        self.middle, quaternion = scene.body(PEG)
        axis = rotate(quaternion, _PEG_AXIS)
        outward = np.sign(axis @ (self.middle - scene.base(ARM)))
        self.held_side = -outward * style.end  # of the peg's own x axis
        self.to_held = self.held_side * axis
        self.direction = heading(np.zeros(3), outward * axis)

    def script(self) -> Script:
        grip = self.style.grip
        held = partial(Scene.grasps, robot=ARM, body=PEG)
        corrections = range(CORRECTIONS)
        return {
            ARM: (
                Waypoint("above", partial(self.pick, back=0.05), OPEN, near=0.1),
                Waypoint("around", partial(self.pick, back=0.0), OPEN, near=0.05),
                Waypoint("grasp", None, grip, steps=2, until=held),
                Waypoint("raise", self.raised, grip, near=0.05),
                *(Waypoint(f"over {i}", self.over, grip, near=0.02) for i in corrections),
            )
        }

    def pick(self, scene: Scene, back: float) -> list[Pose]:
        place = self.middle + HELD_AT * self.to_held
        return [backed_off((place, gripper_facing(self.direction, self.style.tilt)), back)]

    def raised(self, scene: Scene) -> list[Pose]:
        return [self._upright(self.middle + (HELD_AT - self.style.shift) * self.to_held)]

    def over(self, scene: Scene) -> list[Pose]:
        """Bring the held end over the one on the table."""
        middle, quaternion = scene.body(PEG)
        return [
            self._upright(middle - PEG_HALF_LENGTH * self.held_side * rotate(quaternion, _PEG_AXIS))
        ]

    def _upright(self, foot: Floats) -> Pose:
        height = PEG_HALF_LENGTH + HELD_AT
        orientation = gripper_facing(self.direction, self.style.upright_tilt)
        return np.array([*foot[:2], height]), orientation


_PEG_AXIS = np.array([1.0, 0.0, 0.0])

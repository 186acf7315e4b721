"""How a task's places and sizes fit the robots that it is made with.

A task is declared in numbers for its own robots. Other robots reach less or farther, stand
elsewhere, and hold smaller or larger things: their `Fit` says where the origin of the declaration
lies between them, how it is turned, and by which factor it is larger.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2, cos, pi, sin

from layouts import Layout
from layouts.frames import Rectangle
from layouts.placement import Placement
from layouts.shared_place import shared_place
from robot_layouts.kinematics.quaternions import multiplied
from robots import DescriptorError, RobotDescriptor, TaskError
from robots.descriptor import Quaternion, Vector3
from robots.gripper_motion import gripper_motion

_ROOM = 0.04  # m that a declaration for a Panda needs about its origin, in reach of all arms
_HELD = 0.75  # of a gripper's opening that a body to be held may take
_SPLAYED = 0.28  # rad; between jaws that are turned more a body is held by its edges, and slips out
_LARGEST, _SMALLEST = 3.0, 0.05


@dataclass(frozen=True)
class Fit:
    """Where a declaration's frame lies in the world, and how large it is there.

    Attributes:
        scale: Factor on all lengths.
        x: Of its origin (m, world).
        y: Of its origin (m, world).
        yaw: How it is turned about z (rad).
    """

    scale: float = 1.0
    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0

    @property
    def as_declared(self) -> bool:
        """Whether it changes nothing."""
        return self == AS_DECLARED

    def length(self, declared: float) -> float:
        """Return a declared length as it is here (m)."""
        return declared if self.as_declared else declared * self.scale

    def place(self, declared: Vector3) -> Vector3:
        """Return a declared place as it is here (m, world)."""
        if self.as_declared:
            return declared
        x, y, z = (self.scale * along for along in declared)
        c, s = cos(self.yaw), sin(self.yaw)
        return (self.x + c * x - s * y, self.y + s * x + c * y, z)

    def turned(self, declared: Quaternion) -> Quaternion:
        """Return a declared orientation as it is here, wxyz."""
        if self.as_declared:
            return declared
        return multiplied((cos(self.yaw / 2), 0.0, 0.0, sin(self.yaw / 2)), declared)


AS_DECLARED = Fit()


def fit_to(layout: Layout, declared: Layout, held: float, table: Rectangle | None = None) -> Fit:
    """Return how a declaration fits other robots, or others' places.

    Its origin lies where all arms reach best, its y axis points from the first arm to the second,
    and it is as much larger as the arms reach farther, unless that is more than their grippers
    can hold or than there is room.

    Args:
        layout: The robots that are to do the task.
        declared: The task's own layout.
        held: Width of the widest body that they hold, as declared (m).
        table: Outline of the table, x_min, y_min, x_max, y_max (m).

    Raises:
        TaskError: If no place is in reach of all arms.
        AssetError: If robot files cannot be found.
    """
    arms = [layout.arm(place) for place in declared.places]
    own = [declared.arm(place) for place in declared.places]
    if all(_alike(*pair) for pair in zip(arms, own, strict=True)):
        return AS_DECLARED
    scale = min(a.robot.reach for a in arms) / min(a.robot.reach for a in own)
    if held:
        scale = min([scale, *(_holds(arm.robot) / held for arm in arms if _opening(arm.robot))])
    if (shared := shared_place(layout, tuple(declared.places), table)) is None:
        robots = {place: layout.arm(place).robot.name for place in declared.places}
        names = ", ".join(f"{place!r} ({robot})" for place, robot in robots.items())
        raise TaskError(
            f"no place on the ground is in reach of all of {names}, gripper down; place them nearer"
            " to each other, as layouts.face_to_face(…, spacing='auto') does"
        )
    (x, y), room = shared
    scale = min(scale, room / _ROOM)
    (x0, y0, _), (x1, y1, _) = (arm.base_position for arm in (arms[0], arms[-1]))
    yaw = atan2(y1 - y0, x1 - x0) - pi / 2 if len(arms) > 1 else 0.0
    return Fit(min(max(scale, _SMALLEST), _LARGEST), x, y, yaw)


def _alike(arm: Placement, own: Placement) -> bool:
    """Return whether an arm stands where a task's own does, and reaches and holds as much."""
    if arm.robot == own.robot:
        return arm.base_pose == own.base_pose
    same = (arm.base_pose, arm.robot.reach) == (own.base_pose, own.robot.reach)
    return same and _opening(arm.robot) == _opening(own.robot)


def _opening(robot: RobotDescriptor) -> float | None:
    """Return how wide a gripper opens, to 0.1 mm (m); None of one that has no fingers."""
    try:
        return round(gripper_motion(robot).widest, 4)
    except DescriptorError:
        return None


def _holds(robot: RobotDescriptor) -> float:
    """Return the width of the widest body that a gripper holds well (m)."""
    motion = gripper_motion(robot)
    return min(_HELD * motion.widest, motion.widest_within(_SPLAYED))

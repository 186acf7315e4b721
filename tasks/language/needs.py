"""What a place of a task needs of the robot that stands there."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from robot_layouts.core.bounds import checked_flag, checked_number, shown
from robots import RobotDescriptor, TaskError
from robots.action_split import JointGroup, is_gripper

HOLD, ACT = "hold", "act"  # what robots do that have no place in a task
LARGEST = 100.0  # m


@dataclass(frozen=True)
class Needs:
    """What a robot must have to take a place; a robot that lacks it is refused at `tasks.make`.

    Attributes:
        fingers: Whether it must have two links that grasp; without them, `State.is_grasping` is
            never true.
        opening: How wide its gripper must open (m). That of jaws that swing is not known, and is
            not held against them.
        reach: How far its TCP must reach from its base axis (m). No robot is refused for that by a
            task that fits its robots: one that reaches less stands nearer, and makes it smaller.
        tcp_is_link: Whether its TCP must be a link, not a point between several.
        joints: Joints that it must drive, by name, of a task that reads them.

    Raises:
        TaskError: If a number, a flag or a name is invalid.
    """

    fingers: bool = False
    opening: float | None = None
    reach: float | None = None
    tcp_is_link: bool = False
    joints: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Refuse what no arm can have."""
        for name in ("fingers", "tcp_is_link"):
            checked_flag(name, getattr(self, name), TaskError)
        for name in ("opening", "reach"):
            if getattr(self, name) is not None:
                checked_number(name, getattr(self, name), 0.0, LARGEST, TaskError, "m")
        if not isinstance(self.joints, tuple) or not all(isinstance(j, str) for j in self.joints):
            raise TaskError(f"joints is {shown(self.joints)}; a tuple of names is needed")

    def missing(self, robot: RobotDescriptor) -> Iterator[str]:
        """Yield what a robot lacks, in words."""
        if (self.fingers or self.opening) and robot.fingers is None:
            yield "fingers that grasp, and it has none"
        elif self.opening is not None:
            opening = gripper_opening(robot)
            if opening is not None and opening < self.opening:
                yield f"a gripper that opens {self.opening:g} m, and its own opens {opening:g} m"
        if self.reach is not None and robot.reach < self.reach:
            yield f"a reach of {self.reach:g} m, and its own is {robot.reach:g} m"
        if lacking := [joint for joint in self.joints if joint not in robot.joints]:
            yield f"the joints {', '.join(lacking)}, and it does not drive them"
        if self.tcp_is_link and robot.tcp_position_links:
            links = ", ".join(robot.tcp_position_links)
            yield f"a TCP that is a link, and its own is a point between {links}"


def gripper_opening(robot: RobotDescriptor) -> float | None:
    """Return how wide a gripper of sliding fingers opens (m); None if it has none, or jaws."""
    grippers = (g for name, g in robot.action_split.groups.items() if is_gripper(name))
    return max((_widest(group) for group in grippers if group.unit == "m"), default=None)


def _widest(group: JointGroup) -> float:
    uppers = [upper for _, upper in group.ranges]
    uppers = uppers * len(group.joints) if group.mimic else uppers
    ways = zip(uppers, group.followers, strict=True)
    return sum(abs(upper * share + offset) for upper, (share, offset) in ways)

"""Joint-position control, generated from the robots' action splits, and how fast joints may be.

What control modes ask for besides is in `robot_layouts.simulation.control`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from layouts import Layout
from robot_layouts.simulation.maths import Floats
from robots import JointGroup, RobotDescriptor
from robots.urdf.model import UrdfModel


@dataclass(frozen=True)
class DrivenGroup:
    """A joint group of a layout, in its control mode.

    Attributes:
        robot: Name of its robot in the layout.
        name: Its own.
        arm: The robot or limb that it belongs to; None if that has no TCP.
        group: What is driven, and how.
        numbers: Where its numbers stand in an action.
        joints: Where its joints are among those of all robots.
        own: Where its robot's joints are among those of all robots.
    """

    robot: str
    name: str
    arm: str | None
    group: JointGroup
    numbers: slice
    joints: slice
    own: slice


def driven_groups(layout: Layout) -> Iterator[DrivenGroup]:
    """Yield the joint groups of a layout, also those that are held, in the order of the action."""
    arms = layout.arms_by_group
    number = joint = 0
    for robot, placement in layout.items():
        groups = placement.robot.action_split.groups
        own = slice(joint, joint + sum([len(group.joints) for group in groups.values()]))
        for name, group in groups.items():
            numbers = slice(number, number + group.size)
            joints = slice(joint, joint + len(group.joints))
            yield DrivenGroup(robot, name, arms.get((robot, name)), group, numbers, joints, own)
            number, joint = numbers.stop, joints.stop


class JointPositionController:
    """Turns flat actions into drive targets for every joint of every robot.

    All arithmetic is float32, as in native: float64 targets differ after one step.

    Attributes:
        action_dim: Number of action numbers A of all robots together.
        dof: Number of their joints.
    """

    def __init__(self, layout: Layout) -> None:
        """Lay out the robots' action numbers and joints, one robot after the other."""
        self.action_dim = layout.action_dim
        ranges: list[tuple[float, float]] = []  # of each action number
        clipped: list[float] = []  # where each action number is clipped
        drives: list[_Drive] = []  # of each driven joint
        for placement in layout.values():
            start = iter(placement.start_qpos)
            for group in placement.robot.action_split.groups.values():
                drives.extend(_drives(group, len(ranges), [next(start) for _ in group.joints]))
                # One that is not normalised is its own target: 0 + 1 · number.
                ranges.extend(group.ranges if group.normalised else [(-1.0, 1.0)] * group.size)
                clipped.extend([1.0 if group.normalised else np.inf] * group.size)
        self.dof = len(drives)
        low, high = np.array(ranges, np.float32).T
        half = np.float32(0.5)
        # Rows, as NumPy takes less time for one environment's if these have its shape.
        self._highest: Floats = np.array([clipped], np.float32)
        self._lowest: Floats = -self._highest
        sources = [drive.source for drive in drives]
        self._source = np.array(sources) % self.action_dim  # of what is held, any will do
        self._one_to_one = sources == list(range(len(ranges)))
        multipliers, offsets = np.array([drive[1:3] for drive in drives], np.float32).T
        centre, half_range = (half * x for x in (high + low, high - low))
        self._centre: Floats = (multipliers * centre[self._source] + offsets)[None]
        self._half_range: Floats = (multipliers * half_range[self._source])[None]
        self._relative: Floats = np.array([[drive.relative for drive in drives]], np.float32)

    def targets(self, action: Floats, qpos: Floats) -> Floats:
        """Return the drive targets of a batch of actions.

        Args:
            action: Shape (N, A); normalised numbers are clipped to [-1, 1].
            qpos: Current joint positions of all robots, those of each in the order of its
                descriptor, shape (N, dof) (rad, m).

        Returns:
            Shape (N, dof) (rad, m).
        """
        clipped = np.minimum(np.maximum(action, self._lowest), self._highest)
        driving = clipped if self._one_to_one else clipped.take(self._source, 1)
        target: Floats = self._centre + self._half_range * driving
        target += qpos * self._relative
        return target


class _Drive(NamedTuple):
    """How one joint follows the action: multiplier · mapped number + offset, or relative to it."""

    source: int
    multiplier: float
    offset: float
    relative: bool


def _drives(group: JointGroup, first: int, start: Sequence[float]) -> Iterator[_Drive]:
    """Yield how each joint of a group is driven.

    Args:
        group: The group.
        first: The first of its action numbers.
        start: Where its joints start (rad, m).
    """
    for i, (multiplier, offset) in enumerate(group.followers):
        if group.held:
            yield _Drive(first, 0.0, start[i], relative=False)
        elif not group.asks.positions:
            yield _Drive(first, 0.0, 0.0, relative=True)  # stays where it is
        else:
            source = first if group.mimic else first + i
            shift = 0.0 if group.delta else offset
            yield _Drive(source, multiplier, shift, group.delta)


class Leaders:
    """The leaders of a joint group, as one joint of which all others' places follow.

    Each joint's own target would let those that nothing stops go on alone, so that jaws which hold
    something splay. So before each step of physics leaders are driven at most their lead ahead of
    their mean place, which bounds the force, and the others to where the leaders are and as fast.

    Attributes:
        places: Where they stand among the group's joints.
    """

    def __init__(self, group: JointGroup) -> None:
        """Take a group that has some."""
        self.places = [group.joints.index(name) for name in group.leaders]
        followers = [group.followers[place] for place in self.places]
        self._multipliers, self._offsets = np.array(followers, float).T
        self._lead = group.lead

    def moved(
        self, wanted: float, qpos: NDArray[np.floating], qvel: NDArray[np.floating]
    ) -> tuple[float, float, float]:
        """Return where they are to go next, where they are, and how fast, as that one joint.

        Args:
            wanted: Where it is to be in the end.
            qpos: Positions of the leaders (rad, m).
            qvel: Their velocities.
        """
        value = float(((qpos - self._offsets) / self._multipliers).mean())
        speed = float((qvel / self._multipliers).mean())
        return min(max(wanted, value - self._lead), value + self._lead), value, speed


# Per unit of a joint: the least that is taken for its largest speed, what is taken where the URDF
# has none, and the most (1/s). Wrists of arms turn at 2π rad/s; URDFs also have 0, and 1e6. Fingers
# that slide at 0.2 m/s are light: a hit that harms nothing makes them ten times as fast.
SPEEDS = {"rad": (2.0, 2 * np.pi, 100.0), "m": (0.5, 1.0, 10.0)}


def joint_speeds(descriptor: RobotDescriptor, model: UrdfModel) -> NDArray[np.float32]:
    """Return the largest speed of each joint: the URDF's, where it has one that makes sense."""
    joints = {joint.name: joint for joint in model.moving}
    speeds: list[float] = []
    for joint in (joints[name] for name in descriptor.joints):
        least, usual, most = SPEEDS[joint.unit]
        speeds.append(min(max(joint.velocity or usual, least), most))
    return np.array(speeds, np.float32)


class LedGroup:
    """The drives of a joint group with leaders; see `Leaders`.

    Attributes:
        group: The group.
        places: Where its joints stand among all that are driven.
        multipliers: What each joint multiplies the group's value by.
        offsets: What it adds to that then.
        leads: Which of them are leaders.
    """

    def __init__(self, group: JointGroup, first: int) -> None:
        """Take a group, and where its first joint stands among all that are driven."""
        self.group = group
        self.places = slice(first, first + len(group.joints))
        self._leaders = Leaders(group)
        self.multipliers, self.offsets = np.array(group.followers, float).T
        self.leads = np.array([joint in group.leaders for joint in group.joints])

    def targets(self, wanted: float, qpos: Floats, qvel: Floats) -> tuple[Floats, Floats]:
        """Return targets of position and of velocity of the group's joints, each (joints,).

        Args:
            wanted: Target of position of its first joint, which tells that of all.
            qpos: Positions of its joints.
            qvel: Their velocities.
        """
        goal, leads = (wanted - self.offsets[0]) / self.multipliers[0], self._leaders.places
        ahead, value, speed = self._leaders.moved(goal, qpos[leads], qvel[leads])
        positions = self.multipliers * np.where(self.leads, ahead, value) + self.offsets
        return positions, np.where(self.leads, 0.0, self.multipliers * speed)


def linkages(layout: Layout) -> list[LedGroup]:
    """Return the joint groups of a layout that have leaders."""
    found: list[LedGroup] = []
    first = 0
    for placement in layout.values():
        for group in placement.robot.action_split.groups.values():
            if group.leaders:
                found.append(LedGroup(group, first))
            first += len(group.joints)
    return found

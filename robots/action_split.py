"""How the joints of a robot are grouped and driven, and which action numbers drive them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

from robot_layouts.core.errors import (
    DescriptorError,
    UnknownNameError,
    refuse,
    unknown_name_message,
)
from robot_layouts.core.schema import check, check_fields
from robots.commands import COMMANDS, FRAMES, JointCommand

JOINTS_OF_A_POSE = 6  # that an arm needs to choose place and orientation


def names(prefix: str, first: int, last: int, suffix: str = "") -> tuple[str, ...]:
    """Return ``prefix + str(i) + suffix`` for i from ``first`` to ``last``, both included."""
    return tuple(f"{prefix}{i}{suffix}" for i in range(first, last + 1))


def is_gripper(group: str) -> bool:
    """Tell whether a joint group drives a gripper: it is called one, as ``left_gripper`` is."""
    return "gripper" in group.split("_")


@dataclass(frozen=True)
class JointGroup:
    """Joints that are driven together, and the action numbers that drive them.

    An action number in [-1, 1] is mapped linearly onto [lower, upper], and clipped before; if the
    group is not ``normalised`` it is taken as it is. With ``delta`` the result is added to the
    joint's current position, otherwise it is the target itself. The drive is PhysX's implicit
    spring-damper in ``force`` mode.

    Attributes:
        joints: Joint names, in the order of the action numbers.
        lower: Value at action -1, one number for all joints or one per action number
            (``unit`` per control step when ``delta``, else ``unit``).
        upper: Value at action +1, same form as ``lower``.
        stiffness: Drive stiffness (N·m/rad or N/m), one number for all joints or one per joint.
        damping: Drive damping (N·m·s/rad or N·s/m), same form.
        force_limit: Largest drive force (N·m or N), same form.
        delta: Whether the action moves the target relative to the current position.
        mimic: Whether one action number drives every joint of the group (a parallel gripper).
        multipliers: In a mimic group, what each joint multiplies the value by; 1 if empty.
        offsets: In a mimic group that is not ``delta``, what each joint adds to it then
            (``unit``); 0 if empty.
        leaders: In a mimic group that is a linkage, the joints that carry its fingers. They are
            driven at most ``lead`` ahead of where they are, and all other joints to where these
            are, so that jaws stay parallel when something stops them. Empty if each joint goes to
            its own place.
        lead: How far ahead of its leaders' mean place the value may be (``unit``).
        held: Whether no action number drives the group: its joints are held where the layout
            starts them. ``lower`` and ``upper`` then mean nothing.
        armature: Inertia of motor and gear as the joint feels it (kg·m² or kg), one number for all
            joints or one per joint; a URDF has none. It keeps apart joints whose links push each
            other.
        unit: ``"rad"`` or ``"m"``.
        friction: Joint friction coefficient (dimensionless).
        reset_noise: Whether a reset adds joint noise to this group.
        limits: The (lower, upper) limit of each joint, as its URDF has it (``unit``); needed by
            control modes in which the action asks for positions.
        normalised: Whether action numbers lie in [-1, 1]; if not, they are in ``unit`` and lie
            in [lower, upper], but are not clipped.
        command: What the action numbers ask for; see `robots.commands.COMMANDS`. Where they ask
            for something else than joint positions, ``lower`` and ``upper`` are in its units.
        target: Whether what is ``delta`` is relative to where the group was last driven to, and
            not to where it is.
        frame: In which frames a ``delta`` of a TCP pose is; see `robots.commands.FRAMES`.
        root_link: Link whose frame TCP poses are in; the robot's root if None.
        approximate_ik: Whether control of the TCP goes as near to a pose as it gets where it
            cannot be reached: position first, then the orientation. The default is ManiSkill's way:
            an arm of six joints or more then stays where it is.
    """

    joints: tuple[str, ...]
    lower: float | tuple[float, ...]
    upper: float | tuple[float, ...]
    stiffness: float | tuple[float, ...]
    damping: float | tuple[float, ...]
    force_limit: float | tuple[float, ...]
    delta: bool = False
    mimic: bool = False
    unit: str = "rad"
    friction: float = 0.0
    reset_noise: bool = True
    limits: tuple[tuple[float, float], ...] = ()
    normalised: bool = True
    multipliers: tuple[float, ...] = ()
    offsets: tuple[float, ...] = ()
    held: bool = False
    armature: float | tuple[float, ...] = 0.0
    command: str = "position"
    target: bool = False
    frame: str = FRAMES[0]
    root_link: str | None = None
    leaders: tuple[str, ...] = ()
    lead: float = 0.0
    approximate_ik: bool = False

    def __post_init__(self) -> None:
        """Refuse empty groups, repeated joints, inverted ranges and non-physical drives."""
        check_fields(self, DescriptorError)
        refuse(self._problems(), DescriptorError)

    @classmethod
    def hold(
        cls,
        joints: tuple[str, ...],
        *,
        stiffness: float = 1e5,
        damping: float = 1e5,
        force_limit: float = 1e5,
        unit: str = "rad",
        armature: float | tuple[float, ...] = 0.0,
    ) -> JointGroup:
        """Return a group that is held where the layout starts it, and takes no action number.

        Args:
            joints: Joint names.
            stiffness: See `JointGroup`; stiff unless given; 0 makes the drive a brake.
            damping: See `JointGroup`.
            force_limit: See `JointGroup`.
            unit: ``"rad"`` or ``"m"``.
            armature: See `JointGroup`.
        """
        return cls(
            joints, -1.0, 1.0, stiffness, damping, force_limit, unit=unit, held=True,
            reset_noise=False, armature=armature,
        )  # fmt: skip

    def _problems(self) -> Iterator[str]:
        """Yield what is wrong with it."""
        if not self.joints:
            yield "a joint group needs at least one joint"
        if len(set(self.joints)) != len(self.joints):
            yield f"a joint group names a joint twice: {self.joints}"
        if self.unit not in ("rad", "m"):
            yield f"unit is {self.unit!r}; it must be 'rad' or 'm'"
        if self.command not in COMMANDS:
            yield unknown_name_message("command of a joint group", self.command, COMMANDS)
        if self.frame not in FRAMES:
            yield unknown_name_message("frame of a joint group", self.frame, FRAMES)
        yield from self._drive_problems()
        yield from self._mimic_problems()
        yield from self._command_problems()
        yield from self._range_problems()

    def _drive_problems(self) -> Iterator[str]:
        for name in ("stiffness", "damping", "force_limit", "armature"):
            given = getattr(self, name)
            if isinstance(given, tuple) and len(given) != len(self.joints):
                yield f"{name} has {len(given)} numbers; the group has joints {self.joints}"
        for name in ("stiffness", "damping", "force_limit", "friction", "armature"):
            for value in _spread(getattr(self, name), 1):
                if value < 0:
                    yield f"{name} is {value}; it must not be negative"

    def _mimic_problems(self) -> Iterator[str]:
        for name in ("multipliers", "offsets"):
            given: tuple[float, ...] = getattr(self, name)
            if given and not self.mimic:
                yield f"only a mimic group has {name}; {self.joints} is not one"
            if given and len(given) != len(self.joints):
                yield f"{name} has {len(given)} numbers; the group has joints {self.joints}"
        if not self.leaders and not self.lead:
            return
        if not self.mimic or self.delta:
            yield (
                f"only a mimic group that is driven to places has leaders; {self.joints} is not one"
            )
        for joint in self.leaders:
            if joint not in self.joints:
                yield unknown_name_message("leader of a joint group", joint, self.joints)
        if not (self.leaders and self.lead > 0):
            yield (
                f"the leaders of {self.joints} are {self.leaders} and lead is {self.lead}; a"
                " linkage needs at least one leader, and a lead above 0"
            )

    def _command_problems(self) -> Iterator[str]:
        if self.target and not self.delta:
            yield f"only a delta has a target; {self.joints} has no delta"
        take = f"{self.joints} take {self.command!r}"
        if self.command != "position" and (self.mimic or self.held):
            yield f"{take}; a group that is held or mimics takes positions only"
        if self.asks.drive and len(self.joints) != 3:
            yield f"{take}, which needs three joints: along x, along y, about z"
        if self.delta and not (self.asks.positions or self.asks.tcp):
            yield f"{take}, which asks for speeds; these are no delta"
        if self.command == "tcp_position" and not self.delta:
            yield f"{take}, which is a delta only"

    def _range_problems(self) -> Iterator[str]:
        for name, value in (("lower", self.lower), ("upper", self.upper)):
            if isinstance(value, tuple) and len(value) != self.size:
                yield f"{name} has {len(value)} numbers; the group {self.joints} takes {self.size}"
        if self.limits and len(self.limits) != len(self.joints):
            yield f"limits has {len(self.limits)} pairs; the group has joints {self.joints}"
        for low, high in (*self.ranges, *self.limits):
            if not low < high:
                yield f"range [{low}, {high}] of {self.joints} is not increasing"

    @property
    def size(self) -> int:
        """How many action numbers drive it: none if ``held``, one if ``mimic``, else one each.

        A TCP takes three or six, and joint positions with velocities two each.
        """
        if self.held:
            return 0
        return 1 if self.mimic else len(self.numbers)

    @property
    def approximates(self) -> bool:
        """Whether the TCP goes as near to a pose as it gets: also if it has too few joints."""
        return self.approximate_ik or len(self.joints) < JOINTS_OF_A_POSE

    @property
    def numbers(self) -> tuple[tuple[str, str], ...]:
        """What each action number moves, and its unit; of a mimic group what each joint does."""
        return COMMANDS[self.command].numbers(self.joints, self.unit)

    @property
    def asks(self) -> JointCommand:
        """What the action numbers ask for."""
        return COMMANDS[self.command]

    @property
    def ranges(self) -> tuple[tuple[float, float], ...]:
        """The (lower, upper) pair of each action number, in ``unit``."""
        lower, upper = (_spread(value, self.size) for value in (self.lower, self.upper))
        return tuple(zip(lower, upper, strict=True))

    @property
    def drives(self) -> tuple[tuple[float, float, float], ...]:
        """Stiffness, damping and force limit of each joint."""
        numbers = (self.stiffness, self.damping, self.force_limit)
        return tuple(zip(*(_spread(value, len(self.joints)) for value in numbers), strict=True))

    @property
    def armatures(self) -> tuple[float, ...]:
        """Armature of each joint (kg·m² or kg)."""
        return _spread(self.armature, len(self.joints))

    @property
    def followers(self) -> tuple[tuple[float, float], ...]:
        """Multiplier and offset (``unit``) of each joint; (1, 0) unless a mimic group has some."""
        ones, zeros = (1.0,) * len(self.joints), (0.0,) * len(self.joints)
        return tuple(zip(self.multipliers or ones, self.offsets or zeros, strict=True))

    @property
    def bounds(self) -> tuple[tuple[float, float], ...]:
        """The least and the largest value of each action number: (-1, 1) if normalised."""
        return ((-1.0, 1.0),) * self.size if self.normalised else self.ranges

    def by_position(self) -> JointGroup:
        """Return the group with actions that are joint positions (``unit``) within the limits.

        Raises:
            DescriptorError: If the group has no limits.
        """
        if not self.limits:
            raise DescriptorError(
                f"the joint group {self.joints} has no limits, which control by position needs;"
                " give it limits=((lower, upper), ...), one pair per joint"
            )
        limits = self.limits[: self.size]
        lower, upper = (tuple(limit[side] for limit in limits) for side in (0, 1))
        return replace(self, lower=lower, upper=upper, delta=False, normalised=False)


def _spread(value: float | tuple[float, ...], count: int) -> tuple[float, ...]:
    return value if isinstance(value, tuple) else (value,) * count


class ActionSplit(Mapping[str, slice]):
    """The ordered joint groups of one robot, and the slice of its action that each one takes.

    Behaves as a read-only mapping from group name to slice: for a Panda,
    ``split["arm"] == slice(0, 7)`` and ``split["gripper"] == slice(7, 8)``.

    Attributes:
        groups: The joint groups by name.
        joints: Every driven joint, group after group.
        size: How many action numbers drive them.
    """

    __slots__ = ("_slices", "groups", "joints", "size")

    groups: Mapping[str, JointGroup]
    joints: tuple[str, ...]
    size: int

    def __init__(self, **groups: JointGroup) -> None:
        """Lay the groups' action numbers one after the other, in the order given.

        Args:
            groups: Joint groups by name, for example ``arm=JointGroup(...)``.

        Raises:
            DescriptorError: If no group takes an action number, a joint is in two groups, or
                something is no group.
        """
        check(groups, Mapping[str, JointGroup], "ActionSplit", DescriptorError)
        if not any(group.size for group in groups.values()):
            raise DescriptorError("an action split needs at least one joint group to drive")
        self._lay_out(groups)

    def _lay_out(self, groups: Mapping[str, JointGroup]) -> None:
        joints = [joint for group in groups.values() for joint in group.joints]
        twice = sorted({joint for joint in joints if joints.count(joint) > 1})
        if twice:
            raise DescriptorError(f"joints {twice} are in more than one group of the action split")
        slices: dict[str, slice] = {}
        start = 0
        for name, group in groups.items():
            slices[name] = slice(start, start + group.size)
            start += group.size
        object.__setattr__(self, "groups", MappingProxyType(dict(groups)))
        object.__setattr__(self, "_slices", slices)
        object.__setattr__(self, "joints", tuple(joints))
        object.__setattr__(self, "size", start)

    def __setattr__(self, name: str, value: object) -> None:
        """Refuse: a split is frozen."""
        raise AttributeError(f"ActionSplit is frozen; make a new one to change {name!r}")

    def __getitem__(self, name: str) -> slice:
        """Return the slice of the robot's action that drives the group ``name``."""
        if name not in self._slices:
            raise UnknownNameError("joint group", name, self._slices)
        return self._slices[name]

    def __iter__(self) -> Iterator[str]:
        """Iterate over the group names in action order."""
        return iter(self._slices)

    def __len__(self) -> int:
        """Return the number of groups."""
        return len(self._slices)

    def __eq__(self, other: object) -> bool:
        """Compare groups and their order."""
        if not isinstance(other, ActionSplit):
            return NotImplemented
        return list(self.groups.items()) == list(other.groups.items())

    def __hash__(self) -> int:
        """Hash groups and their order."""
        return hash(tuple(self.groups.items()))

    def __repr__(self) -> str:
        """Show the groups as they would be written."""
        return f"ActionSplit({', '.join(f'{k}={v!r}' for k, v in self.groups.items())})"

    def __reduce__(self) -> tuple[object, ...]:
        """Pickle by the groups."""
        return (_split_from_groups, (dict(self.groups),))

    def replace(self, **groups: JointGroup) -> ActionSplit:
        """Return a split with some groups exchanged (new names go to the end)."""
        return ActionSplit(**{**self.groups, **groups})

    def held(self, *groups: str) -> ActionSplit:
        """Return a split in which groups take no number and are held where they start.

        Args:
            groups: Their names; all if none is given.
        """
        still = groups or self.groups
        return _split_from_groups(
            {name: _held(g) if name in still else g for name, g in self.groups.items()}
        )


def _held(group: JointGroup) -> JointGroup:
    still = JointGroup.hold(
        group.joints, stiffness=0.0, damping=0.0, force_limit=0.0, unit=group.unit
    )
    drives = ("stiffness", "damping", "force_limit", "friction", "limits")
    return replace(still, **{name: getattr(group, name) for name in drives})


def _split_from_groups(groups: dict[str, JointGroup]) -> ActionSplit:
    split = ActionSplit.__new__(ActionSplit)  # here, a group that nothing drives is no error
    split._lay_out(groups)  # pyright: ignore[reportPrivateUsage]
    return split


@dataclass(frozen=True)
class ActionNumber:
    """One number of an action, as `RobotDescriptor.describe_action` tells it.

    Attributes:
        index: Position in the robot's action.
        name: ``group.joint``; a mimic group has one number, named after the group.
        group: The joint group it belongs to.
        joints: The joints it drives.
        unit: Unit of ``lower`` and ``upper``: rad or m, "per step" when relative.
        lower: Effect of the least value.
        upper: Effect of the largest value.
        relative: Whether the effect is added to the current joint position.
        normalised: Whether the number lies in [-1, 1]; if not, it is in ``unit`` itself, from
            ``lower`` to ``upper``, and not clipped.
    """

    index: int
    name: str
    group: str
    joints: tuple[str, ...]
    unit: str
    lower: float
    upper: float
    relative: bool
    normalised: bool = True

    def __str__(self) -> str:
        """Return one readable line."""
        sign = "+" if self.relative else ""
        values = f"{self.lower:{sign}g} … {self.upper:{sign}g} {self.unit}"
        return f"{self.index:>2}  {self.name:<24} {values}"

"""What a robot is: files, joint groups, gripper, keyframes; data that checks itself, no more."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import NoReturn, Protocol

from robots.errors import DescriptorError, UnknownNameError

Vector3 = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]  # wxyz

IDENTITY: Quaternion = (1.0, 0.0, 0.0, 0.0)

CONTROL_MODES = ("pd_joint_delta_pos", "pd_joint_pos")  # ManiSkill's names


class UrdfSource(Protocol):
    """Where a URDF comes from; see `robots.locator.UrdfLocator`."""

    def locate(self, *, pictures: bool = False) -> Path:
        """Return the path of a complete, checked URDF on this machine."""
        ...


def names(prefix: str, first: int, last: int) -> tuple[str, ...]:
    """Return ``prefix + str(i)`` for i from ``first`` to ``last``, both included."""
    return tuple(f"{prefix}{i}" for i in range(first, last + 1))


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
        stiffness: Drive stiffness (N·m/rad or N/m).
        damping: Drive damping (N·m·s/rad or N·s/m).
        force_limit: Largest drive force (N·m or N).
        delta: Whether the action moves the target relative to the current position.
        mimic: Whether one action number drives every joint of the group (a parallel gripper).
        unit: ``"rad"`` or ``"m"``.
        friction: Joint friction coefficient (dimensionless).
        reset_noise: Whether a reset adds joint noise to this group.
        limits: The (lower, upper) limit of each joint, as its URDF has it (``unit``); needed by
            control modes in which the action asks for positions.
        normalised: Whether action numbers lie in [-1, 1]; if not, they are in ``unit`` and lie
            in [lower, upper], but are not clipped.
    """

    joints: tuple[str, ...]
    lower: float | tuple[float, ...]
    upper: float | tuple[float, ...]
    stiffness: float
    damping: float
    force_limit: float
    delta: bool = False
    mimic: bool = False
    unit: str = "rad"
    friction: float = 0.0
    reset_noise: bool = True
    limits: tuple[tuple[float, float], ...] = ()
    normalised: bool = True

    def __post_init__(self) -> None:
        """Refuse empty groups, repeated joints, inverted ranges and non-physical drives."""
        if not self.joints:
            raise DescriptorError("a joint group needs at least one joint")
        if len(set(self.joints)) != len(self.joints):
            raise DescriptorError(f"a joint group names a joint twice: {self.joints}")
        if self.unit not in ("rad", "m"):
            raise DescriptorError(f"unit is {self.unit!r}; it must be 'rad' or 'm'")
        for name in ("stiffness", "damping", "force_limit", "friction"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0):
                raise DescriptorError(f"{name} is {value}; it must be finite and not negative")
        for name, value in (("lower", self.lower), ("upper", self.upper)):
            if isinstance(value, tuple) and len(value) != self.size:
                raise DescriptorError(
                    f"{name} has {len(value)} numbers; the group {self.joints} takes {self.size}"
                )
        if self.limits and len(self.limits) != len(self.joints):
            raise DescriptorError(
                f"limits has {len(self.limits)} pairs; the group has joints {self.joints}"
            )
        for low, high in (*self.ranges, *self.limits):
            if not (math.isfinite(low) and math.isfinite(high) and low < high):
                raise DescriptorError(f"range [{low}, {high}] of {self.joints} is not increasing")

    @property
    def size(self) -> int:
        """How many action numbers the group takes: one if ``mimic``, else one per joint."""
        return 1 if self.mimic else len(self.joints)

    @property
    def ranges(self) -> tuple[tuple[float, float], ...]:
        """The (lower, upper) pair of each action number, in ``unit``."""
        lower = self.lower if isinstance(self.lower, tuple) else (self.lower,) * self.size
        upper = self.upper if isinstance(self.upper, tuple) else (self.upper,) * self.size
        return tuple(zip(lower, upper, strict=True))

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


class ActionSplit(Mapping[str, slice]):
    """The ordered joint groups of one robot, and the slice of its action that each one takes.

    Behaves as a read-only mapping from group name to slice: for a Panda,
    ``split["arm"] == slice(0, 7)`` and ``split["gripper"] == slice(7, 8)``.
    """

    __slots__ = ("_slices", "groups", "size")

    groups: Mapping[str, JointGroup]
    size: int

    def __init__(self, **groups: JointGroup) -> None:
        """Lay the groups' action numbers one after the other, in the order given.

        Args:
            groups: Joint groups by name, for example ``arm=JointGroup(...)``.

        Raises:
            DescriptorError: If there is no group, or a joint is in two groups.
        """
        if not groups:
            raise DescriptorError("an action split needs at least one joint group")
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
        """Pickle by the groups alone."""
        return (_split_from_groups, (dict(self.groups),))

    @property
    def joints(self) -> tuple[str, ...]:
        """Every driven joint, group after group."""
        return tuple(joint for group in self.groups.values() for joint in group.joints)

    def replace(self, **groups: JointGroup) -> ActionSplit:
        """Return a split with some groups exchanged (new names go to the end)."""
        return ActionSplit(**{**self.groups, **groups})


def _split_from_groups(groups: dict[str, JointGroup]) -> ActionSplit:
    return ActionSplit(**groups)


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


@dataclass(frozen=True)
class GripperMaterial:
    """Contact material of the links that touch what is grasped.

    Attributes:
        links: Link names.
        static_friction: Coefficient (dimensionless).
        dynamic_friction: Coefficient (dimensionless).
        restitution: Coefficient (dimensionless).
        patch_radius: PhysX torsional patch radius and its minimum (m).
    """

    links: tuple[str, ...]
    static_friction: float
    dynamic_friction: float
    restitution: float = 0.0
    patch_radius: float = 0.0


@dataclass(frozen=True)
class Fingers:
    """Two links that grasp, and how a grasp is told from their contact forces.

    An object is grasped while each finger feels at least ``min_force`` from it, at an angle of at
    most ``max_angle`` to the direction in which that finger opens.

    Attributes:
        links: The two finger links.
        opening_signs: For each finger, the sign of its own y axis that points to opening.
        min_force: Smallest contact force of each finger (N).
        max_angle: Largest angle between force and opening direction (degrees).
    """

    links: tuple[str, str]
    opening_signs: tuple[int, int] = (1, -1)
    min_force: float = 0.5
    max_angle: float = 85.0


@dataclass(frozen=True)
class CameraMount:
    """A camera that rides on a link.

    Attributes:
        name: Camera name.
        link: Link it is fixed to.
        position: In the link's frame (m).
        quaternion: wxyz, in the link's frame; the camera looks along its own +x, z up.
        width: Image width (pixels).
        height: Image height (pixels).
        fov: Vertical field of view (rad).
        near: Near plane (m).
        far: Far plane (m).
    """

    name: str
    link: str
    position: Vector3 = (0.0, 0.0, 0.0)
    quaternion: Quaternion = IDENTITY
    width: int = 128
    height: int = 128
    fov: float = math.pi / 2
    near: float = 0.01
    far: float = 100.0


@dataclass(frozen=True)
class Home:
    """Where a robot stands when a layout does not say otherwise.

    Attributes:
        position: Base position in the world (m).
        quaternion: Base orientation, wxyz.
        keyframe: Name of the keyframe it starts from.
    """

    position: Vector3 = (0.0, 0.0, 0.0)
    quaternion: Quaternion = IDENTITY
    keyframe: str = "rest"


@dataclass(frozen=True)
class RobotDescriptor:
    """Everything the library knows about one robot; frozen, and checked when made.

    Variants are made with `dataclasses.replace`.

    Attributes:
        name: Registry name, also the robot's key in ManiSkill's state dicts.
        urdf: Where its files come from.
        action_split: Its joint groups, in action order.
        tcp_link: Link whose frame orients the tool centre point.
        keyframes: Named joint positions, in the order of ``joints`` (rad, m).
        source: Where the numbers of this descriptor come from.
        reach: Largest distance of the TCP from the base axis (m).
        tcp_position_links: Links whose mean origin is the TCP position; ``tcp_link`` if empty.
        gripper_material: Contact material of the fingers, if it has any.
        fingers: The links that grasp, if it has any.
        cameras: Cameras on its links.
        home: Default standing place and keyframe.
    """

    name: str
    urdf: UrdfSource
    action_split: ActionSplit
    tcp_link: str
    keyframes: Mapping[str, Sequence[float]]
    source: str
    reach: float
    tcp_position_links: tuple[str, ...] = ()
    gripper_material: GripperMaterial | None = None
    fingers: Fingers | None = None
    cameras: tuple[CameraMount, ...] = ()
    home: Home = field(default_factory=Home)

    def __post_init__(self) -> None:
        """Freeze the keyframes and refuse contradictions."""
        if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", self.name):
            raise DescriptorError(
                f"robot name {self.name!r} must be a letter followed by letters, digits and _"
            )
        if not (math.isfinite(self.reach) and self.reach > 0):
            raise DescriptorError(f"{self.name}: reach is {self.reach} m; it must be positive")
        frozen = {key: tuple(float(x) for x in qpos) for key, qpos in self.keyframes.items()}
        for key, qpos in frozen.items():
            if len(qpos) != self.dof:
                raise DescriptorError(
                    f"{self.name}: keyframe {key!r} has {len(qpos)} numbers;"
                    f" the robot has {self.dof} joints ({', '.join(self.joints)})"
                )
            if not all(math.isfinite(x) for x in qpos):
                raise DescriptorError(f"{self.name}: keyframe {key!r} is not finite: {qpos}")
        object.__setattr__(self, "keyframes", _Frozen(frozen))
        self.keyframe(self.home.keyframe)

    @property
    def joints(self) -> tuple[str, ...]:
        """Driven joints, in the order of the action split."""
        return self.action_split.joints

    @property
    def arm_joints(self) -> tuple[str, ...]:
        """Joints of every group that is not called ``gripper``."""
        groups = self.action_split.groups.items()
        return tuple(j for name, group in groups if name != "gripper" for j in group.joints)

    @property
    def dof(self) -> int:
        """Number of driven joints; a Panda has 9, as both fingers count."""
        return len(self.joints)

    @property
    def action_dim(self) -> int:
        """Number of action numbers; a Panda has 8, as one number moves both fingers."""
        return self.action_split.size

    def keyframe(self, name: str) -> tuple[float, ...]:
        """Return the joint positions of a keyframe (rad, m), in the order of ``joints``.

        Raises:
            UnknownNameError: If there is no such keyframe.
        """
        if name not in self.keyframes:
            raise UnknownNameError(f"keyframe of {self.name}", name, self.keyframes)
        return tuple(self.keyframes[name])

    @property
    def action_bounds(self) -> tuple[tuple[float, float], ...]:
        """The least and the largest value of each action number."""
        groups = self.action_split.groups.values()
        return tuple(bounds for group in groups for bounds in group.bounds)

    def in_control_mode(self, mode: str) -> RobotDescriptor:
        """Return the robot with the actions of a control mode.

        ``pd_joint_delta_pos`` is the action split as declared. In ``pd_joint_pos`` the numbers of
        every group that was relative are joint positions, as in ManiSkill.

        Raises:
            UnknownNameError: If there is no such control mode.
            DescriptorError: If the mode needs joint limits and a group has none.
        """
        if mode not in CONTROL_MODES:
            raise UnknownNameError("control mode", mode, CONTROL_MODES)
        relative = {n: group for n, group in self.action_split.groups.items() if group.delta}
        if mode == CONTROL_MODES[0] or not relative:
            return self
        positions = {name: group.by_position() for name, group in relative.items()}
        return replace(self, action_split=self.action_split.replace(**positions))

    def describe_action(self) -> tuple[ActionNumber, ...]:
        """Return name, unit and range of every action number, in order."""
        numbers: list[ActionNumber] = []
        for group_name, group in self.action_split.groups.items():
            driven = [group.joints] if group.mimic else [(joint,) for joint in group.joints]
            for joints, (lower, upper) in zip(driven, group.ranges, strict=True):
                numbers.append(
                    ActionNumber(
                        index=len(numbers),
                        name=group_name if group.mimic else f"{group_name}.{joints[0]}",
                        group=group_name,
                        joints=joints,
                        unit=f"{group.unit} per step" if group.delta else group.unit,
                        lower=lower,
                        upper=upper,
                        relative=group.delta,
                        normalised=group.normalised,
                    )
                )
        return tuple(numbers)


class _Frozen(dict[str, tuple[float, ...]]):
    """A dict that hashes by its items and refuses to change (and still pickles)."""

    def __hash__(self) -> int:  # type: ignore[override]
        return hash(tuple(self.items()))

    def __reduce__(self) -> tuple[object, ...]:
        return (_Frozen, (dict(self),))

    def _refuse(self, *_: object, **__: object) -> NoReturn:
        raise TypeError("keyframes are frozen; use dataclasses.replace to change them")

    __setitem__ = __delitem__ = __ior__ = pop = clear = popitem = _refuse
    update = setdefault = _refuse  # pyright: ignore[reportAssignmentType]

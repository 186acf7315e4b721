"""What a robot is: files, joint groups, gripper, keyframes; data that checks itself, no more."""

from __future__ import annotations

import math
import os
import re
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NoReturn, Protocol, runtime_checkable

from robots.action_split import ActionNumber, ActionSplit, JointGroup, is_gripper, names
from robots.common.errors import DescriptorError, UnknownNameError
from robots.common.fields import expect_unit, settle_fields

__all__ = [
    "CONTROL_MODES",
    "IDENTITY",
    "ActionNumber",
    "ActionSplit",
    "CameraMount",
    "Fingers",
    "GripperMaterial",
    "Home",
    "JointGroup",
    "Quaternion",
    "RobotDescriptor",
    "UrdfSource",
    "Vector3",
    "names",
]

Vector3 = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]  # wxyz

IDENTITY: Quaternion = (1.0, 0.0, 0.0, 0.0)

LARGEST_IMAGE = 16384  # pixels; what graphics drivers allow

CONTROL_MODES = ("pd_joint_delta_pos", "pd_joint_pos")  # ManiSkill's names


@runtime_checkable
class UrdfSource(Protocol):
    """Where a URDF comes from; see `robots.assets.locator.UrdfLocator`."""

    def locate(self, *, pictures: bool = False) -> Path:
        """Return the path of a complete, checked URDF on this machine."""
        ...


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

    def __post_init__(self) -> None:
        """Refuse links that are none, and numbers that no contact has."""
        settle_fields(self, DescriptorError)
        _expect(bool(self.links), "GripperMaterial: links is empty; name the links that touch")
        _expect_different("GripperMaterial: links", self.links)
        for name in ("static_friction", "dynamic_friction", "patch_radius"):
            value = getattr(self, name)
            _expect(value >= 0, f"GripperMaterial: {name} is {value}; it must not be negative")
        _expect(
            0 <= self.restitution <= 1,
            f"GripperMaterial: restitution is {self.restitution}; it must be between 0 and 1",
        )


@dataclass(frozen=True)
class Fingers:
    """Two links that grasp, and how their contact forces show a grasp.

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

    def __post_init__(self) -> None:
        """Refuse links that are not two, and numbers that tell no grasp."""
        settle_fields(self, DescriptorError)
        _expect_different("Fingers: links", self.links)
        _expect(
            set(self.opening_signs) <= {1, -1},
            f"Fingers: opening_signs is {self.opening_signs}; each must be 1 or -1",
        )
        _expect(
            self.min_force >= 0,
            f"Fingers: min_force is {self.min_force} N; it must not be negative",
        )
        _expect(
            0 <= self.max_angle <= 180,
            f"Fingers: max_angle is {self.max_angle} degrees; it must be between 0 and 180",
        )


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

    def __post_init__(self) -> None:
        """Refuse what no camera can be."""
        settle_fields(self, DescriptorError)
        camera = f"camera {self.name!r}"
        expect_unit(camera, self.quaternion, DescriptorError)
        for name, pixels in (("width", self.width), ("height", self.height)):
            _expect(
                0 < pixels <= LARGEST_IMAGE,
                f"{camera}: {name} is {pixels} pixels; it must be between 1 and {LARGEST_IMAGE}",
            )
        _expect(
            0 < self.fov < math.pi, f"{camera}: fov is {self.fov} rad; it must be between 0 and pi"
        )
        _expect(
            0 < self.near < self.far,
            f"{camera}: near is {self.near} m and far {self.far} m; it must be 0 < near < far",
        )


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

    def __post_init__(self) -> None:
        """Refuse a pose that is none."""
        settle_fields(self, DescriptorError)
        expect_unit("Home", self.quaternion, DescriptorError)


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
        allowed_collisions: Pairs of links that may overlap, besides those that a joint joins and
            those that are rigid with each other; checks and physics let them. None takes what
            ManiSkill's loader takes: of the SRDF beside the URDF the pairs of reason ``Default``.
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
    allowed_collisions: tuple[tuple[str, str], ...] | None = None

    def __post_init__(self) -> None:
        """Freeze the keyframes and refuse contradictions."""
        named = isinstance(self.name, str) and self.name.isprintable()
        settle_fields(self, DescriptorError, owner=self.name if named else None)
        _expect(
            re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", self.name) is not None,
            f"robot name {self.name!r} must be a letter followed by letters, digits and _",
        )
        _expect(self.reach > 0, f"{self.name}: reach is {self.reach} m; it must be positive")
        _expect_different(f"{self.name}: tcp_position_links", self.tcp_position_links)
        _expect_different(f"{self.name}: cameras", [camera.name for camera in self.cameras])
        pairs = self.allowed_collisions or ()
        for i, pair in enumerate(pairs):
            _expect_different(f"{self.name}: allowed_collisions[{i}]", pair)
        written = [" and ".join(sorted(pair)) for pair in pairs]
        _expect_different(f"{self.name}: allowed_collisions", written)
        frozen = {key: tuple(float(x) for x in qpos) for key, qpos in self.keyframes.items()}
        for key, qpos in frozen.items():
            _expect(
                len(qpos) == self.dof,
                f"{self.name}: keyframe {key!r} has {len(qpos)} numbers;"
                f" the robot has {self.dof} joints ({', '.join(self.joints)})",
            )
        object.__setattr__(self, "keyframes", _Frozen(frozen))
        self.keyframe(self.home.keyframe)

    @classmethod
    def from_urdf(
        cls,
        path_or_name: str | os.PathLike[str],
        name: str | None = None,
        *,
        quiet: bool = False,
        xacro: Mapping[str, object] | None = None,
        **overrides: Any,
    ) -> RobotDescriptor:
        """Guess a robot from its URDF, and say on stderr what was guessed and why.

        See `robots.from_urdf.guess_descriptor` for the arguments, the errors, and the guess with
        its reasons and the data module to paste.

        Args:
            path_or_name: A URDF on this machine, or a name of the package robot_descriptions.
            name: Registry name; None takes that of the URDF.
            quiet: Whether to say nothing.
            xacro: Arguments of a xacro template, as in ``{"prefix": "left_"}``.
            **overrides: Fields that are known better than guessed.
        """
        from robots.from_urdf import guess_descriptor

        found = guess_descriptor(path_or_name, name, xacro=xacro, **overrides)
        if not quiet:
            print(found, file=sys.stderr)
        return found.descriptor

    def with_gripper(
        self, gripper: RobotDescriptor | str | os.PathLike[str], **details: Any
    ) -> RobotDescriptor:
        """Return the robot with another gripper in the place of its own, if it has one.

        Args:
            gripper: A descriptor, a registered name or a URDF: a gripper, or an arm whose gripper
                is taken.
            **details: ``link``, ``position``, ``quaternion`` and ``name``; see
                `robots.grafting.with_gripper`, also for the errors.
        """
        from robots.grafting import with_gripper

        return with_gripper(self, gripper, **details)

    @property
    def joints(self) -> tuple[str, ...]:
        """Driven joints, in the order of the action split."""
        return self.action_split.joints

    @property
    def arm_joints(self) -> tuple[str, ...]:
        """Joints of every group that is neither a gripper, by its name, nor held."""
        driven = [
            group
            for name, group in self.action_split.groups.items()
            if not is_gripper(name) and not group.held
        ]
        return tuple(joint for group in driven for joint in group.joints)

    @property
    def dof(self) -> int:
        """Number of driven joints; a Panda has 9, as both fingers count."""
        return len(self.joints)

    @property
    def action_dim(self) -> int:
        """Number of action numbers; a Panda has 8, as one number moves both fingers."""
        return self.action_split.size

    @property
    def summary(self) -> str:
        """Both numbers in words: ``9 joints, 8 action numbers``."""
        counts = {"joint": self.dof, "action number": self.action_dim}
        return ", ".join(f"{count} {what}{'s' * (count != 1)}" for what, count in counts.items())

    def __repr__(self) -> str:
        """Show name, sizes and reach; the fields are many."""
        return f"RobotDescriptor({self.name!r}: {self.summary}, reach {self.reach:g} m)"

    def _repr_html_(self) -> str:
        """Show a notebook the table of action numbers."""
        from robots.display import robot_html

        text = f"{self.summary}, reach {self.reach:g} m"
        return robot_html(self.name, text, self.describe_action())

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
            if group.held:
                continue
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


def _expect(right: bool, otherwise: str) -> None:
    if not right:
        raise DescriptorError(otherwise)


def _expect_different(what: str, names: Sequence[str]) -> None:
    twice = sorted({name for name in names if names.count(name) > 1})
    _expect(not twice, f"{what} has {', '.join(twice)} more than once")


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

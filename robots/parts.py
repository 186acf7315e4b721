"""What a descriptor holds besides joint groups: fingers, cameras, limbs, where a robot stands."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from itertools import combinations, groupby
from typing import Any, NoReturn

from robot_layouts.core.bounds import expect_unit
from robot_layouts.core.errors import DescriptorError, refuse
from robot_layouts.core.schema import check_fields
from robots.action_split import ActionSplit

Vector3 = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]  # wxyz

IDENTITY: Quaternion = (1.0, 0.0, 0.0, 0.0)
PINCH = "pinch"  # keyframe in which a thumb and a finger meet, of hands of many joints
OWN_Y: Vector3 = (0.0, 1.0, 0.0)

_Owners = dict[str, str | None]

BODY = "body"  # what takes action numbers and is no limb: a torso that turns, a base that drives
_OTHER_SIDE = {"left": "right", "right": "left", "l": "r", "r": "l"}
LARGEST_IMAGE = 16384  # pixels; what graphics drivers allow


class Frozen(dict[str, Any]):
    """A dict that hashes by its items and refuses to change (and still pickles)."""

    def __hash__(self) -> int:  # type: ignore[override]
        """Hash the items in their order."""
        return hash(tuple(self.items()))

    def __reduce__(self) -> tuple[object, ...]:
        """Pickle by the items."""
        return (Frozen, (dict(self),))

    def _refuse(self, *_: object, **__: object) -> NoReturn:
        raise TypeError("a descriptor is frozen; use dataclasses.replace to change it")

    __setitem__ = __delitem__ = __ior__ = pop = clear = popitem = _refuse
    update = setdefault = _refuse  # pyright: ignore[reportAssignmentType]


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
        """Refuse invalid links, and numbers that no contact has."""
        check_fields(self, DescriptorError)
        refuse(self._problems(), DescriptorError)

    def _problems(self) -> Iterator[str]:
        if not self.links:
            yield "GripperMaterial: links is empty; name the links that touch"
        yield from repeated("GripperMaterial: links", self.links)
        for name in ("static_friction", "dynamic_friction", "patch_radius"):
            if (value := getattr(self, name)) < 0:
                yield f"GripperMaterial: {name} is {value}; it must not be negative"
        if not 0 <= self.restitution <= 1:
            yield f"GripperMaterial: restitution is {self.restitution}; it must be between 0 and 1"


@dataclass(frozen=True)
class Fingers:
    """Two links that grasp, and how their contact forces show a grasp.

    An object is grasped while each finger feels at least ``min_force`` from it, at an angle of at
    most ``max_angle`` to the direction in which that finger opens.

    Attributes:
        links: The two finger links.
        opening_signs: For each finger, the sign of its opening axis that points to opening.
        min_force: Smallest contact force of each finger (N).
        max_angle: Largest angle between force and opening direction (degrees).
        opening_axes: For each finger, the axis along which it opens, of any length, in the frame of
            its link; its own y axis unless it is given.
    """

    links: tuple[str, str]
    opening_signs: tuple[int, int] = (1, -1)
    min_force: float = 0.5
    max_angle: float = 85.0
    opening_axes: tuple[Vector3, Vector3] = (OWN_Y, OWN_Y)

    def __post_init__(self) -> None:
        """Refuse links that are not two, and numbers that tell no grasp."""
        check_fields(self, DescriptorError)
        refuse(self._problems(), DescriptorError)

    def _problems(self) -> Iterator[str]:
        yield from repeated("Fingers: links", self.links)
        if not set(self.opening_signs) <= {1, -1}:
            yield f"Fingers: opening_signs is {self.opening_signs}; each must be 1 or -1"
        if self.min_force < 0:
            yield f"Fingers: min_force is {self.min_force} N; it must not be negative"
        if not 0 <= self.max_angle <= 180:
            yield f"Fingers: max_angle is {self.max_angle} degrees; it must be between 0 and 180"
        if not all(map(any, self.opening_axes)):
            axes = f"{self.opening_axes}; each must have a length, such as {OWN_Y}"
            yield f"Fingers: opening_axes is {axes}"

    def __repr__(self) -> str:
        """Show the fields, but not axes that are both y: digests of older descriptors stay."""
        shown = [f"{field.name}={getattr(self, field.name)!r}" for field in fields(self)]
        along_y = self.opening_axes == (OWN_Y, OWN_Y)
        return f"Fingers({', '.join(shown[:-1] if along_y else shown)})"


@dataclass(frozen=True)
class NativeAgent:
    """What ManiSkill's agent of a robot reads otherwise than its other agents; clones do likewise.

    Attributes:
        tcp_links: Links whose mean pose is its ``tcp_pose``; that of the robot's TCP if empty.
        base_joints: Joints of its base, static up to ``base_speed`` whatever a task's threshold.
            Where it has some, joints that move backwards are static however fast they are.
        base_speed: That speed (m/s, rad/s).
        tip_links: Links whose poses it observes of itself, as ``tip_poses``; in every task here.
    """

    tcp_links: tuple[str, ...] = ()
    base_joints: tuple[str, ...] = ()
    base_speed: float = 0.0
    tip_links: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Refuse repeated names and a negative speed."""
        check_fields(self, DescriptorError)
        refuse(self._problems(), DescriptorError)

    def _problems(self) -> Iterator[str]:
        yield from repeated("NativeAgent: tcp_links", self.tcp_links)
        yield from repeated("NativeAgent: base_joints", self.base_joints)
        yield from repeated("NativeAgent: tip_links", self.tip_links)
        if self.base_speed < 0:
            yield f"NativeAgent: base_speed is {self.base_speed}; it must not be negative"


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
        check_fields(self, DescriptorError)
        expect_unit(f"camera {self.name!r}: quaternion", self.quaternion, DescriptorError)
        refuse(self._problems(), DescriptorError)

    def _problems(self) -> Iterator[str]:
        camera = f"camera {self.name!r}"
        for name, pixels in (("width", self.width), ("height", self.height)):
            if not 0 < pixels <= LARGEST_IMAGE:
                most = f"it must be between 1 and {LARGEST_IMAGE}"
                yield f"{camera}: {name} is {pixels} pixels; {most}"
        if not 0 < self.fov < math.pi:
            yield f"{camera}: fov is {self.fov} rad; it must be between 0 and pi"
        if not 0 < self.near < self.far:
            yield f"{camera}: near is {self.near} m and far {self.far} m; it must be 0 < near < far"


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
        """Refuse an invalid pose."""
        check_fields(self, DescriptorError)
        expect_unit("Home: quaternion", self.quaternion, DescriptorError)


@dataclass(frozen=True)
class Limb:
    """An arm of a robot that has several, with its gripper.

    Attributes:
        tcp_link: Link whose frame orients its tool centre point.
        reach: Largest distance of the TCP from the vertical through ``base`` (m).
        base: Where its first joint is at home, in the robot's frame (m).
        fingers: The links that grasp, if it has any.
        tcp_position_links: Links whose mean origin is the TCP position; ``tcp_link`` if empty.
        tcp_offset: From there to the TCP, in ``tcp_link``'s frame (m).
        groups: Its joint groups, which follow one another in the action. Empty takes those that
            have the limb's name among their words: of ``left``, ``left_arm`` and ``left_gripper``.
    """

    tcp_link: str
    reach: float
    base: Vector3 = (0.0, 0.0, 0.0)
    fingers: Fingers | None = None
    tcp_position_links: tuple[str, ...] = ()
    tcp_offset: Vector3 = (0.0, 0.0, 0.0)
    groups: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Refuse an invalid reach, and links that are named twice."""
        check_fields(self, DescriptorError)
        refuse(self._problems(), DescriptorError)

    def _problems(self) -> Iterator[str]:
        if not self.reach > 0:
            yield f"Limb: reach is {self.reach} m; it must be positive"
        yield from repeated("Limb: tcp_position_links", self.tcp_position_links)


def mirrored(names: Any) -> Any:
    """Return the same names on the other side: of what is left on the right, and the other way.

    The first part of a name that says a side counts, ``left``, ``right``, ``l`` or ``r`` between
    underscores; a name without one stays as it is.

    Args:
        names: A name, or a tuple of names or of tuples of them.
    """
    if not isinstance(names, str):
        return tuple(map(mirrored, names))
    words = names.split("_")
    side = next((word for word in words if word in _OTHER_SIDE), None)
    if side is not None:
        words[words.index(side)] = _OTHER_SIDE[side]
    return "_".join(words)


def both_sides(left: Limb) -> dict[str, Limb]:
    """Return the limbs ``left`` and ``right`` of a robot whose sides mirror each other.

    Args:
        left: The left one.
    """
    x, y, z = left.base
    right = replace(
        left,
        tcp_link=mirrored(left.tcp_link),
        base=(x, -y, z),
        fingers=left.fingers and replace(left.fingers, links=mirrored(left.fingers.links)),
        tcp_position_links=mirrored(left.tcp_position_links),
    )
    return {"left": left, "right": right}


def among(*groups: tuple[str, ...]) -> tuple[tuple[str, str], ...]:
    """Return every pair of two links of the same group, each once.

    Args:
        groups: Link names; a link may be in several groups.
    """
    pairs = (pair for group in groups for pair in combinations(group, 2))
    return tuple({frozenset(pair): pair for pair in pairs}.values())


def share_out(limbs: Mapping[str, Limb], split: ActionSplit) -> dict[str, str | None]:
    """Return the owner of each joint group: a limb, `BODY`, or None if the group is held.

    Args:
        limbs: The limbs by name.
        split: The joint groups.

    Raises:
        DescriptorError: If a limb has no name of its own, no action number, a group that there is
            not, one of another limb, or groups that do not follow one another.
    """
    owners: _Owners = {name: BODY if group.size else None for name, group in split.groups.items()}
    for name, limb in limbs.items():
        if re.fullmatch(r"\w+", name) is None or name == BODY:
            raise DescriptorError(
                f"{name!r} names no limb; letters, digits and _ are needed, and {BODY!r} is taken"
                " by what is no limb"
            )
        for group in limb.groups or [group for group in owners if name in group.split("_")]:
            _give(owners, group, name, limbs)
    _refuse_gaps(limbs, owners, split)
    return owners


def _give(owners: _Owners, group: str, limb: str, limbs: Mapping[str, Limb]) -> None:
    if group not in owners:
        raise DescriptorError(
            f"limb {limb!r} has a joint group {group!r}, which does not exist; the groups are"
            f" {', '.join(owners)}"
        )
    if owners[group] in limbs:
        raise DescriptorError(
            f"the joint group {group!r} belongs to two limbs, {owners[group]!r} and {limb!r}"
        )
    owners[group] = limb


def _refuse_gaps(limbs: Mapping[str, Limb], owners: _Owners, split: ActionSplit) -> None:
    """Refuse limbs without an action number, and what is not in one piece."""
    for name in limbs:
        if not any(split.groups[group].size for group, owner in owners.items() if owner == name):
            raise DescriptorError(
                f"limb {name!r} takes no action number; the joint groups are {', '.join(owners)}."
                " Name its own in groups=(…)"
            )
    pieces = [owner for owner, _ in groupby(owners.values())]
    numbered = [owner for owner, _ in groupby(filter(None, owners.values()))]
    for name, found in (*((limb, pieces) for limb in limbs), (BODY, numbered)):
        if found.count(name) > 1:
            raise DescriptorError(
                f"the joint groups of {name!r} do not follow one another: {', '.join(owners)}"
            )


def repeated(what: str, names: Sequence[str]) -> Iterator[str]:
    """Yield that names are given twice, if some are."""
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        yield f"{what} has {', '.join(twice)} more than once"

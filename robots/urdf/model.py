"""The links and joints of a URDF as a tree, refused in clear words if they are none."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from xml.etree import ElementTree

from robots.common.errors import AssetError, closest_match
from robots.urdf.inertia import expect_inertia
from robots.urdf.numbers import Vector3, numbers_of, shown
from robots.urdf.shapes import UrdfShape, read_shape
from robots.urdf.summary import parse_urdf, read_joint

MAX_LINKS = 255  # of an articulation in PhysX 5, tried: with one more it has no joints, or crashes
LONGEST_NAME = 200  # characters
JOINT_TYPES = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
DRIVEN_TYPES = ("revolute", "continuous", "prismatic")


@dataclass(frozen=True)
class ModelJoint:
    """A joint of any type.

    Attributes:
        name: Joint name.
        type: ``revolute``, ``continuous``, ``prismatic``, ``fixed``, …
        parent: Link that carries it.
        child: Link that it carries.
        xyz: Place of the joint in the parent link's frame (m).
        rpy: Its orientation there, fixed-axis roll, pitch, yaw (rad).
        axis: Axis of motion in the joint's frame, of length 1.
        lower: Lower limit (rad or m), or None if it has none.
        upper: Upper limit (rad or m), or None if it has none.
        effort: Largest effort (N·m or N), or None.
        mimics: Joint that it follows, or None.
        multiplier: Factor from that joint's position to this one's.
        offset: Added to it (rad or m).
    """

    name: str
    type: str
    parent: str
    child: str
    xyz: Vector3 = (0.0, 0.0, 0.0)
    rpy: Vector3 = (0.0, 0.0, 0.0)
    axis: Vector3 = (1.0, 0.0, 0.0)
    lower: float | None = None
    upper: float | None = None
    effort: float | None = None
    mimics: str | None = None
    multiplier: float = 1.0
    offset: float = 0.0

    @property
    def moves(self) -> bool:
        """Whether it is not fixed."""
        return self.type != "fixed"

    @property
    def unit(self) -> str:
        """``m`` for a prismatic joint, else ``rad``."""
        return "m" if self.type == "prismatic" else "rad"

    @property
    def span(self) -> tuple[float, float]:
        """Its limits, or one turn each way if it has none (rad or m)."""
        if self.lower is None or self.upper is None:
            return (-2 * math.pi, 2 * math.pi)
        return (self.lower, self.upper)


@dataclass(frozen=True)
class UrdfModel:
    """The tree of links and joints.

    Attributes:
        name: The robot's name in the URDF.
        links: Link names, in the URDF's order.
        joints: Joints, in the URDF's order.
        collisions: What each link collides with; links that collide with nothing are left out.
        visuals: What each link looks like; links that are not drawn are left out.
    """

    name: str
    links: tuple[str, ...]
    joints: tuple[ModelJoint, ...]
    collisions: Mapping[str, tuple[UrdfShape, ...]] = field(default_factory=dict)
    visuals: Mapping[str, tuple[UrdfShape, ...]] = field(default_factory=dict)

    @cached_property
    def parent_joint(self) -> dict[str, ModelJoint]:
        """The joint that carries each link but the root."""
        return {joint.child: joint for joint in self.joints}

    @cached_property
    def root(self) -> str:
        """The link that no joint carries."""
        return next(link for link in self.links if link not in self.parent_joint)

    @cached_property
    def moving(self) -> tuple[ModelJoint, ...]:
        """Joints that are not fixed."""
        return tuple(joint for joint in self.joints if joint.moves)

    @cached_property
    def _carried(self) -> dict[str, list[ModelJoint]]:
        carried: dict[str, list[ModelJoint]] = {link: [] for link in self.links}
        for joint in self.joints:
            carried[joint.parent].append(joint)
        return carried

    @cached_property
    def ordered(self) -> tuple[ModelJoint, ...]:
        """All joints, depth first from the root: each after the one that carries its parent."""
        found: list[ModelJoint] = []
        waiting = list(reversed(self.joints_on(self.root)))
        while waiting:
            found.append(waiting.pop())
            waiting += reversed(self.joints_on(found[-1].child))
        return tuple(found)

    @cached_property
    def depths(self) -> dict[str, int]:
        """For each joint that moves, how many moving joints the longest chain from it on has."""
        behind = dict.fromkeys(self.links, 0)  # of what hangs on each link
        depths: dict[str, int] = {}
        for joint in reversed(self.ordered):
            depth = behind[joint.child] + joint.moves
            behind[joint.parent] = max(behind[joint.parent], depth)
            if joint.moves:
                depths[joint.name] = depth
        return depths

    def joints_on(self, link: str) -> tuple[ModelJoint, ...]:
        """Return the joints that a link carries, in the URDF's order."""
        return tuple(self._carried[link])

    def rigid_with(self, link: str) -> tuple[str, ...]:
        """Return a link and all that hangs on it by fixed joints, nearest first."""
        found = [link]
        for near in found:
            found += [joint.child for joint in self.joints_on(near) if not joint.moves]
        return tuple(found)

    def moving_on(self, link: str) -> tuple[ModelJoint, ...]:
        """Return the moving joints that are carried by a link or what is rigid with it."""
        rigid = set(self.rigid_with(link))
        return tuple(joint for joint in self.moving if joint.parent in rigid)

    def path_to(self, link: str) -> tuple[ModelJoint, ...]:
        """Return the joints from the root to a link."""
        path: list[ModelJoint] = []
        while link in self.parent_joint:
            path.append(self.parent_joint[link])
            link = path[-1].parent
        return tuple(reversed(path))

    def below(self, joint: ModelJoint) -> tuple[ModelJoint, ...]:
        """Return a moving joint and all moving joints behind it."""
        found = [joint]
        for near in found:
            found += self.moving_on(near.child)
        return tuple(found)


def read_model(xml: bytes, urdf: str) -> UrdfModel:
    """Return the tree that a URDF describes.

    Args:
        xml: The URDF's contents.
        urdf: Its path, for messages.

    Raises:
        AssetError: If it is no URDF, it has more links than PhysX can join, names are missing,
            repeated or unknown, its joints make no tree or have impossible limits, a link that
            moves has no mass or inertia, or a shape has no size or is of no known kind.
    """
    root = parse_urdf(xml, urdf)
    elements = root.findall("link")
    links = tuple(link.get("name", "") for link in elements)
    _expect_few(urdf, len(links))
    _expect_names(urdf, "link", links)
    _expect_names(urdf, "joint", [joint.get("name", "") for joint in root.iterfind("joint")])
    joints = tuple(_read(joint, urdf) for joint in root.iterfind("joint"))
    shapes = [dict(_shapes(elements, kind, urdf)) for kind in ("collision", "visual")]
    model = UrdfModel(root.get("name", ""), links, joints, *shapes)
    _expect_tree(model, urdf)
    leaders = {joint.name: joint for joint in model.moving}
    for joint in model.moving:
        _expect_possible(joint, leaders, urdf)
    moved = {joint.child for joint in model.moving}
    for link in elements:
        where = f"{urdf}: link {link.get('name')!r}"
        expect_inertia(link, where, moves=link.get("name") in moved)
    return model


def _expect_few(urdf: str, links: int) -> None:
    if links > MAX_LINKS:
        raise AssetError(
            f"{urdf} has {links} links; PhysX joins {MAX_LINKS} at most. Links that are fixed to"
            " each other can be made one"
        )


def _shapes(
    links: Iterable[ElementTree.Element], kind: str, urdf: str
) -> Iterable[tuple[str, tuple[UrdfShape, ...]]]:
    for link in links:
        where = f"{urdf}, link {link.get('name')!r}"
        if shapes := tuple(read_shape(element, where) for element in link.iterfind(kind)):
            yield link.get("name", ""), shapes


def _read(element: ElementTree.Element, urdf: str) -> ModelJoint:
    about = read_joint(element, urdf)
    origin, axis, mimic = (element.find(part) for part in ("origin", "axis", "mimic"))
    where = f"{urdf}: joint {about.name!r}"
    dynamics = element.find("dynamics")
    for key in ("damping", "friction"):
        numbers_of(dynamics, key, (0.0,), where)
    return ModelJoint(
        name=about.name,
        type=about.type,
        parent=_link_of(element, "parent"),
        child=_link_of(element, "child"),
        xyz=numbers_of(origin, "xyz", (0.0, 0.0, 0.0), where),
        rpy=numbers_of(origin, "rpy", (0.0, 0.0, 0.0), where),
        axis=_unit_axis(numbers_of(axis, "xyz", (1.0, 0.0, 0.0), where), about.type, where),
        lower=about.lower,
        upper=about.upper,
        effort=about.effort,
        mimics=about.mimics,
        multiplier=numbers_of(mimic, "multiplier", (1.0,), where)[0],
        offset=numbers_of(mimic, "offset", (0.0,), where)[0],
    )


def _link_of(joint: ElementTree.Element, part: str) -> str:
    element = joint.find(part)
    return "" if element is None else element.get("link", "")


def _unit_axis(axis: Vector3, kind: str, where: str) -> Vector3:
    length = math.hypot(*axis)
    if length == 0 and kind != "fixed":
        raise AssetError(f"{where} has the axis 0 0 0; an axis needs a direction")
    x, y, z = (number / (length or 1.0) for number in axis)
    return (x, y, z)


def _expect_names(urdf: str, kind: str, found: Iterable[str]) -> None:
    counts = Counter(found)
    if "" in counts:
        raise AssetError(f"{urdf} has a {kind} without a name")
    for name in counts:
        if not name.isprintable() or len(name) > LONGEST_NAME:
            raise AssetError(
                f"{urdf} has a {kind} called {shown(name)}; names have at most {LONGEST_NAME}"
                " characters, all of them printable"
            )
    twice = sorted(name for name, count in counts.items() if count > 1)
    if twice:
        raise AssetError(
            f"{urdf} has more than one {kind} called {', '.join(map(repr, twice))};"
            f" every {kind} needs a name of its own"
        )


def _expect_tree(model: UrdfModel, urdf: str) -> None:
    if not model.links:
        raise AssetError(f"{urdf} has no link")
    known = set(model.links)
    for joint in model.joints:
        for part in (joint.parent, joint.child):
            if part not in known:
                raise AssetError(f"{urdf}: joint {joint.name!r} names {_unknown_link(part, model)}")
    carried = Counter(joint.child for joint in model.joints)
    twice = sorted(link for link, count in carried.items() if count > 1)
    if twice:
        raise AssetError(
            f"{urdf}: more than one joint carries the link {twice[0]!r}; a URDF is a tree"
        )
    roots = [link for link in model.links if link not in carried]
    if len(roots) != 1:
        what = f"links {roots} are" if roots else "no link is"
        raise AssetError(f"{urdf}: {what} without a joint that carries it; a tree has one root")
    reached = {model.root}
    for _ in model.joints:
        reached |= {joint.child for joint in model.joints if joint.parent in reached}
    lost = [link for link in model.links if link not in reached]
    if lost:
        raise AssetError(f"{urdf}: the joints of links {lost} go in a circle")


def _unknown_link(name: str, model: UrdfModel) -> str:
    match = closest_match(name, model.links)
    return f"the link {shown(name)}, which does not exist" + (
        f"; did you mean {match!r}?" if match else ""
    )


def _expect_possible(joint: ModelJoint, leaders: dict[str, ModelJoint], urdf: str) -> None:
    where = f"{urdf}: joint {joint.name!r}"
    if joint.type not in DRIVEN_TYPES:
        known = ", ".join(JOINT_TYPES)
        more = "" if joint.type in JOINT_TYPES else f" (the types are {known})"
        raise AssetError(
            f"{where} is {shown(joint.type)}{more}; only revolute, continuous, prismatic and fixed"
            " joints can be driven or left alone"
        )
    if joint.lower is not None and joint.upper is not None and not joint.lower < joint.upper:
        raise AssetError(
            f"{where} has the limits {joint.lower:g} … {joint.upper:g} {joint.unit}, which leave"
            " no way to go; give it <limit lower= upper=>, or make it continuous or fixed"
        )
    if joint.mimics is not None:
        if joint.mimics not in leaders:
            raise AssetError(f"{where} mimics {shown(joint.mimics)}, which is no joint that moves")
        if joint.multiplier == 0:
            raise AssetError(f"{where} mimics with multiplier 0, so it never moves; make it fixed")
        _leader(joint, leaders, where)


def _leader(joint: ModelJoint, leaders: dict[str, ModelJoint], where: str) -> None:
    seen = [joint.name]
    leader = leaders.get(joint.mimics or "")
    while leader is not None:
        if leader.name in seen:
            raise AssetError(f"{where} mimics itself, by way of {' and '.join(seen)}")
        seen.append(leader.name)
        leader = leaders.get(leader.mimics or "")

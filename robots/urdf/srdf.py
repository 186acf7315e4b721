"""SRDFs: which pairs of links are left out of collision checks, and which joints make an arm."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element

from robot_layouts.core.errors import AssetError, UnknownNameError
from robots.urdf.model import UrdfModel
from robots.urdf.summary import root_of, srdf_beside
from robots.urdf.text import numbers_of


@dataclass(frozen=True)
class ExcludedPair:
    """A pair of links that an SRDF leaves out of collision checks.

    Attributes:
        links: Their names.
        reason: Why, such as ``"Adjacent"``; empty if it does not say.
    """

    links: tuple[str, str]
    reason: str


@dataclass(frozen=True)
class SrdfGroup:
    """A group of an SRDF, such as an arm or a hand.

    Attributes:
        name: What it is called.
        joints: Names of its joints that move, in the order of the URDF's tree.
        tip: Link at the end of its chain; empty if it is given otherwise.
        parts: Groups that it is made of.
    """

    name: str
    joints: tuple[str, ...]
    tip: str = ""
    parts: tuple[str, ...] = ()


@dataclass(frozen=True)
class EndEffector:
    """An end effector of an SRDF.

    Attributes:
        group: Group that moves it.
        parent_link: Link that carries it.
        parent_group: Group of the arm that carries it; empty if it does not say.
    """

    group: str
    parent_link: str
    parent_group: str


@dataclass(frozen=True)
class Semantics:
    """What an SRDF says of a robot.

    Attributes:
        groups: Its groups by name.
        end_effectors: What is at the ends of arms.
        states: Positions of joints by the name of the state (rad, m), of all groups together.
        excluded: Pairs of links that are left out of collision checks.
    """

    groups: Mapping[str, SrdfGroup]
    end_effectors: tuple[EndEffector, ...]
    states: Mapping[str, Mapping[str, float]]
    excluded: tuple[ExcludedPair, ...]


def read_semantics(srdf: Path, model: UrdfModel) -> Semantics:
    """Return what an SRDF says of a robot.

    Args:
        srdf: The SRDF.
        model: What the robot's URDF describes.

    Raises:
        AssetError: If it cannot be read, is no SRDF, has a word where a number is needed, or groups
            that contain themselves.
        UnknownNameError: If a group, a chain or a state names what does not exist.
    """
    root = root_of(srdf)
    reading = _SrdfReading(root, model, srdf)
    return Semantics(
        groups={name: reading.group(name) for name in reading.elements},
        end_effectors=tuple(map(reading.end_effector, root.iterfind("end_effector"))),
        states=reading.states(),
        excluded=_excluded(root, srdf),
    )


class _SrdfReading:
    """One SRDF that is being read."""

    def __init__(self, root: Element, model: UrdfModel, srdf: Path) -> None:
        self._root, self._model, self._srdf = root, model, srdf
        self.elements = {group.get("name", ""): group for group in root.iterfind("group")}
        self._joints = {joint.name for joint in model.joints}
        self._joints |= {joint.get("name", "") for joint in root.iterfind("virtual_joint")}

    def group(self, name: str, inside: tuple[str, ...] = ()) -> SrdfGroup:
        if name in inside:
            raise AssetError(f"{self._srdf}: the group {name!r} is made of itself")
        element = self.elements[self._known(name, "group", self.elements)]
        parts = tuple(part.get("name", "") for part in element.iterfind("group"))
        joints = {joint for part in parts for joint in self.group(part, (*inside, name)).joints}
        tips: list[str] = []
        for chain in element.iterfind("chain"):
            base, tip = (self._link(chain.get(end, "")) for end in ("base_link", "tip_link"))
            ways = [{joint.name for joint in self._model.path_to(link)} for link in (base, tip)]
            joints |= ways[0] ^ ways[1]
            tips.append(tip)
        for joint in element.iterfind("joint"):
            joints.add(self._known(joint.get("name", ""), "joint", self._joints))
        for link in element.iterfind("link"):
            carrier = self._model.parent_joint.get(self._link(link.get("name", "")))
            joints |= {carrier.name} if carrier else set()
        moving = tuple(j.name for j in self._model.ordered if j.moves and j.name in joints)
        return SrdfGroup(name, moving, tips[0] if len(tips) == 1 else "", parts)

    def end_effector(self, element: Element) -> EndEffector:
        group = self._known(element.get("group", ""), "group", self.elements)
        parent = element.get("parent_group", "")
        if parent:
            self._known(parent, "group", self.elements)
        return EndEffector(group, self._link(element.get("parent_link", "")), parent)

    def states(self) -> dict[str, dict[str, float]]:
        """Return the states; what two groups call alike is one state of the robot."""
        states: dict[str, dict[str, float]] = {}
        for state in self._root.iterfind("group_state"):
            self._known(state.get("group", ""), "group", self.elements)
            name = state.get("name", "")
            for joint in state.iterfind("joint"):
                known = self._known(joint.get("name", ""), "joint", self._joints)
                where = f"{self._srdf}: joint {known!r} of the state {name!r}"
                if len(joint.get("value", "").split()) == 1:  # a joint that flies has seven
                    (value,) = numbers_of(joint, "value", (0.0,), where)
                    states.setdefault(name, {})[known] = value
        moving = {joint.name for joint in self._model.moving}
        return {n: {j: x for j, x in at.items() if j in moving} for n, at in states.items() if n}

    def _link(self, name: str) -> str:
        return self._known(name, "link", self._model.links)

    def _known(self, name: str, kind: str, names: Iterable[str]) -> str:
        if name not in names:
            raise UnknownNameError(f"{kind} that {self._srdf.name} names", name, sorted(names))
        return name


def read_excluded_pairs(urdf: Path) -> tuple[ExcludedPair, ...]:
    """Return the pairs that the SRDF beside a URDF excludes, in its order; none without an SRDF.

    Raises:
        AssetError: If the file cannot be read or is no SRDF, or a pair lacks a link.
    """
    srdf = srdf_beside(urdf)
    return () if srdf is None else _excluded(root_of(srdf), srdf)


def _excluded(root: Element, srdf: Path) -> tuple[ExcludedPair, ...]:
    pairs: list[ExcludedPair] = []
    for pair in root.iterfind("disable_collisions"):
        links = (pair.get("link1", ""), pair.get("link2", ""))
        if not all(links):
            raise AssetError(
                f"{srdf}: a <disable_collisions> needs link1 and link2; it has {links}"
            )
        pairs.append(ExcludedPair(links, pair.get("reason", "")))
    return tuple(pairs)

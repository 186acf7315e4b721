"""The parts of a robot: its limbs with their grippers, and what moves besides, from its URDF.

Structure comes first: where the tree of joints branches, how many joints follow, how long they are,
what mimics what. Names help where several answers fit, by the generic words of
`robots.guessing.words`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from robot_layouts.core.errors import DescriptorError
from robots.guessing import words
from robots.guessing.doubt import Doubt
from robots.urdf.model import ModelJoint, UrdfModel
from robots.urdf.tree import rest_poses

if TYPE_CHECKING:
    from collections.abc import Sequence

    from robot_layouts.kinematics.rotations import Floats


FARTHEST_SLIDE = 4.0  # m; a slide that goes farther is a way for a whole robot
IN_PLACE = 1e-3  # m; a joint that is so near to where its parent link is turns there
LONGEST_HAND = 0.4  # of the length of the arm that carries it
LARGEST_HAND = 0.35  # m, of a hand without arm whose names do not say so
FEWEST_ARM_JOINTS = 4  # of an arm whose names do not say so, beside other limbs
WIDEST_FINGER = 12.6  # rad; what turns farther is no finger whose name does not say so
WIDEST_JAW = 3.3  # rad; a joint that goes farther turns a wrist
PARTS = ("torso", "head", "legs", "wheels", "body")  # what is no limb, in this order

Joints = tuple[ModelJoint, ...]


@dataclass(frozen=True)
class LimbJoints:
    """An arm, or a hand without one, each part in the order base to tip.

    Attributes:
        name: ``left``, ``right``, a number, or empty if it is the only one.
        arm: Joints from where it leaves the body to the palm.
        fingers: Joints behind the palm; or the one joint of a jaw.
        palm: Link that carries the fingers, or the last link of the arm.
    """

    name: str
    arm: Joints
    fingers: Joints
    palm: str


@dataclass(frozen=True)
class Anatomy:
    """The moving joints of a robot, by what they are for.

    Attributes:
        base: Joints that move the robot as a whole.
        limbs: Its limbs, left before right.
        parts: The others by part, one of `PARTS`; parts without joints are left out.
        reasons: What was concluded from what, one sentence each.
    """

    base: Joints
    limbs: tuple[LimbJoints, ...]
    parts: Mapping[str, Joints]
    reasons: tuple[str, ...]


class Lengths:
    """Distances along the joints of a robot (m); turning joints do not change them."""

    def __init__(self, model: UrdfModel) -> None:
        """Place every link of a robot whose joints are all at 0."""
        self._model = model
        self._places = {link: pose[:3, 3] for link, pose in rest_poses(model).items()}

    def place(self, joint: ModelJoint) -> Floats:
        """Return where a joint is, in the root's frame, (3,) (m)."""
        return self._places[joint.child]

    def between(self, link: str, joint: ModelJoint) -> float:
        """Return the length from a link over a joint on it to the end of the chain (m)."""
        way = np.linalg.norm(self._places[joint.child] - self._places[link])
        return float(way) + self.behind(joint)

    def along(self, joints: Sequence[ModelJoint]) -> float:
        """Return the length of joints in a row, from the first to the last (m)."""
        places = [self.place(joint) for joint in joints]
        return float(sum(np.linalg.norm(b - a) for a, b in zip(places, places[1:], strict=False)))

    def behind(self, joint: ModelJoint) -> float:
        """Return the length from a joint to the end of the longest chain that it moves (m)."""
        return self._behind[joint.name]

    @cached_property
    def _behind(self) -> dict[str, float]:
        lengths: dict[str, float] = dict.fromkeys(self._model.links, 0.0)
        for joint in reversed(self._model.ordered):
            way = np.linalg.norm(self._places[joint.child] - self._places[joint.parent])
            lengths[joint.parent] = max(lengths[joint.parent], float(way) + lengths[joint.child])
        return {joint.name: lengths[joint.child] for joint in self._model.joints}


@dataclass
class _Chain:
    """Joints in a row that end in a hand or in nothing; ``kind`` is ``arm`` or one of `PARTS`."""

    joints: Joints
    fingers: Joints = ()
    palm: str = ""
    kind: str = ""


@dataclass
class _TreeWalk:
    """A walk over the tree, and what it has come to so far."""

    model: UrdfModel
    lengths: Lengths
    base: Joints = ()
    chains: list[_Chain] = field(default_factory=list)
    torso: list[ModelJoint] = field(default_factory=list)
    reasons: list[str] = field(default_factory=list)


def find_anatomy(model: UrdfModel, urdf: str) -> Anatomy:
    """Tell the parts of a robot apart.

    Raises:
        DescriptorError: If it has no joint that moves.
    """
    if not model.moving:
        raise DescriptorError(f"{urdf} has no joint that moves; there is nothing to drive")
    search = _TreeWalk(model, Lengths(model))
    _walk(search, model.root, ())
    for chain in search.chains:
        chain.kind = chain.kind or _kind(chain, search.chains)
    arms = [chain for chain in search.chains if chain.kind == "arm"] or _instead(search)
    arms = [_with_jaw(search, chain) for chain in arms]
    limbs = tuple(sorted(_named(search, arms), key=lambda limb: limb.name))
    parts = {part: _joints_of(search, part) for part in PARTS}
    parts = {part: joints for part, joints in parts.items() if joints}
    _explain(search, limbs, parts)
    return Anatomy(search.base, limbs, parts, tuple(search.reasons))


def _walk(search: _TreeWalk, link: str, path: Joints) -> None:
    """Follow the tree from a link; ``path`` are the joints since the base or the last branch."""
    nexts = search.model.moving_on(link)
    if not nexts:
        search.chains.append(_Chain(path, palm=path[-1].child))
    elif len(nexts) == 1 and not path and _is_of_base(search, nexts[0]):
        search.base += nexts
        if search.model.moving_on(nexts[0].child):
            _walk(search, nexts[0].child, ())
    elif len(nexts) == 1:
        _walk(search, nexts[0].child, (*path, *nexts))
    elif _is_hand(search, link, nexts, path):
        search.chains.append(_hand(search, nexts, path))
    else:
        _branch(search, nexts, path)


def _branch(search: _TreeWalk, nexts: Joints, path: Joints) -> None:
    """Tell a body that carries limbs from an arm that carries something beside."""
    ranked = sorted(nexts, key=lambda joint: -search.lengths.behind(joint))
    main, beside = ranked[0], ranked[1:]
    if path and all(_is_accessory(search, joint, path) for joint in beside):
        for joint in beside:
            behind = search.model.below(joint)
            search.chains.append(_Chain(behind, palm=behind[-1].child, kind="body"))
        _walk(search, main.child, (*path, main))
        return
    search.torso += path
    for joint in nexts:
        _walk(search, joint.child, (joint,))


def _is_accessory(search: _TreeWalk, joint: ModelJoint, path: Joints) -> bool:
    """Tell whether a side branch is part of an arm: a strut that follows it, or a small thing."""
    behind = search.model.below(joint)
    names = _names(behind)
    if any(words.has(name, (*words.HEAD, *words.LEG, *words.WHEEL)) for name in names):
        return False
    follows = all(other.mimics for other in behind)
    is_arm = any(words.has(name, words.ARM) for name in names)
    return follows or (len(path) > 1 and len(behind) < 3 and not is_arm)


def _is_of_base(search: _TreeWalk, joint: ModelJoint) -> bool:
    """Tell whether a joint at the root moves the whole robot, by itself or with the next ones.

    One that turns does, too, if a slide of a base follows it, or if it turns in the place to which
    slides of a base have brought it.
    """
    model = search.model
    if _moves_the_whole(joint):
        return True
    if joint.unit != "rad":
        return False
    after = model.moving_on(joint.child)
    if len(after) == 1 and flies(after[0]):
        return True
    slides = [before for before in search.base if flies(before)]
    turns_there = float(np.linalg.norm(joint.origin[:3, 3])) < IN_PLACE
    return len(slides) > 1 and slides[-1] is search.base[-1] and turns_there


def _moves_the_whole(joint: ModelJoint) -> bool:
    return flies(joint) or bool(set(words.words(joint.name)) & set(words.BASE))


def flies(joint: ModelJoint) -> bool:
    """Tell whether a joint slides so far that it moves a whole robot."""
    low, high = joint.span
    return joint.unit == "m" and high - low > FARTHEST_SLIDE


def _is_hand(search: _TreeWalk, link: str, nexts: Joints, path: Joints) -> bool:
    """Tell whether a link that branches is a palm: what it carries is small, or called fingers."""
    behind = [search.model.below(joint) for joint in nexts]
    if any(_is_other(joints) for joints in behind):
        return False
    span = max(search.lengths.between(link, joint) for joint in nexts)
    arm = search.lengths.along(path)
    named = all(_share(joints, words.FINGER) > 0.5 for joints in behind)
    if not named and any(_spins(joint) for joints in behind for joint in joints):
        return False
    called_palm = any(words.has(joint.parent, (*words.HAND, "palm")) for joint in nexts)
    if named or (path and called_palm):
        return not path or span <= max(arm, LARGEST_HAND)
    return span <= LONGEST_HAND * arm if len(path) > 2 else span <= LARGEST_HAND and not path


def _spins(joint: ModelJoint) -> bool:
    low, high = joint.span
    return joint.unit == "rad" and (joint.type == "continuous" or high - low > WIDEST_FINGER)


def _is_other(joints: Joints) -> bool:
    """Tell whether most of some joints are called parts of an arm, a head, a leg or a wheel."""
    known = (*words.ARM, *words.HEAD, *words.LEG, *words.WHEEL)
    return _share(joints, known) > 0.5 and not _share(joints, words.FINGER) > 0.5


def _hand(search: _TreeWalk, nexts: Joints, path: Joints) -> _Chain:
    """Return the chain that ends in a hand; a joint that the fingers mimic belongs to the hand."""
    fingers = tuple(f for joint in nexts for f in search.model.below(joint))
    followed = {joint.mimics for joint in fingers}
    leads = [i for i, joint in enumerate(path) if joint.name in followed]
    start = min(leads, default=len(path))
    carriers = [joint.parent for joint in nexts]
    palm = max(dict.fromkeys(carriers), key=carriers.count)  # the first of equals
    if start < len(path):
        palm = path[start].parent
    return _Chain(path[:start], (*path[start:], *fingers), palm)


def _kind(chain: _Chain, chains: Sequence[_Chain]) -> str:
    """Return what a chain is: ``arm``, or one of `PARTS`."""
    joints = (*chain.joints, *chain.fingers)
    arms, legs = _share(joints, words.ARM), _share(joints, words.LEG)
    if _share(joints, words.WHEEL) >= 0.5 or _turns_freely(chain):
        return "wheels" if len(chains) > 1 else "arm"
    if _share(joints, words.HEAD) >= 0.5 and arms < 0.5:
        return "head"
    if legs >= 0.3 and legs > arms and not chain.fingers:
        return "legs"
    if chain.fingers or arms >= 0.3 or len(chains) == 1:
        return "arm"
    if _share(joints, words.TORSO) >= 0.5:
        return "torso"
    return "arm" if len(joints) >= FEWEST_ARM_JOINTS and not _many(chain, chains) else "body"


def _turns_freely(chain: _Chain) -> bool:
    return len(chain.joints) <= 2 and all(joint.type == "continuous" for joint in chain.joints)


def _many(chain: _Chain, chains: Sequence[_Chain]) -> bool:
    """Tell whether a chain is one of four or more alike, which are legs, beside a longer one."""
    count = len(chain.joints)
    alike = sum(len(other.joints) == count and not other.fingers for other in chains)
    return alike >= 4 and any(len(other.joints) > count or other.fingers for other in chains)


def _instead(search: _TreeWalk) -> list[_Chain]:
    """Return what stands for arms in a robot that has none: legs, or what else moves."""
    for kind in ("legs", "body", "head", "torso", "wheels"):
        found = [chain for chain in search.chains if chain.kind == kind]
        if found:
            for chain in found:
                chain.kind = "arm"
            instead = f"arm: none is recognised, so the {kind} are driven as arms"
            search.reasons.append(Doubt(instead))
            return found
    torso = tuple(search.torso) or search.base
    search.torso, search.base = [], ()
    search.reasons.append(
        Doubt(f"arm: {_listing(torso)}; they move the whole robot, which so flies freely")
    )
    return [_Chain(torso, palm=torso[-1].child, kind="arm")]


def _with_jaw(search: _TreeWalk, chain: _Chain) -> _Chain:
    """Make the last joint of an arm its gripper, if it is a jaw."""
    fingers_only = _share(chain.joints, words.JAW) > 0.5
    if len(chain.joints) > 1 and not (chain.fingers or fingers_only) and _is_jaw(chain.joints[-1]):
        jaw = chain.joints[-1]
        start = len(chain.joints) - 1
        if jaw.mimics == chain.joints[start - 1].name:
            start -= 1
        chain = replace(chain, joints=chain.joints[:start], fingers=chain.joints[start:])
        chain.palm = chain.fingers[0].parent
        search.reasons.append(f"gripper: one jaw, {jaw.name}, the last joint, by its name")
    return chain


def _is_jaw(joint: ModelJoint) -> bool:
    low, high = joint.span
    named = any(words.has(name, words.JAW) for name in (joint.name, joint.child))
    return named and high - low <= WIDEST_JAW and not words.has(joint.name, words.WRIST)


def _named(search: _TreeWalk, arms: Sequence[_Chain]) -> list[LimbJoints]:
    """Return the limbs, named by side as their names say, else as they stand, else by numbers."""
    if len(arms) == 1:
        (chain,) = arms
        if not chain.joints and not search.torso:  # a hand that flies
            chain.joints, search.base = search.base, ()
        return [LimbJoints("", chain.joints, chain.fingers, chain.palm)]
    sides = [words.side(_names(chain.joints or chain.fingers)) for chain in arms]
    if sorted(sides) != ["left", "right"]:
        across = [search.lengths.place((chain.joints or chain.fingers)[0])[1] for chain in arms]
        if len(arms) == 2 and abs(across[0] - across[1]) > 0.01:
            sides = ["left" if y == max(across) else "right" for y in across]
        else:
            sides = [str(i + 1) for i in range(len(arms))]
            search.reasons.append(
                Doubt(
                    f"limbs: {', '.join(sides)}, as nothing says what they are called;"
                    f" limbs={{NAME: {sides[0]!r}, NAME: {sides[1]!r}}} names them, and holds the"
                    " others still"
                )
            )
    return [
        LimbJoints(side, chain.joints, chain.fingers, chain.palm)
        for side, chain in zip(sides, arms, strict=True)
    ]


def _joints_of(search: _TreeWalk, part: str) -> Joints:
    chains = [chain for chain in search.chains if chain.kind == part]
    joints = [joint for chain in chains for joint in (*chain.joints, *chain.fingers)]
    return (*(search.torso if part == "torso" else ()), *joints)


def _explain(search: _TreeWalk, limbs: Iterable[LimbJoints], parts: Mapping[str, Joints]) -> None:
    why = {
        "torso": "as limbs branch off behind it",
        "head": "by name",
        "legs": "by name",
        "wheels": "by name, or as they turn without end",
        "body": "as it is neither arm nor gripper",
    }
    reasons = search.reasons
    if search.base:
        reasons.append(
            f"base, held still: {_listing(search.base)}, by name or by going farther than"
            f" {FARTHEST_SLIDE:g} m"
        )
    for part, joints in parts.items():
        reasons.append(
            f"{part}, held still: {_listing(joints)}, {why[part]}; a JointGroup in the place of"
            " JointGroup.hold drives it"
        )
    for limb in limbs:
        which = f"{limb.name} " if limb.name else ""
        if limb.arm:
            reasons.append(f"{which}arm: {_listing(limb.arm)}, the joints in a row to {limb.palm}")
        if len(limb.fingers) > 1:
            chains = len(search.model.moving_on(limb.palm))
            reasons.append(
                f"{which}gripper: {_listing(limb.fingers)}, as {limb.palm} carries {chains} short"
                f" chain{'s' * (chains != 1)}{' side by side' * (chains != 1)}"
            )
        elif not limb.fingers:
            reasons.append(
                f"{which}gripper: none, as no joints branch at the end and none is named like a jaw"
            )


def _share(joints: Sequence[ModelJoint], known: Sequence[str]) -> float:
    """Return the share of joints that hold one of some words in their name or their link's."""
    named = [any(words.has(n, known) for n in (j.name, j.child)) for j in joints]
    return sum(named) / max(len(named), 1)


def _names(joints: Iterable[ModelJoint]) -> list[str]:
    return [name for joint in joints for name in (joint.name, joint.child)]


def _listing(joints: Iterable[ModelJoint]) -> str:
    return ", ".join(joint.name for joint in joints)

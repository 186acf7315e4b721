"""A descriptor guessed from a URDF, with the reason for every guess."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from dataclasses import fields as fields_of
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from robot_layouts.core.errors import DescriptorError
from robot_layouts.core.schema import check
from robot_layouts.kinematics.rotations import Floats, transform
from robots.action_split import ActionSplit, JointGroup
from robots.bodies.allowed import joined_pairs, rigid_pairs
from robots.bodies.hulls import Hull, counted_pairs, read_hulls
from robots.bodies.overlaps import guess_allowed, overlapping
from robots.descriptor import RobotDescriptor, UrdfSource
from robots.guessing import words
from robots.guessing.anatomy import Anatomy, LimbJoints, find_anatomy
from robots.guessing.doubt import Doubt
from robots.guessing.drives import Drives, read_masses
from robots.guessing.fingertips import Fingertips, find_fingers, find_material
from robots.guessing.grippers import Gripper, entangled, find_gripper
from robots.guessing.groups import arm_groups, held_groups
from robots.guessing.hints import NOTHING, Hints, known_anatomy, known_tip, renamed
from robots.guessing.posture import Posture, PostureSearch
from robots.guessing.stance import Stance
from robots.guessing.tool import BETWEEN, EXACT, Tool, at_pinch, find_base, find_reach, find_tool
from robots.parts import PINCH, Fingers, Limb, Vector3
from robots.urdf.cleaning.xacro_files import expand, template_of
from robots.urdf.model import UrdfModel
from robots.urdf.reading import read_model
from robots.urdf.summary import is_template_file, read_cleaned

LinkPairs = tuple[tuple[str, str], ...]

LISTED = 6  # pairs of links that a reason names
SUNK = 1e-3  # m; deeper in the ground than what rests on it
BEYOND = 1e-2  # rad, m; how far beyond its limits a joint of a known posture may be
TCP = {  # what may be given of a tool centre point, in a `Tool`
    "tcp_link": ("link", str),
    "tcp_position_links": ("links", tuple[str, ...]),
    "tcp_offset": ("offset", Vector3),
}
HOMES = ("home", "rest", "ready", "neutral", "initial", "init", "start", "default")  # best first


@dataclass(frozen=True)
class Guess:
    """A guessed descriptor.

    Attributes:
        descriptor: The descriptor.
        reasons: What was guessed and why, one sentence each.
    """

    descriptor: RobotDescriptor
    reasons: tuple[str, ...]

    def __str__(self) -> str:
        """Return name and reasons, one a line; what weakens use comes first."""
        others = [reason for reason in self.reasons if reason not in self.doubts]
        return self._listed([*self.doubts, *others])

    @property
    def doubts(self) -> tuple[str, ...]:
        """The reasons that weaken what the robot can do, or were decided on little."""
        return tuple(reason for reason in self.reasons if isinstance(reason, Doubt))

    def summary(self) -> str:
        """Return name and doubts, one a line, and how many reasons there are besides."""
        rest = len(self.reasons) - len(self.doubts)
        return self._listed([*self.doubts, f"{rest} more reasons: --all"])

    def _listed(self, reasons: Sequence[str]) -> str:
        head = f"{self.descriptor.name}: {self.descriptor.summary}, all guessed"
        return "\n".join([head, *(f"  {reason}" for reason in reasons)])

    def module(self) -> str:
        """Return the data module that declares the descriptor, to paste and correct."""
        from robots.data_module import write_module

        return write_module(self.descriptor, self.reasons)


@dataclass(frozen=True, eq=False)
class _Parts:
    """What the steps of a guess share."""

    model: UrdfModel
    stance: Stance
    anatomy: Anatomy
    hulls: tuple[Hull, ...]
    drives: Drives
    tips: Mapping[str, Fingertips]
    tools: Mapping[str, Tool]
    grippers: Mapping[str, Gripper]
    hints: Hints


def guess(
    source: UrdfSource,
    name: str | None,
    overrides: dict[str, Any],
    *,
    file: Path | None = None,
    hints: Hints = NOTHING,
) -> Guess:
    """Guess a descriptor.

    Args:
        source: Where its URDF comes from.
        name: Registry name; None takes that of the URDF.
        overrides: Fields of the descriptor that are known better. In ``limbs``, names of limbs as
            they are guessed may stand for these: ``{"left": "1", "right": "2"}`` renames two, and
            a limb that is left out is held still.
        file: The file that the robot is described in; None if it is the URDF.
        hints: What else is known of it.

    Raises:
        AssetError: If the URDF or a mesh of it is missing, or it describes no robot.
        DescriptorError: If nothing moves, or an override contradicts the rest.
    """
    names = [field.name for field in fields_of(RobotDescriptor)]
    if unknown := sorted(set(overrides) - set(names)):
        raise DescriptorError(f"a descriptor has no fields {unknown}; it has {', '.join(names)}")
    path = source.locate()
    cleaned = read_cleaned(path)
    limbs = overrides.get("limbs")
    if limbs and all(isinstance(limb, str) for limb in limbs.values()):
        overrides = {field: value for field, value in overrides.items() if field != "limbs"}
        parts = _look_at(path, cleaned.xml, hints, overrides, limbs)
    else:
        parts = _look_at(path, cleaned.xml, hints, overrides)
    main = parts.anatomy.limbs[0]
    tool = parts.tools[main.name]
    split = _action_split(parts)
    allowed, overlaps = _may_overlap(parts, path)
    rest, posture = _rest(parts, allowed)
    distance, measured = find_reach(parts.model, main, tool, rest)
    fingers, _ = _fingers(parts, main)
    wheels, sunk = _wheels(parts), _below_ground(parts, rest)
    fields: dict[str, Any] = {
        "name": name or _as_name(parts.model.name or path.stem),
        "urdf": source,
        "action_split": split,
        "tcp_link": tool.link,
        "tcp_position_links": tool.links,
        "tcp_offset": tool.offset,
        "gripper_material": find_material(parts.model, parts.anatomy.limbs),
        "fingers": fingers,
        "keyframes": _keyframes(parts, split, rest),
        "reach": distance,
        "source": f"guessed from {(file or path).name}",
        "allowed_collisions": (*allowed, *posture.overlapping),
        "no_floor_contact": (*wheels, *(link for link in sunk if link not in wheels)),
        "limbs": _limbs(parts, rest),
    }
    below = f"no_floor_contact: {', '.join(sunk)}, below the ground that its base drives on"
    rolling = f"no_floor_contact: {', '.join(wheels)}, by name; they do not roll"
    reasons = (
        *(f"repaired: {repair}" for repair in cleaned.repairs),
        *(expand(*template_of(path)).reasons() if is_template_file(path) else ()),
        *(() if hints.limbs else hints.reasons),
        *parts.anatomy.reasons,
        *(tool.reason for tool in parts.tools.values()),
        *_about_hands(parts),
        *parts.drives.reasons(),
        *_out_of_limits(parts),
        *((rolling,) if wheels else ()),
        *((below,) if sunk else ()),
        *posture.reasons,
        measured,
        *overlaps,
        *(f"{field}: given, not guessed" for field in overrides),
    )
    return Guess(RobotDescriptor(**{**fields, **overrides}), reasons)


def _look_at(
    path: Path,
    xml: bytes,
    hints: Hints,
    overrides: Mapping[str, Any],
    names: Mapping[str, str] | None = None,
) -> _Parts:
    model = read_model(xml, path.as_posix())
    anatomy = known_anatomy(model, find_anatomy(model, path.as_posix()), hints)
    if names:
        anatomy = renamed(model, anatomy, names)
    stance = Stance(model)
    hulls = read_hulls(model, path) if find_spec("fcl") else ()
    bodies: dict[int, list[Floats]] = {}
    for hull in hulls:
        bodies.setdefault(hull.link, []).append(hull.corners)
    masses = read_masses(model, stance.tree, bodies)
    drives = Drives(stance, masses, hints.drives, hints.source)
    hands = [limb for limb in anatomy.limbs if limb.fingers]
    tips = {limb.name: Fingertips(stance, limb, hulls) for limb in hands}
    between = EXACT if hints.frames_at_joints else BETWEEN
    tools = {
        limb.name: _known_tool(model, limb, hints)
        or find_tool(
            stance, limb, tips.get(limb.name), between=between, before=hints.frames_at_joints
        )
        for limb in anatomy.limbs
    }
    grippers = {limb.name: find_gripper(limb, tips[limb.name], drives) for limb in hands}
    for name, gripper in grippers.items():
        if gripper.pinch is not None:
            tools[name] = at_pinch(tools[name], stance, gripper.pinch)
    main = anatomy.limbs[0].name
    tools[main] = _given_tool(tools[main], overrides)
    return _Parts(model, stance, anatomy, hulls, drives, tips, tools, grippers, hints)


def _given_tool(guessed: Tool, overrides: Mapping[str, Any]) -> Tool:
    """Return the tool centre point that is given, in place of all that was guessed of it."""
    given = {
        field: check(overrides[name], hint, name, DescriptorError)
        for name, (field, hint) in TCP.items()
        if name in overrides
    }
    if not given:
        return guessed
    tool = Tool(given.get("link", guessed.link), (), "")
    at = " and ".join(name for name in TCP if name in overrides)
    return replace(tool, reason=f"TCP: by {at}, as given, on the link {tool.link}", **given)


def _known_tool(model: UrdfModel, limb: LimbJoints, hints: Hints) -> Tool | None:
    """Return the tool centre point that is known as a limb's end, if any is."""
    tip = known_tip(model, limb, hints)
    which = f"{limb.name} TCP" if limb.name else "TCP"
    return Tool(tip, (), f"{which}: the link {tip}, as {hints.source} says") if tip else None


def _as_name(text: str) -> str:
    name = re.sub(r"[^A-Za-z0-9]+", "_", text).strip("_").lower()
    return name if re.match(r"[a-z]", name) else f"robot_{name}".rstrip("_")


def _action_split(parts: _Parts) -> ActionSplit:
    groups: dict[str, JointGroup] = {}
    for limb in parts.anatomy.limbs:
        groups.update(arm_groups(limb, parts.drives))
        if limb.name in parts.grippers:
            groups.update(parts.grippers[limb.name].groups)
    return ActionSplit(**groups, **held_groups(parts.anatomy, parts.drives))


def _wheels(parts: _Parts) -> tuple[str, ...]:
    """Return the wheels of a base that joints move: links called so that it carries."""
    if not parts.anatomy.base:
        return ()
    model, body = parts.model, parts.anatomy.base[-1].child
    wheels = [j for j in model.moving_on(body) if words.has(j.child, words.WHEEL)]
    links = [joint.child for first in wheels for joint in model.below(first)]
    carried = [near for link in (body, *links) for near in model.rigid_with(link)]
    return tuple(
        link for link in carried if link in model.collisions and words.has(link, words.WHEEL)
    )


def _below_ground(parts: _Parts, rest: Mapping[str, float]) -> tuple[str, ...]:
    """Return the links of a base that joints move which are in the ground, at its root's height."""
    if not parts.anatomy.base:
        return ()
    stance = parts.stance
    poses = stance.poses(stance.with_joints(rest))[0]
    lowest = ((h.link, transform(poses[h.link], h.corners)[:, 2].min()) for h in parts.hulls)
    sunk = {link for link, height in lowest if height < -SUNK}
    return tuple(stance.tree.links[link] for link in sorted(sunk))


def _fingers(parts: _Parts, limb: LimbJoints) -> tuple[Fingers | None, str]:
    if not limb.fingers:
        return find_fingers(limb, None, ())
    gripper = parts.grippers[limb.name]
    known = gripper.pinch.ends if gripper.pinch else None
    return find_fingers(limb, parts.tips[limb.name], gripper.closing, known)


def _limbs(parts: _Parts, rest: Mapping[str, float]) -> dict[str, Limb]:
    """Return the limbs of a robot that has several."""
    limbs: dict[str, Limb] = {}
    for limb in parts.anatomy.limbs if len(parts.anatomy.limbs) > 1 else ():
        tool, base = parts.tools[limb.name], find_base(parts.model, limb, rest)
        limbs[limb.name] = Limb(
            tool.link,
            find_reach(parts.model, limb, tool, rest, base)[0],
            base,
            _fingers(parts, limb)[0],
            tool.links,
            tool.offset,
        )
    return limbs


def _about_hands(parts: _Parts) -> Iterator[str]:
    for gripper in parts.grippers.values():
        yield from gripper.reasons
    material = find_material(parts.model, parts.anatomy.limbs)
    if material is not None:
        links = ", ".join(material.links)
        yield f"gripper_material: friction 2 on {links}, as ManiSkill's grippers have"
    yield from (_fingers(parts, limb)[1] for limb in parts.anatomy.limbs if limb.fingers)


def _may_overlap(parts: _Parts, path: Path) -> tuple[LinkPairs, tuple[str, ...]]:
    """Return the pairs of links that may overlap, and the reasons."""
    allowed, reasons = guess_allowed(parts.model, path)
    known = _known_pairs(parts, allowed)
    if known:
        reasons = (*reasons, _too(known, f"which {parts.hints.source} leaves out"))
    allowed = (*allowed, *known)
    hands = _within_hands(parts, allowed)
    if hands:
        reasons = (*reasons, _too(hands, "of hands, which overlap while these are open"))
    still = _still(parts, (*allowed, *hands))
    if still:
        reasons = (*reasons, _too(still, "of what is held still, which overlap there"))
    return (*allowed, *hands, *still), reasons


def _known_pairs(parts: _Parts, allowed: LinkPairs) -> LinkPairs:
    """Return the pairs of links that are known to be allowed, but those that are so anyhow."""
    fixed = joined_pairs(parts.model) | rigid_pairs(parts.model) | {frozenset(p) for p in allowed}
    links = set(parts.model.links)
    pairs = [pair for pair in parts.hints.allowed if frozenset(pair) not in fixed]
    return tuple({frozenset(pair): pair for pair in pairs if links.issuperset(pair)}.values())


def _too(pairs: LinkPairs, why: str) -> str:
    listing = ", ".join(f"{one} and {other}" for one, other in pairs[:LISTED])
    more = f" and {len(pairs) - LISTED} pairs more" if len(pairs) > LISTED else ""
    return f"allowed_collisions, too: {listing}{more}, {why}"


def _within_hands(parts: _Parts, allowed: LinkPairs) -> LinkPairs:
    """Return the pairs of a hand's links that overlap however it stands."""
    found: dict[tuple[str, str], None] = {}
    pairs = _counted(parts, allowed)
    for limb in parts.anatomy.limbs:
        if limb.name in parts.grippers:
            gripper, ends = parts.grippers[limb.name], parts.tips[limb.name].ends
            inside = entangled(parts.stance, limb, parts.hulls, pairs, gripper, ends)
            found |= dict.fromkeys(inside)
    return tuple(found)


def _still(parts: _Parts, allowed: LinkPairs) -> LinkPairs:
    """Return the pairs of links that no action moves and that overlap where they are held."""
    limbs = parts.anatomy.limbs
    driven = [joint for limb in limbs for joint in (*limb.arm, *limb.fingers)]
    tree, model = parts.stance.tree, parts.model
    moved = {
        tree.link(link)
        for joint in driven
        for behind in model.below(joint)
        for link in model.rigid_with(behind.child)
    }
    links = [hull.link for hull in parts.hulls]
    pairs = [p for p in _counted(parts, allowed) if not moved & {links[i] for i in p}]
    poses = parts.stance.poses(parts.stance.middle)[0]
    overlaps = overlapping(parts.hulls, poses, pairs)
    names = [(tree.links[links[a]], tree.links[links[b]]) for a, b in pairs]
    found = [name for name, overlap in zip(names, overlaps, strict=True) if overlap]
    return tuple(dict.fromkeys(found))


def _counted(parts: _Parts, allowed: LinkPairs) -> tuple[tuple[int, int], ...]:
    """Return the pairs of hulls whose overlaps count, by their indices."""
    pairs = joined_pairs(parts.model) | rigid_pairs(parts.model)
    pairs |= frozenset(map(frozenset, allowed))
    return counted_pairs(parts.stance.tree, parts.hulls, pairs)


def _rest(parts: _Parts, allowed: LinkPairs) -> tuple[dict[str, float], Posture]:
    """Return the keyframe (rad, m), and the posture that it is."""
    pairs = _counted(parts, allowed)
    hands = [gripper.postures for gripper in parts.grippers.values()]
    tools = [(limb, parts.tools[limb.name]) for limb in parts.anatomy.limbs]
    torso = parts.anatomy.parts.get("torso", ())
    search = PostureSearch(parts.stance, tools, parts.hulls, pairs, hands, torso)
    home = _home(parts)
    where = f"the posture {home!r} of {parts.hints.source}"
    found = search.given(parts.hints.postures[home], where) if home else search.run()
    rest = parts.stance.all_joints(found.position)
    for postures in hands:  # joints that one number drives need not mimic each other in the URDF
        rest |= next(
            posture
            for posture in postures
            if all(abs(at - rest[j]) < 1e-5 for j, at in posture.items() if j in parts.stance.index)
        )
    return rest, found


def _home(parts: _Parts) -> str:
    """Return the name of a known posture to start from: of all joints of the arms, or none."""
    arms = {j.name for limb in parts.anatomy.limbs for j in limb.arm if j.mimics is None}
    whole = [name for name, joints in _postures(parts).items() if arms <= joints.keys()]
    homes = [name for home in HOMES for name in whole if home in words.words(name)]
    return next(iter((*homes, *(whole if parts.hints.first_is_home else ()))), "")


def _postures(parts: _Parts) -> dict[str, Mapping[str, float]]:
    """Return the known postures that keep within the joints' limits."""
    return {
        name: joints
        for name, joints in parts.hints.postures.items()
        if not any(_outside(parts, joint, at) for joint, at in joints.items())
    }


def _out_of_limits(parts: _Parts) -> Iterator[str]:
    for name, joints in parts.hints.postures.items():
        outside = [joint for joint, at in joints.items() if _outside(parts, joint, at)]
        if outside:
            yield Doubt(
                f"the posture {name!r} of {parts.hints.source} is left out, as it is beyond the"
                f" limits of {', '.join(outside)}"
            )


def _outside(parts: _Parts, joint: str, at: float) -> bool:
    low, high = next(j.span for j in parts.model.moving if j.name == joint)
    return not low - BEYOND <= at <= high + BEYOND


def _keyframes(
    parts: _Parts, split: ActionSplit, rest: Mapping[str, float]
) -> dict[str, tuple[float, ...]]:
    """Return the posture to rest in, and those that are known by name."""
    spans = {joint.name: joint.span for joint in parts.model.moving}
    found = {"rest": tuple(rest[joint] for joint in split.joints)}
    pinches = [gripper.pinch.joints for gripper in parts.grippers.values() if gripper.pinch]
    if pinches:
        at = dict(rest)
        for pinch in pinches:
            at |= pinch
        found[PINCH] = tuple(at[joint] for joint in split.joints)
    for name, joints in _postures(parts).items():
        if name == PINCH and not pinches:  # of a gripper that closes otherwise it means nothing
            continue
        at = {**rest, **{j: min(max(x, spans[j][0]), spans[j][1]) for j, x in joints.items()}}
        found.setdefault(name, tuple(at[joint] for joint in split.joints))
    return found

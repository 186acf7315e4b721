"""The tool centre point of a limb: a named frame, a place between finger tips, or the palm."""

from __future__ import annotations

import random
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from robot_layouts.kinematics.rotations import Floats, inverse_pose, transform
from robot_layouts.kinematics.solve import farthest
from robot_layouts.kinematics.tree import Tree
from robots.guessing import words
from robots.guessing.anatomy import LimbJoints, flies
from robots.guessing.doubt import Doubt
from robots.guessing.fingertips import Fingertips
from robots.guessing.pinch import Pinch
from robots.guessing.stance import Stance
from robots.parts import Vector3
from robots.urdf.model import UrdfModel
from robots.urdf.tcp import Tcp, place_tcp
from robots.urdf.tree import kinematic_tree

BETWEEN = 0.05  # m; a frame named like a tool counts if it is so near to the place between tips
EXACT = 0.02  # m; farther away, the reason says so
CLOSE = 0.01  # m; the farthest that a TCP may be from the place between two tips that are known
MEETING = 4e-3  # m; the farthest that it may be from where two fingers of a hand meet
BLIND = (*words.HEAD, "optical", "imu", "ft", "force", "torque", "inertia", "range", "led")
STARTS = 8  # of the search for the reach


@dataclass(frozen=True)
class Tool:
    """The tool centre point of a limb.

    Attributes:
        link: Link whose frame orients it.
        links: Links whose mean origin is its position; empty for ``link``.
        reason: Why, one sentence.
        offset: From there to its position, in the frame of ``link`` (m).
    """

    link: str
    links: tuple[str, ...]
    reason: str
    offset: Vector3 = (0.0, 0.0, 0.0)

    def on(self, tree: Tree) -> Tcp:
        """Return it on a tree that has its links."""
        return place_tcp(tree, self.link, self.links, self.offset)


def find_tool(
    stance: Stance,
    limb: LimbJoints,
    tips: Fingertips | None,
    *,
    between: float = BETWEEN,
    before: bool = False,
) -> Tool:
    """Return the tool centre point of a limb.

    Args:
        stance: The robot.
        limb: The limb.
        tips: The tips of its fingers, if it has any.
        between: How far from the place between the tips the middle of the fingers' frames may be
            and still count (m).
        before: Whether frames count, too, that are rigid with the palm but carried by what is
            before it.
    """
    which = f"{limb.name} TCP" if limb.name else "TCP"
    start = _first_rigid(stance, limb.palm) if before else limb.palm
    rigid = [link for link in stance.model.rigid_with(start) if link != limb.palm]
    rigid = [link for link in rigid if not words.has(link, BLIND)]
    for known, what in ((words.TCP, "tcp"), (words.GRASP, "a grasp")):
        named = [link for link in (*rigid, limb.palm) if words.has(link, known)]
        if named:
            also = f"; so are {', '.join(named[1:])}" if named[1:] else ""
            reason = f"{which}: the link {named[0]}, named like {what} and rigid with {limb.palm}"
            away = _apart(*_missed(stance, tips, named[0])) if tips and tips.are_jaws else ""
            return Tool(named[0], (), Doubt(reason + also + away) if away else reason + also)
    if tips is None:
        return _end(stance, limb, rigid, which)
    return _between(stance, limb, rigid, tips, which, between)


def at_pinch(tool: Tool, stance: Stance, pinch: Pinch) -> Tool:
    """Return a tool centre point that is where fingers meet: itself, or at an offset from its link.

    Args:
        tool: The tool centre point.
        stance: The robot.
        pinch: How they meet.
    """
    (there,) = tool.on(stance.tree).places(stance.poses(stance.middle))
    off = float(np.linalg.norm(there - pinch.place))
    if off <= MEETING:
        return tool
    which = tool.reason.partition(":")[0]
    named = f"the middle of {' and '.join(tool.links)}" if tool.links else f"the link {tool.link}"
    reason = f"{which}: where two fingers meet in the keyframe 'pinch', {off:.3f} m from {named}"
    return Tool(tool.link, (), reason, _seen_from(stance, tool.link, pinch.place))


def _missed(stance: Stance, tips: Fingertips, link: str) -> tuple[float, Vector3]:
    """Return how far a frame is from between the tips (m), 0 if it is near, and where that is."""
    distance = float(np.linalg.norm(stance.places((link,))[0] - tips.middle()))
    return (distance if distance > BETWEEN else 0.0), _seen_from(stance, link, tips.middle())


def _first_rigid(stance: Stance, link: str) -> str:
    """Return the first of the links that are rigid with one, seen from the root."""
    carriers = stance.model.parent_joint
    while link in carriers and not carriers[link].moves:
        link = carriers[link].parent
    return link


def _end(stance: Stance, limb: LimbJoints, rigid: list[str], which: str) -> Tool:
    """Return the end of an arm without gripper."""
    ranks = (
        lambda link: "tool" in words.words(link),
        words.is_tool,
        lambda link: words.has(link, words.TOOL),
        lambda link: words.has(link, (*words.HAND, *words.FLANGE)),
    )
    for fits in ranks:
        named = [link for link in rigid if fits(link)]
        if named:
            also = f"; so are {', '.join(named[1:])}" if named[1:] else ""
            reason = f"{which}: the link {named[0]}, named like the end of an arm{also}"
            return Tool(named[0], (), reason)
    if not rigid:
        return Tool(
            limb.palm,
            (),
            Doubt(f"{which}: the link {limb.palm}, the last one, as no tool is named"),
        )
    seen = {*stance.model.collisions, *stance.model.visuals}
    solid = [link for link in rigid if link in seen] or rigid
    places = stance.places((limb.palm, *solid))
    far = np.linalg.norm(places[1:] - places[0], axis=1)
    last = solid[int(np.argmax(np.round(far, 6)))]
    reason = f"{which}: the link {last}, the farthest one, as no tool is named"
    return Tool(last, (), Doubt(reason))


def _between(
    stance: Stance, limb: LimbJoints, rigid: list[str], tips: Fingertips, which: str, near: float
) -> Tool:
    """Return the frame, or the mean of two, that lies nearest between the finger tips."""
    middle, everywhere = tips.middle(), stance.places(stance.tree.links)

    def off(links: tuple[str, ...]) -> float:
        places = everywhere[[stance.tree.link(link) for link in links]]
        return round(float(np.linalg.norm(places.mean(axis=0) - middle)), 6)

    ends = [link for link in rigid if words.is_tool(link) or words.has(link, words.HAND)]
    ends += [limb.palm] if words.has(limb.palm, words.HAND) else []
    still = tuple(link for link in rigid if words.has(link, words.TIP))
    if len(still) > 1:  # of fingers that are fixed
        if off(still) <= BETWEEN:
            return _mean(stance, limb, still, which, off(still), middle)
        ends = [link for link in ends if link not in still]
    named = min(((off((link,)), link) for link in ends), default=(np.inf, ""))
    if named[0] <= BETWEEN:
        return _named(stance, tips, which, named[1], named[0])
    frames = _grasping(stance, tips)
    if off(frames) <= (CLOSE if tips.are_jaws else near):
        return _mean(stance, limb, frames, which, off(frames), middle)
    if tips.solid:
        return _beside(stance, limb, which, off((limb.palm,)), middle)
    choices: list[tuple[str, ...]] = [(limb.palm,), *((link,) for link in rigid), frames]
    distance, best = min((off(links), links) for links in choices)
    if best == frames:
        return _mean(stance, limb, best, which, distance, middle)
    only = ", which is only the palm" if best == (limb.palm,) else ", the nearest to the tips"
    apart = _apart(distance, _seen_from(stance, best[0], middle))
    return Tool(best[0], (), Doubt(f"{which}: the link {best[0]}{only}{apart}"))


def _named(stance: Stance, tips: Fingertips, which: str, link: str, distance: float) -> Tool:
    """Return a named frame, or the place between the tips beside it if these are known better."""
    if distance <= CLOSE or not tips.are_jaws:
        return Tool(link, (), f"{which}: the link {link}, which lies between the finger tips")
    reason = f"{which}: {distance * 100:.0f} cm from the link {link}, where the finger tips meet"
    return Tool(link, (), reason, _seen_from(stance, link, tips.middle()))


def _mean(
    stance: Stance,
    limb: LimbJoints,
    links: tuple[str, ...],
    which: str,
    distance: float,
    middle: Floats,
) -> Tool:
    listing = ", ".join(links[:-1]) + f" and {links[-1]}"
    reason = f"{which}: the middle of {listing}, turned as {limb.palm}"
    apart = _apart(distance, _seen_from(stance, limb.palm, middle))
    return Tool(limb.palm, links, Doubt(reason + apart) if apart else reason)


def _beside(stance: Stance, limb: LimbJoints, which: str, distance: float, middle: Floats) -> Tool:
    """Return the place between the finger tips as seen from the palm."""
    reason = (
        f"{which}: {distance * 100:.0f} cm from the link {limb.palm}, where the finger tips meet"
        " and no frame lies"
    )
    return Tool(limb.palm, (), reason, _seen_from(stance, limb.palm, middle))


def _seen_from(stance: Stance, link: str, place: Floats) -> Vector3:
    """Return a place in the frame of a link, to a tenth of a millimetre (m)."""
    frame = stance.poses(stance.middle)[0, stance.tree.link(link)]
    x, y, z = (round(value, 4) + 0.0 for value in transform(inverse_pose(frame), place).tolist())
    return (x, y, z)


def _grasping(stance: Stance, tips: Fingertips) -> tuple[str, ...]:
    """Return the frame at the tip of each finger that grasps."""
    return tuple(_frame_at(stance, tips, end) for end in tips.grasping() or tips.ends)


def _frame_at(stance: Stance, tips: Fingertips, end: str) -> str:
    """Return the frame nearest to the tip of a finger; one that is called a tip before others."""
    rigid = stance.model.rigid_with(end)
    links = [link for link in rigid if words.has(link, words.TIP)] or list(rigid)
    away = np.linalg.norm(stance.places(links) - tips.tip(end), axis=1)
    return links[int(np.argmin(np.round(away, 6)))]


def _apart(distance: float, offset: Vector3) -> str:
    if distance <= EXACT:
        return ""
    return (
        f"; the finger tips meet {distance * 100:.0f} cm away, where no frame lies:"
        f" tcp_offset={offset} moves it there"
    )


def find_base(model: UrdfModel, limb: LimbJoints, rest: Mapping[str, float]) -> Vector3:
    """Return where a limb's first joint is, in the robot's frame (m).

    Args:
        model: What the robot's URDF describes.
        limb: The limb.
        rest: Where the joints are (rad, m).
    """
    tree = kinematic_tree(model)
    start = np.array([rest.get(joint, 0.0) for joint in tree.coordinates])
    first = (*limb.arm, *limb.fingers)[0]
    x, y, z = tree.forward(start[None])[0][tree.link(first.child), :3, 3].round(4).tolist()
    return x, y, z


def find_reach(
    model: UrdfModel,
    limb: LimbJoints,
    tool: Tool,
    rest: Mapping[str, float],
    base: Vector3 = (0.0, 0.0, 0.0),
) -> tuple[float, str]:
    """Return a limb's reach (m), and how it was found.

    Args:
        model: What the robot's URDF describes.
        limb: The limb.
        tool: Its tool centre point.
        rest: Where the other joints are (rad, m).
        base: Where the vertical is that the reach is measured from, in the robot's frame (m).
    """
    tree = kinematic_tree(model)
    start = np.array([rest.get(joint, 0.0) for joint in tree.coordinates])
    origins = tree.origins.copy()
    origins[tree.parents == 0, :2, 3] -= base[:2]
    tree = replace(tree, origins=origins)
    poses = tree.forward(start[None])
    palm = tree.link(limb.palm)
    point = transform(inverse_pose(poses[0, palm]), tool.on(tree).places(poses)[0])
    moving = [joint for joint in limb.arm if not flies(joint)]
    free = [tree.coordinates.index(joint.name) for joint in moving]
    starts = np.tile(start, (STARTS, 1))
    starts[0, free] = [sum(joint.span) / 2 for joint in moving]
    generator = random.Random(0)  # the same answer every time
    for position in starts[1:]:
        position[free] = [generator.uniform(*joint.span) for joint in moving]
    limits = tree.limits.copy()
    limits[free] = np.array([joint.span for joint in moving]).reshape(-1, 2)
    found = farthest(replace(tree, limits=limits), palm, point, starts, free)
    if found < 0.01 or len(moving) < len(limb.arm):
        return 1.0, Doubt(
            "reach: 1 m, without ground, as nothing stands fixed or nothing reaches out"
        )
    return round(found, 3), (
        "reach: the TCP's largest distance from the base's z axis within the joint limits;"
        " data sheets, which measure to the flange, give less"
    )

"""The tool centre point of a limb: a named frame, a place between finger tips, or the palm."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from robots.guessing.fingertips import Fingertips
from robots.guessing.stance import Stance
from robots.urdf import words
from robots.urdf.anatomy import Limb

BETWEEN = 0.05  # m; a frame named like a tool counts if it is so near to the place between tips
EXACT = 0.02  # m; farther away, the reason says so
BLIND = (*words.HEAD, "optical", "imu", "ft", "force", "torque", "inertia", "range", "led")


@dataclass(frozen=True)
class Tool:
    """The tool centre point of a limb.

    Attributes:
        link: Link whose frame orients it.
        links: Links whose mean origin is its position; empty for ``link``.
        reason: Why, one sentence.
    """

    link: str
    links: tuple[str, ...]
    reason: str

    @property
    def origins(self) -> tuple[str, ...]:
        """The links whose mean origin is its position."""
        return self.links or (self.link,)


def find_tool(stance: Stance, limb: Limb, tips: Fingertips | None) -> Tool:
    """Return the tool centre point of a limb.

    Args:
        stance: The robot.
        limb: The limb.
        tips: The tips of its fingers, if it has any.
    """
    which = f"{limb.name} TCP" if limb.name else "TCP"
    rigid = [link for link in stance.model.rigid_with(limb.palm) if link != limb.palm]
    rigid = [link for link in rigid if not words.has(link, BLIND)]
    for known, what in ((words.TCP, "tcp"), (words.GRASP, "a grasp")):
        named = [link for link in (*rigid, limb.palm) if words.has(link, known)]
        if named:
            also = f"; so are {', '.join(named[1:])}" if named[1:] else ""
            reason = f"{which}: the link {named[0]}, named like {what} and rigid with {limb.palm}"
            return Tool(named[0], (), reason + also)
    if tips is None:
        return _end(stance, limb, rigid, which)
    return _between(stance, limb, rigid, tips, which)


def _end(stance: Stance, limb: Limb, rigid: list[str], which: str) -> Tool:
    """Return the end of an arm without gripper."""
    ranks = (
        lambda link: "tool" in words.words(link),
        words.is_tool,
        lambda link: words.has(link, words.TOOL),
        lambda link: words.has(link, (*words.HAND, "flange")),
    )
    for fits in ranks:
        named = [link for link in rigid if fits(link)]
        if named:
            also = f"; so are {', '.join(named[1:])}" if named[1:] else ""
            reason = f"{which}: the link {named[0]}, named like the end of an arm{also}"
            return Tool(named[0], (), reason)
    if not rigid:
        return Tool(
            limb.palm, (), f"{which}: the link {limb.palm}, the last one, as no tool is named"
        )
    solid = [link for link in rigid if _has_shape(stance, link)] or rigid
    places = stance.places((limb.palm, *solid))
    far = np.linalg.norm(places[1:] - places[0], axis=1)
    last = solid[int(np.argmax(np.round(far, 6)))]
    return Tool(last, (), f"{which}: the link {last}, the farthest one, as no tool is named")


def _has_shape(stance: Stance, link: str) -> bool:
    return link in stance.model.collisions or link in stance.model.visuals


def _between(
    stance: Stance, limb: Limb, rigid: list[str], tips: Fingertips, which: str
) -> Tool:
    """Return the frame, or the mean of two, that lies nearest between the finger tips."""
    middle, everywhere = tips.middle(), stance.places(stance.tree.links)

    def off(links: tuple[str, ...]) -> float:
        places = everywhere[[stance.tree.link(link) for link in links]]
        return round(float(np.linalg.norm(places.mean(axis=0) - middle)), 6)

    ends = [link for link in rigid if words.is_tool(link) or words.has(link, words.HAND)]
    named = sorted((off((link,)), link) for link in ends)
    if named and named[0][0] <= BETWEEN:
        link = named[0][1]
        return Tool(link, (), f"{which}: the link {link}, which lies between the finger tips")
    for candidates in (_tip_frames(stance, limb), _finger_links(tips)):
        ranked = sorted((off(pair), pair) for pair in _pairs(tips, candidates))
        if ranked and ranked[0][0] <= BETWEEN:
            pair = ranked[0][1]
            reason = f"{which}: the middle of {' and '.join(pair)}, turned as {limb.palm}"
            return Tool(limb.palm, pair, reason + _apart(ranked[0][0]))
    everything = [(off((link,)), (link,)) for link in (limb.palm, *rigid)]
    everything += [(off(pair), pair) for pair in _pairs(tips, _finger_links(tips))]
    distance, best = min(everything)
    if best == (limb.palm,):
        reason = f"{which}: the link {limb.palm}, which is only the palm{_apart(distance)}"
        return Tool(limb.palm, (), reason)
    if len(best) == 1:
        return Tool(best[0], (), f"{which}: the link {best[0]}{_apart(distance)}")
    reason = f"{which}: the middle of {' and '.join(best)}, turned as {limb.palm}"
    return Tool(limb.palm, best, reason + _apart(distance))


def _apart(distance: float) -> str:
    if distance <= EXACT:
        return ""
    return f"; the finger tips meet {distance * 100:.0f} cm away, where no frame lies"


def _tip_frames(stance: Stance, limb: Limb) -> list[str]:
    """Return the links of a hand that are called tips, also of a jaw's other side."""
    behind = [link for j in limb.fingers for link in stance.model.rigid_with(j.child)]
    found = (*stance.model.rigid_with(limb.palm), *behind)
    return [link for link in dict.fromkeys(found) if words.has(link, words.TIP)]


def _finger_links(tips: Fingertips) -> list[str]:
    model = tips.stance.model
    return [link for joint in tips.limb.fingers for link in model.rigid_with(joint.child)]


def _pairs(tips: Fingertips, links: list[str]) -> Iterator[tuple[str, ...]]:
    """Yield pairs of links of different fingers, of which one is a thumb if there is one."""
    known = set(_finger_links(tips))
    thumbs = any(tips.is_thumb(link) for link in known)
    for one, other in combinations(links, 2):
        if one in known and other in known:
            if tips.finger_of(one) == tips.finger_of(other):
                continue
            if thumbs and tips.is_thumb(one) == tips.is_thumb(other):
                continue
        yield (one, other)
    if len(links) > 2:
        yield tuple(links)

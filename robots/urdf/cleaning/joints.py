"""Repairs joints of a URDF that say that they do not move, or say too much."""

from __future__ import annotations

from collections.abc import Iterator
from xml.etree.ElementTree import Element

from robots.urdf.checks import link_of
from robots.urdf.text import numbers_of

FREE = ("floating", "planar")  # types of joints that place a robot rather than move it
BOUNDED = ("revolute", "prismatic")
NOTHING = 1e-3  # of a joint's range; what it may go by and still not move


def repair_joints(root: Element, urdf: str) -> Iterator[str]:
    """Repair the joints and yield what was done.

    Args:
        root: The ``<robot>``.
        urdf: Its path, for messages.
    """
    joints = root.findall("joint")
    yield from _fix_base(joints)
    for joint in joints:
        where = f"{urdf}: joint {joint.get('name')!r}"
        if joint.get("type") in BOUNDED and _is_shut(joint.find("limit"), where):
            _fix(joint)
            yield (
                f"joint {joint.get('name')!r} has the limits 0 … 0, which are those of a <limit>"
                " that has none, so it is fixed (if it should turn freely, make it continuous)"
            )
        elif joint.get("type") == "continuous":
            yield from _without_limits(joint)
        elif joint.get("type") == "fixed" and (mimic := joint.find("mimic")) is not None:
            joint.remove(mimic)
            yield f"joint {joint.get('name')!r} is fixed, so what it mimics counts for nothing"
    yield from _fix_followers(joints, urdf)
    yield from _turn_followers(joints, urdf)


def _fix_base(joints: list[Element]) -> Iterator[str]:
    """Fix a joint by which the whole robot would fly or drive: a layout says where it stands."""
    carried = {link_of(joint, "child") for joint in joints}
    for joint in joints:
        kind, parent = joint.get("type", ""), link_of(joint, "parent")
        if kind not in FREE or parent in carried:
            continue
        if sum(link_of(other, "parent") == parent for other in joints) == 1:
            _fix(joint)
            yield (
                f"joint {joint.get('name')!r}, by which the whole robot is {kind}, is fixed: a"
                " layout says where it stands"
            )


def _is_shut(limit: Element | None, where: str) -> bool:
    """Tell whether both limits are 0, which they are by the standard if they are left out."""
    if limit is None:
        return False
    return all(numbers_of(limit, key, (0.0,), where) == (0.0,) for key in ("lower", "upper"))


def _without_limits(joint: Element) -> Iterator[str]:
    limit = joint.find("limit")
    if limit is None or not {"lower", "upper"} & {*limit.keys()}:
        return
    ends = [limit.attrib.pop(key, "none") for key in ("lower", "upper")]
    yield (
        f"joint {joint.get('name')!r} is continuous, so its limits {' … '.join(ends)} rad count"
        " for nothing"
    )


def _fix_followers(joints: list[Element], urdf: str) -> Iterator[str]:
    """Fix the joints that mimic a joint that is fixed, and would stay where they are."""
    fixed = {joint.get("name") for joint in joints if joint.get("type") == "fixed"}
    waiting = [joint for joint in joints if joint.get("type") != "fixed"]
    while follower := next((j for j in waiting if _follows(j, fixed, urdf)), None):
        waiting.remove(follower)
        _fix(follower)
        fixed.add(follower.get("name"))
        yield f"joint {follower.get('name')!r} mimics a joint that is fixed, so it is fixed"


def _follows(joint: Element, fixed: set[str | None], urdf: str) -> bool:
    mimic = joint.find("mimic")
    if mimic is None or mimic.get("joint") not in fixed:
        return False
    where = f"{urdf}: joint {joint.get('name')!r}"
    return numbers_of(mimic, "offset", (0.0,), where) == (0.0,)


def _turn_followers(joints: list[Element], urdf: str) -> Iterator[str]:
    """Turn the multipliers of joints that mimic others, where the sign is wrong.

    Their limits leave them no way to follow then, and with the other sign all of it.
    """
    named = {joint.get("name"): joint for joint in joints}
    for joint in joints:
        mimic = joint.find("mimic")
        leader = None if mimic is None else named.get(mimic.get("joint"))
        own, led = _span(joint, urdf), _span(leader, urdf)
        if mimic is None or own is None or led is None:
            continue
        where = f"{urdf}: joint {joint.get('name')!r}"
        (factor,) = numbers_of(mimic, "multiplier", (1.0,), where)
        (offset,) = numbers_of(mimic, "offset", (0.0,), where)
        ways = [_within(own, led, sign * factor, offset) for sign in (1, -1)]
        if ways[0] < NOTHING and ways[1] > 1 - NOTHING:
            mimic.set("multiplier", f"{-factor:.17g}")
            yield (
                f"joint {joint.get('name')!r} mimics {mimic.get('joint')!r} times {factor:g}, out"
                f" of its own limits; it is taken times {-factor:g}, which stays within them"
            )


def _span(joint: Element | None, urdf: str) -> tuple[float, float] | None:
    """Return the limits of a joint that has two different ones."""
    if joint is None or joint.get("type") not in BOUNDED:
        return None
    where, limit = f"{urdf}: joint {joint.get('name')!r}", joint.find("limit")
    low, high = (numbers_of(limit, key, (0.0,), where)[0] for key in ("lower", "upper"))
    return (low, high) if low < high else None


def _within(
    own: tuple[float, float], led: tuple[float, float], factor: float, offset: float
) -> float:
    """Return the share of the way on which it is led that lies within a joint's own limits."""
    low, high = sorted(factor * end + offset for end in led)
    common = min(high, own[1]) - max(low, own[0])
    return max(common, 0.0) / (high - low) if high > low else 1.0


def _fix(joint: Element) -> None:
    joint.set("type", "fixed")
    for part in ("axis", "limit", "dynamics", "mimic", "safety_controller", "calibration"):
        for element in joint.findall(part):
            joint.remove(element)

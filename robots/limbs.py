"""Limbs: the arms of a robot that has several, and who takes which of its action numbers."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import groupby
from typing import TYPE_CHECKING, Any

from robots.action_split import ActionSplit
from robots.common.errors import DescriptorError

if TYPE_CHECKING:
    from robots.descriptor import RobotDescriptor
    from robots.parts import Limb

_SHARED = ("tcp_link", "tcp_position_links", "fingers", "reach")  # fields of limbs and robots

BODY = "body"  # what takes action numbers and is no limb: a torso that turns, a base that drives


def check_limbs(robot: RobotDescriptor) -> None:
    """Refuse limbs that do not share out the robot's joint groups, each in one piece.

    Raises:
        DescriptorError: If a limb has no name of its own, no action number, a group that there is
            not, one of another limb, or groups that do not follow one another.
    """
    if not robot.limbs:
        return
    owners = _owners(robot)
    for name in robot.limbs:
        if re.fullmatch(r"\w+", name) is None or name == BODY:
            raise DescriptorError(
                f"{robot.name}: {name!r} names no limb; letters, digits and _ are needed, and"
                f" {BODY!r} is taken by what is no limb"
            )
        groups = [robot.action_split.groups[g] for g, owner in owners.items() if owner == name]
        if not any(group.size for group in groups):
            raise DescriptorError(
                f"{robot.name}: limb {name!r} takes no action number; the joint groups are"
                f" {', '.join(owners)}. Name its own in groups=(…)"
            )
    runs = [owner for owner, _ in groupby(owners.values())]
    numbered = [owner for owner, _ in groupby(o for o in owners.values() if o is not None)]
    for name in (*robot.limbs, BODY):
        if (numbered if name == BODY else runs).count(name) > 1:
            raise DescriptorError(
                f"{robot.name}: the joint groups of {name!r} do not follow one another:"
                f" {', '.join(owners)}"
            )


def parts_of(robot: RobotDescriptor) -> dict[str, RobotDescriptor]:
    """Return who takes a robot's action numbers, in their order: its limbs, and ``body``.

    Each is described like a robot: its joint groups, its part of the keyframes, its TCP, fingers
    and reach. A robot without limbs has no parts.
    """
    if not robot.limbs:
        return {}
    owners = _owners(robot)
    return {
        name: _described(robot, name, [g for g, owner in owners.items() if owner == name])
        for name in dict.fromkeys(owners.values())
        if name is not None
    }


def _owners(robot: RobotDescriptor) -> dict[str, str | None]:
    """Return whose each joint group is; None of one that is held and no limb's."""
    groups = robot.action_split.groups
    owners: dict[str, str | None] = {name: BODY if g.size else None for name, g in groups.items()}
    for limb, groups_of_limb in _named(robot.limbs, groups):
        for group in groups_of_limb:
            if owners.get(group) in robot.limbs:
                raise DescriptorError(
                    f"{robot.name}: the joint group {group!r} belongs to two limbs,"
                    f" {owners[group]!r} and {limb!r}"
                )
            if group not in owners:
                raise DescriptorError(
                    f"{robot.name}: limb {limb!r} has a joint group {group!r}, which there is not;"
                    f" the groups are {', '.join(owners)}"
                )
            owners[group] = limb
    return owners


def _named(
    limbs: Mapping[str, Limb], groups: Mapping[str, Any]
) -> Iterator[tuple[str, Sequence[str]]]:
    for name, limb in limbs.items():
        yield name, limb.groups or [group for group in groups if name in group.split("_")]


def _described(robot: RobotDescriptor, name: str, groups: Sequence[str]) -> RobotDescriptor:
    split = ActionSplit(**{group: robot.action_split.groups[group] for group in groups})
    places = [robot.joints.index(joint) for joint in split.joints]
    keyframes = {key: [qpos[i] for i in places] for key, qpos in robot.keyframes.items()}
    own: dict[str, Any] = {"fingers": None, "cameras": ()}
    if name in robot.limbs:
        limb = robot.limbs[name]
        own = {field: getattr(limb, field) for field in _SHARED}
        own["cameras"] = tuple(c for c in robot.cameras if name in c.name.split("_"))
    return replace(
        robot, action_split=split, keyframes=keyframes, limbs={}, control_modes={}, **own
    )

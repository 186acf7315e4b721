"""Whose each joint group of a robot with several arms is."""

from __future__ import annotations

import re
from collections.abc import Mapping
from itertools import groupby

from robots.action_split import ActionSplit
from robots.common.errors import DescriptorError
from robots.parts import Limb

BODY = "body"  # what takes action numbers and is no limb: a torso that turns, a base that drives

Owners = dict[str, str | None]


def share_out(limbs: Mapping[str, Limb], split: ActionSplit) -> Owners:
    """Return whose each joint group is: a limb's, `BODY`'s, or nobody's if it is held.

    Args:
        limbs: The limbs by name.
        split: The joint groups.

    Raises:
        DescriptorError: If a limb has no name of its own, no action number, a group that there is
            not, one of another limb, or groups that do not follow one another.
    """
    owners: Owners = {name: BODY if group.size else None for name, group in split.groups.items()}
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


def _give(owners: Owners, group: str, limb: str, limbs: Mapping[str, Limb]) -> None:
    if group not in owners:
        raise DescriptorError(
            f"limb {limb!r} has a joint group {group!r}, which there is not; the groups are"
            f" {', '.join(owners)}"
        )
    if owners[group] in limbs:
        raise DescriptorError(
            f"the joint group {group!r} belongs to two limbs, {owners[group]!r} and {limb!r}"
        )
    owners[group] = limb


def _refuse_gaps(limbs: Mapping[str, Limb], owners: Owners, split: ActionSplit) -> None:
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

"""Who must reach what: targets, each with the arms of which some one or all are to reach it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from layouts.arrangement import Arrangement
from robot_layouts.core.bounds import shown
from robots import LayoutError, UnknownNameError

ANY, ALL = "any", "all"

ReachedBy = str | Mapping[str, str | Sequence[str]]


@dataclass(frozen=True)
class Demand:
    """One thing that is asked for: that one of some arms reaches a target.

    Attributes:
        target: Name of the target.
        numbers: Its place in the world (m), perhaps with the wxyz orientation of the TCP.
        arms: Full names of the arms of which one must reach it.
    """

    target: str
    numbers: tuple[float, ...]
    arms: tuple[str, ...]


def demands_of(
    targets: Mapping[str, tuple[float, ...]], reached_by: ReachedBy, robots: Arrangement
) -> tuple[Demand, ...]:
    """Return what is asked for; see `layouts.search`.

    Raises:
        LayoutError: If ``reached_by`` makes no sense.
        UnknownNameError: If it names no target, robot or limb.
    """
    if isinstance(reached_by, Mapping):
        for name in reached_by:
            if name not in targets:
                raise UnknownNameError("target", name, targets)
        own: Mapping[str, object] = reached_by
    else:
        own = dict.fromkeys(targets, reached_by)
    return tuple(
        Demand(name, numbers, arms)
        for name, numbers in targets.items()
        for arms in _arms(own.get(name, ANY), robots)
    )


def _arms(who: object, robots: Arrangement) -> list[tuple[str, ...]]:
    """Return for each arm that is asked for, or any, the arms that can stand for it."""
    if who == ANY:
        return [tuple(robots.arms)]
    if who == ALL:
        return [(arm,) for arm in robots.arms]
    names = [who] if isinstance(who, str) else who
    if not (isinstance(names, Sequence) and names and all(isinstance(n, str) for n in names)):
        raise LayoutError(
            f"reached_by is {shown(who)}; it takes 'any', 'all', the name of a robot or limb, or"
            " several names"
        )
    return [_stands_for(str(name), robots) for name in names]


def _stands_for(name: str, robots: Arrangement) -> tuple[str, ...]:
    choices = list(dict.fromkeys([*robots, *robots.arms, *robots.short_names, ANY, ALL]))
    if name not in choices:
        raise UnknownNameError("robot that is to reach a target", name, choices)
    full = robots.arm_name(name)
    return (
        (full,) if full in robots.arms else tuple(a for a in robots.arms if robots.owner(a) == full)
    )

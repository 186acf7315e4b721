"""Which robots of a layout have a place in a task, and what the others do."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

from layouts import Layout
from robots import RobotDescriptor, TaskError
from tasks.language.needs import ACT, HOLD, Needs

BYSTANDERS = (None, HOLD, ACT)
EVERY_PLACE = "*"  # key of a task's needs


def check_places(
    task: str,
    layout: Layout,
    places: Collection[str],
    robot_counts: range | None,
    bystanders: str | None = None,
) -> None:
    """Refuse a layout whose places are not the task's; their order is the layout's own.

    A limb takes the place that it is called like.

    Args:
        task: The task's name.
        layout: The layout.
        places: The task's places: those of its own layout.
        robot_counts: How many robots it may have, under any names; None for exactly ``places``.
        bystanders: What robots without a place do; None if there must be none.

    Raises:
        TaskError: If the places are wrong.
    """
    if robot_counts is not None:
        if len(layout.arms) not in robot_counts:
            raise TaskError(
                f"{task} takes {robot_counts[0]} to {robot_counts[-1]} robots;"
                f" the layout has {len(layout.arms)}: {list(layout.arms)}"
            )
        return
    missing = [place for place in places if place not in layout.places]
    others = [name for name in layout.places if name not in places]
    if missing or (others and bystanders is None):
        more = "Give the layout's robots the names of the places"
        if not missing:
            more = (
                f"bystanders={HOLD!r} lets {others} stand there and hold still,"
                f" bystanders={ACT!r} take action numbers"
            )
        raise TaskError(
            f"{task} has the places {list(places)}; the layout has {list(layout.places)}. {more}"
        )


def check_needs(
    task: str, layout: Layout, places: Collection[str], needs: Mapping[str, Needs]
) -> None:
    """Refuse robots that lack what their places need.

    Args:
        task: The task's name.
        layout: Its robots.
        places: The task's places.
        needs: By place; ``*`` for every place that is not named.

    Raises:
        TaskError: If one does, or the task names a place that it has not.
    """
    for place in needs:
        if place not in (*places, EVERY_PLACE):
            raise TaskError(f"{task}.needs names {place!r}; the places are {list(places)}")
    lacking = [
        f"{place!r} needs {what}: it is a {layout.arm(place).robot.name}"
        for place in layout.places
        if (need := needs.get(place, needs.get(EVERY_PLACE) if place in places else None))
        for what in need.missing(layout.arm(place).robot)
    ]
    if lacking:
        raise TaskError(f"{task}, place {'; place '.join(lacking)}")


def settled(
    layout: Layout, places: Collection[str], robot_counts: range | None, bystanders: str | None
) -> Layout:
    """Return a layout in which the robots and limbs without a place hold still, if they are to."""
    if robot_counts is not None or bystanders != HOLD:
        return layout
    still = [arm for place, arm in layout.places.items() if place not in places]
    others = {layout.owner(arm): _holding(layout, arm, still) for arm in still}
    return layout.replace_robots(**others) if others else layout


def _holding(layout: Layout, arm: str, still: Sequence[str]) -> RobotDescriptor:
    """Return the robot of an arm with all those arms of it that hold still."""
    name = layout.owner(arm)
    robot, limbs = layout[name].robot, dict(layout[name].robot.limbs)
    for limb in layout[name].robot.limbs:
        if f"{name}.{limb}" in still:
            del limbs[limb]
    moving = [group for limb in limbs for group in robot.parts[limb].action_split.groups]
    others = [group for group in robot.action_split.groups if group not in moving]
    declared = robot.declared_split and robot.declared_split.held(*others)
    split = robot.action_split.held(*others)
    return replace(robot, action_split=split, declared_split=declared, limbs=limbs)

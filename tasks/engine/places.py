"""Which layouts a task takes: its places are filled with what they need, and nothing collides."""

from __future__ import annotations

import warnings
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any

from layouts import Layout
from layouts.standing import held_widths, needed_reaches
from robot_layouts.simulation import Camera
from robots import LayoutError, MissingPackageError, RobotDescriptor, TaskError
from tasks.engine.scenario import Scenario
from tasks.engine.task import Task
from tasks.language.fitting import Fit, fit_to
from tasks.language.needs import ACT, HOLD, Needs

EVERY_PLACE = "*"  # key of a task's needs
Rectangle = tuple[float, float, float, float]


def built_layout(task_class: type[Task], scenario: Scenario) -> Layout:
    """Return the layout that environments of a scenario are built with, in its control mode.

    Raises:
        TaskError: If its places are not the task's, or a robot lacks what its place needs.
        DescriptorError: If a robot lacks the joint limits that the control mode needs.
    """
    name, given, places = task_class.__name__, scenario.layout, task_class.layout.places
    counts, needs = task_class.robot_counts, task_class.needs
    check_places(name, given, places, counts, scenario.bystanders)
    if task_class.fits():
        needs = {place: replace(need, opening=None, reach=None) for place, need in needs.items()}
    check_needs(name, given, given.places if counts else places, needs)
    still = _settled(given, places, counts, scenario.bystanders)
    return still.in_control_mode(scenario.control_mode)


def fitted(task_class: type[Task], layout: Layout) -> dict[str, Any]:
    """Return what differs in a task that fits other robots than its own, by attribute.

    Its fit, from where it is seen, and a table also where it is declared to work; nothing for its
    own robots.

    Raises:
        TaskError: If no place is in reach of both arms.
    """
    own = task_class.layout
    held, needed = (of(task_class, own.places) for of in (held_widths, needed_reaches))
    fit = fit_to(layout, own, held, needed, task_class.table.outline(layout))
    bases = [fit.place(own.arm(place).base_position)[:2] for place in own.places]
    table = task_class.table.under(layout, bases)
    bodies = {"table": table, "bodies": {**task_class.bodies, "table": table}}
    if fit.as_declared:
        return bodies if table != task_class.table else {}
    eye, target = map(fit.place, task_class.viewpoint)
    cameras = tuple(_fitted(camera, fit) for camera in task_class.cameras)
    return {"fit": fit, "viewpoint": (eye, target), "cameras": cameras, **bodies}


def _fitted(camera: Camera, fit: Fit) -> Camera:
    """Return a camera that sees the same of what is larger; as it is, if it rides on a link."""
    if camera.mount is not None:
        return camera
    target = None if camera.target is None else fit.place(camera.target)
    turned = None if camera.quaternion is None else fit.turned(camera.quaternion)
    return replace(camera, eye=fit.place(camera.eye), target=target, quaternion=turned)


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


def _settled(
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


def refuse_collisions(layout: Layout, table: Rectangle | None = None) -> None:
    """Refuse a layout whose robots collide with each other, themselves or a table.

    Looks at their keyframes and at some draws of joint noise. The verdict on a layout is
    remembered. Where python-fcl is not installed it cannot look, and warns instead.

    Args:
        layout: The layout; the tables among its frames count.
        table: Outline of the task's own table, whose top is at z = 0: x_min, y_min, x_max, y_max
            (m); None if it has none.

    Raises:
        LayoutError: If robots collide; names the links, and says what to change.
        AssetError: If robot files cannot be found.
    """
    try:
        collisions = _collisions(layout, table)
    except MissingPackageError as error:
        warnings.warn(
            f"the layout is built unchecked: {error} (or say so, with check_layout=False)",
            stacklevel=2,
        )
        return
    if collisions:
        raise LayoutError(
            f"the robots of this layout collide:\n{collisions}\n"
            "check_layout=False builds it all the same; layout.validate() gives the details"
        )


def is_tested(cls: type[Task], layout: Layout) -> bool:
    """Tell whether a layout is the own one of a task of this library, which its tests check."""
    return cls.__module__.startswith("tasks.") and layout == cls.layout


@lru_cache(maxsize=256)
def _collisions(layout: Layout, table: Rectangle | None) -> str:
    findings = layout.validate(workspaces=False, table=table).findings
    kinds = ("collision", "self-collision", "table")
    return "\n".join(str(found) for found in findings if found.serious and found.kind in kinds)

"""``robot-layouts new task NAME --robots left=panda right=ur5``: a task of one's own.

Writes one file with a task to go on with and its expert, and one with their tests.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from keyword import iskeyword
from math import cos, pi, sin
from pathlib import Path
from string import Template
from typing import NamedTuple

import numpy as np

from layouts import Layout, face_to_face, ring, single
from robot_layouts.core.cli import Folder, by_name
from robot_layouts.core.commands import notice
from robot_layouts.core.paths import absolute
from robot_layouts.core.writing import check_module_name, write_new
from robot_layouts.kinematics.rotations import rotate
from robots import RobotDescriptor, TaskError
from robots.named import is_path, named_robot
from robots.urdf.reading import read_model
from robots.urdf.summary import read_urdf
from robots.urdf.tcp import find_tcp
from robots.urdf.tree import kinematic_tree
from tasks.cell_options import PlacedRobot
from tasks.registry import TASKS

RADIUS = 0.03  # of a goal (m)
# Shares of a robot's reach: how far a goal may be from its middle to each side, and how far that
# middle is from where the TCP begins, besides the radius: no goal holds it from the start.
SPREAD, ASIDE = 0.05, 0.1

TEMPLATES = Path(__file__).with_name("templates")


def new_task(
    name: str,
    *,
    robots: Sequence[PlacedRobot],
    out: Folder = Path(),
) -> None:
    """Write the file of a new task and its expert, and a test.

    Args:
        name: Name of the task, such as TwoArmTray.
        robots: Robot of each place, as in left=panda right=arm.urdf.
        out: Folder of the files.

    Raises:
        RobotLayoutsError: If an argument is invalid, or a file is there already.
    """
    module, task_id = _names(name)
    texts = {
        f"{module}.py": task_source(task_id, _robots(robots), out),
        f"test_{module}.py": _filled("test_task", module=module, task_id=task_id),
    }
    for path in write_new(out, texts):
        print(path)
    notice(
        f"Try it: python -m pytest {out / f'test_{module}.py'}\n"
        f"In {out.absolute()}: robot-layouts record --task {module}:{task_id}"
        " --episodes 10 --out data"
    )


def task_source(task_id: str, robots: Mapping[str, str], folder: Path) -> str:
    """Return the file of a task in which robots reach for balls, and its expert.

    Args:
        task_id: Its id.
        robots: Robot by place: names, paths of URDFs or MJCFs, or ``MODULE:NAME``.
        folder: Where it will be; paths are written relative to it.

    Raises:
        UnknownNameError: If there is no such robot.
        AssetError: If a URDF is unusable.
        LayoutError: If a place has no name for one.
    """
    preset = _preset(len(robots))
    written = {place: _written(robot, folder) for place, robot in robots.items()}
    named = ", ".join(f'"{place}": {robot}' for place, robot in written.items())
    loaded = {place: named_robot(robot) for place, robot in robots.items()}
    layout = preset.place(loaded)
    wide = len(robots) > 2
    words = ["Area", "Goal", "MultiRobotTask", *(["WideTable"] if wide else []), "closeness"]
    paths = any(is_path(robot) for robot in robots.values())
    imports = [
        f"from layouts import {preset.name}",
        f"from tasks import {', '.join([*words, 'register_task'])}",
    ]
    return _filled(
        "task",
        paths="from pathlib import Path\n\n" if paths else "",
        title=task_id.rpartition("-")[0],
        radius=RADIUS,
        task_id=task_id,
        imports="\n".join(imports),
        layout=f"{preset.name}({{{named}}}{preset.options})",
        table="    table = WideTable()\n" if wide else "",
        goals="\n".join(_goal(place, layout) for place in layout.places),
    )


def _filled(template: str, **words: object) -> str:
    """Return the text of a template of this folder, with words in it."""
    return Template((TEMPLATES / f"{template}.py.txt").read_text("utf-8")).substitute(words)


def _goal(place: str, layout: Layout) -> str:
    low, high = _area(layout, place)
    ranges = (f"{axis}=({a:g}, {b:g})" for axis, a, b in zip("xyz", low, high, strict=True))
    return f"    goal_{place} = Goal(RADIUS, spawn=Area({', '.join(ranges)}))"


def _area(layout: Layout, place: str) -> tuple[list[float], list[float]]:
    """Return the corners of where an arm's goal may be (m, world): left of its TCP at the start."""
    arm, placement = layout.arm(place).robot, layout[layout.owner(place)]
    robot = placement.robot
    urdf = robot.urdf.locate()
    model = read_model(read_urdf(urdf), urdf.name)
    others = [joint.name for joint in model.moving if joint.name not in robot.joints]
    tree = kinematic_tree(model, [*robot.joints, *others])
    qpos = np.zeros((1, len(tree.coordinates)))
    qpos[0, : robot.dof] = placement.start_qpos
    tcp = find_tcp(arm, tree).places(tree.forward(qpos))[0]
    ahead = rotate(np.array(placement.base_quaternion), tcp)
    left = np.arctan2(ahead[1], ahead[0]) + pi / 2  # where any arm gets by turning
    aside, spread = RADIUS + ASIDE * arm.reach, SPREAD * arm.reach
    middle = placement.base_position + ahead
    middle = middle + [aside * cos(left), aside * sin(left), spread]
    return (middle - spread).round(3).tolist(), (middle + spread).round(3).tolist()


class _Preset(NamedTuple):
    """How robots are placed: the preset's name, its options as they are written, and itself."""

    name: str
    options: str
    place: Callable[[Mapping[str, RobotDescriptor]], Layout]


def _preset(count: int) -> _Preset:
    """Return the usual way to place so many robots."""
    if count == 1:
        return _Preset("single", "", single)
    if count == 2:
        by_reach = partial(face_to_face, spacing="auto", keyframe=None)
        return _Preset("face_to_face", ', spacing="auto", keyframe=None', by_reach)
    by_reach = partial(ring, radius="auto", keyframe=None)
    return _Preset("ring", ', radius="auto", keyframe=None', by_reach)


def _written(robot: str, folder: Path) -> str:
    """Return a robot as it is written in a task's file, which will be in a folder."""
    if not is_path(robot):
        return f'"{robot}"'
    path = Path(os.path.relpath(absolute(robot, "the path of a robot"), folder.absolute()))
    return f"Path(__file__).parent / {json.dumps(path.as_posix(), ensure_ascii=False)}"


def _robots(words: Sequence[str]) -> dict[str, str]:
    robots = by_name(words, "PLACE=ROBOT", "left=panda", TaskError, "the place")
    if wrong := [place for place in robots if not place.isidentifier()]:
        raise TaskError(f"the place {wrong[0]!r} should be a name as in Python, such as left")
    return robots


def _names(name: str) -> tuple[str, str]:
    """Return the module and the id of a task that is called ``TwoArmTray`` or ``two_arm_tray``.

    Raises:
        TaskError: If there can be no such task, or its file could not be imported beside others.
    """
    word, _, version = name.partition("-v")
    title = "".join(part[:1].upper() + part[1:] for part in word.split("_"))
    if not title.isidentifier() or not title.isascii() or not (version or "1").isdigit():
        raise TaskError(
            f"{name!r} cannot be the name of a task: it is made of letters and digits and begins"
            " with a letter, as TwoArmTray and TwoArmTray-v2 do"
        )
    module, task_id = (
        re.sub("(?<=[a-z0-9])(?=[A-Z])", "_", title).lower(),
        f"{title}-v{version or 1}",
    )
    if iskeyword(title):
        raise TaskError(f"{title!r} is a keyword of Python; choose another name, such as My{title}")
    if task_id in TASKS:
        raise TaskError(
            f"there is a task {task_id} already; choose another name, such as My{task_id}"
        )
    check_module_name(module, f"My{title}", TaskError)
    return module, task_id

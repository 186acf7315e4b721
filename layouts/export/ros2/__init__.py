"""A layout as a ROS 2 package: description, MoveIt's configuration, controllers, launch file."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree.ElementTree import Element, indent, tostring

from layouts.export.cell import ExportedCell
from layouts.export.files import LICENCES, licence_note, replaced_folder, short_licences
from layouts.export.ros2.description import description, speed_of
from layouts.export.ros2.groups import PlanningGroups, RosNames
from robot_layouts.core.pages import fragment
from robots import LayoutError
from robots.bodies.allowed import joined_pairs, rigid_groups, rigid_pairs

if TYPE_CHECKING:
    from layouts.arrangement import Arrangement

CONFIGS = (
    "joint_limits",
    "kinematics",
    "moveit_controllers",
    "ompl_planning",
    "ros2_controllers",
)
ENTRIES = ("CMakeLists.txt", LICENCES, "config", "launch", "meshes", "package.xml", "urdf")


def write_ros2(
    layout: Arrangement, folder: str | os.PathLike[str], *, visuals: bool = True
) -> Path:
    """Write a layout as a ROS 2 package; see `layouts.Layout.to_ros2`."""
    target = Path(folder)
    package = target.absolute().name
    if not re.fullmatch(r"[a-z](_?[a-z0-9])+", package):
        raise LayoutError(
            f"a ROS 2 package cannot be called {package!r}; its folder's name takes two or more"
            f" small letters, digits and single _, and begins with a letter: {_proper(package)!r}"
        )
    cell = ExportedCell.read(layout, visuals=visuals)
    with replaced_folder(target, _is_own, "save the package under another name") as made:
        for name in ("config", "launch", "meshes", "urdf"):
            (made / name).mkdir()
        _write(made, cell, package, visuals=visuals)
    return target


def _is_own(found: Path) -> bool:
    return found.name in ENTRIES


def _proper(package: str) -> str:
    """Return the valid package name that is closest to an invalid one."""
    plain = re.sub(r"[^a-z0-9]+", "_", package.lower()).strip("_")
    return plain if re.fullmatch(r"[a-z](_?[a-z0-9])+", plain) else f"cell_{plain}".strip("_")


def _write(folder: Path, cell: ExportedCell, package: str, *, visuals: bool) -> None:
    names = RosNames(cell)
    groups = PlanningGroups(cell, names)
    robots = [source.robot for source in cell.sources]
    meshes = folder / "meshes"
    content = {
        "package": package,
        "licences": LICENCES,
        "licence_names": short_licences(robots),
        "names": names,
        "groups": groups,
        "robots": cell.robots,
        "speeds": dict(_speeds(cell, names)),
        "disabled": [*_allowed_pairs(cell, names), *_pairs_on_tables(cell, names)],
    }
    texts = {
        f"urdf/{package}.urdf": _xml(description(cell, names, package, meshes, visuals=visuals)),
        f"urdf/{package}.urdf.xacro": _filled("cell.urdf.xacro", content),
        f"config/{package}.srdf": _filled("cell.srdf", content),
        **{f"config/{name}.yaml": _filled(f"{name}.yaml", content) for name in CONFIGS},
        "launch/demo.launch.py": _filled("demo.launch.py", content),
        "package.xml": _filled("package.xml", content),
        "CMakeLists.txt": _filled("CMakeLists.txt", content),
        LICENCES: licence_note(robots),
    }
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")


def _allowed_pairs(cell: ExportedCell, names: RosNames) -> Iterator[tuple[str, str, str]]:
    """Yield the pairs of links that `Layout.validate` lets overlap within a robot, and why.

    They are those that a joint joins (``Adjacent``), those that never move against each other
    (``Never``), and the rest of the robot's ``allowed_collisions`` (``Default``).
    """
    for place, standing in cell.robots.items():
        model = standing.source.model
        joined, rigid = joined_pairs(model), rigid_pairs(model)
        for one, other in sorted(sorted(pair) for pair in standing.source.allowed):
            pair = frozenset((one, other))
            reason = "Adjacent" if pair in joined else "Never" if pair in rigid else "Default"
            yield names.link(place, one), names.link(place, other), reason


def _pairs_on_tables(cell: ExportedCell, names: RosNames) -> Iterator[tuple[str, str, str]]:
    """Yield tables and the links that stand still on them."""
    for table, (place, standing) in product(cell.tables, cell.robots.items()):
        model = standing.source.model
        for link in rigid_groups(model)[model.root]:
            if link in model.collisions:
                yield names.frames[table], names.link(place, link), "Never"


def _speeds(cell: ExportedCell, names: RosNames) -> Iterator[tuple[str, float]]:
    """Yield the largest speed of each joint that follows none, by its name (rad/s, m/s)."""
    for place, standing in cell.robots.items():
        joints = {joint.name: joint for joint in standing.source.model.moving}
        for joint in standing.source.leaders:
            yield names.joint(place, joint), float(speed_of(joints[joint]))


def _filled(template: str, content: Mapping[str, object]) -> str:
    return f"{fragment(f'layouts.export.ros2/{template}.jinja', **content).rstrip()}\n"


def _xml(root: Element) -> str:
    indent(root)
    return f'<?xml version="1.0"?>\n{tostring(root, encoding="unicode")}\n'

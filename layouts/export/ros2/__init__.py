"""A layout as a ROS 2 package: description, MoveIt's configuration, controllers, launch file."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree.ElementTree import Element, indent, tostring

import yaml

from layouts.export.cell import ExportedCell
from layouts.export.folders import LICENCES, replaced_folder
from layouts.export.licences import licence_note, short_licences
from layouts.export.ros2.control import controllers, hardware, moveit_controllers
from layouts.export.ros2.description import description, wrapper
from layouts.export.ros2.groups import Groups
from layouts.export.ros2.moveit import joint_limits, kinematics, ompl_planning
from layouts.export.ros2.names import RosNames
from layouts.export.ros2.package import cmake_lists, launch_file, manifest
from layouts.export.ros2.semantics import semantics
from robots import LayoutError

if TYPE_CHECKING:
    from layouts.arrangement import Arrangement

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
    """Return a name like one that is none."""
    plain = re.sub(r"[^a-z0-9]+", "_", package.lower()).strip("_")
    return plain if re.fullmatch(r"[a-z](_?[a-z0-9])+", plain) else f"cell_{plain}".strip("_")


def _write(folder: Path, cell: ExportedCell, package: str, *, visuals: bool) -> None:
    names = RosNames(cell)
    groups = Groups(cell, names)
    robots = [source.robot for source in cell.sources]
    meshes = folder / "meshes"
    texts = {
        f"urdf/{package}.urdf": _xml(description(cell, names, package, meshes, visuals=visuals)),
        f"urdf/{package}.urdf.xacro": _xml(wrapper(package, hardware(cell, names))),
        f"config/{package}.srdf": _xml(semantics(cell, names, groups, package)),
        "config/joint_limits.yaml": _yaml(joint_limits(cell, names)),
        "config/kinematics.yaml": _yaml(kinematics(groups)),
        "config/ompl_planning.yaml": _yaml(ompl_planning(groups)),
        "config/ros2_controllers.yaml": _yaml(controllers(groups)),
        "config/moveit_controllers.yaml": _yaml(moveit_controllers(groups)),
        "launch/demo.launch.py": launch_file(package, groups.controllers),
        "package.xml": _xml(manifest(package, short_licences(robots))),
        "CMakeLists.txt": cmake_lists(package),
        LICENCES: licence_note(robots),
    }
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")


def _xml(root: Element) -> str:
    indent(root)
    return f'<?xml version="1.0"?>\n{tostring(root, encoding="unicode")}\n'


def _yaml(value: dict[str, object]) -> str:
    return yaml.safe_dump(value, sort_keys=False, default_flow_style=False)

"""A layout for Drake: model directives, and each robot's URDF with meshes that Drake can read."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree.ElementTree import Element, ElementTree, SubElement, indent

import yaml

from layouts.export.cell import ExportedCell, RobotSource, Standing
from layouts.export.files import expect_ending, replaced_folder
from layouts.export.meshes import MeshFolder, drawn_meshes
from layouts.export.urdf import COPIED
from layouts.visuals import load_meshes
from robot_layouts.core.writing import write_whole
from robot_layouts.kinematics.quaternions import quaternion_rpy
from robots.urdf.paths import resolve

if TYPE_CHECKING:
    from layouts.arrangement import Arrangement

ENDING = ".dmd.yaml"  # by which Drake's parser knows directives
WORLD = "world"  # as Drake calls what everything stands in


def write_drake(layout: Arrangement, path: str | os.PathLike[str], *, visuals: bool = True) -> Path:
    """Write a layout as Drake's model directives; see `layouts.Layout.to_drake`."""
    target = expect_ending(path, "model directives", ENDING)
    cell = ExportedCell.read(layout, visuals=visuals)
    folder = target.absolute().with_name(target.name[: -len(ENDING)] + "_robots")
    with replaced_folder(folder, _is_own, "save the directives under another name") as made:
        bases = {
            source.name: _write_model(source, made / source.name, visuals=visuals)
            for source in cell.sources
        }
        directives = [
            directive
            for standing in cell.robots.values()
            for name in [standing.source.name]
            for directive in _directives(standing, folder / name / f"{name}.urdf", bases[name])
        ]
        text = yaml.dump({"directives": directives}, Dumper=_Dumper, sort_keys=False)
        write_whole(target, text)
    return target


def _is_own(found: Path) -> bool:
    return (found / f"{found.name}.urdf").exists()


class _Rpy(dict[str, Any]):
    """What Drake calls ``!Rpy``: a rotation by roll, pitch and yaw."""


class _Dumper(yaml.SafeDumper):
    """Writes `_Rpy` with its tag."""


_Dumper.add_representer(_Rpy, lambda dumper, rotation: dumper.represent_mapping("!Rpy", rotation))


def _directives(standing: Standing, urdf: Path, base: str) -> Iterator[dict[str, Any]]:
    placement = standing.placement
    start = zip(placement.robot.joints, placement.start_qpos, strict=True)
    yield {
        "add_model": {
            "name": standing.place,
            "file": urdf.as_uri(),
            "default_joint_positions": {joint: [float(value)] for joint, value in start},
        }
    }
    turn = [math.degrees(angle) for angle in quaternion_rpy(placement.base_quaternion)]
    yield {
        "add_weld": {
            "parent": WORLD,
            "child": f"{standing.place}::{base}",
            "X_PC": {
                "translation": list(placement.base_position),
                "rotation": _Rpy(deg=turn),
            },
        }
    }


def _write_model(source: RobotSource, folder: Path, *, visuals: bool) -> str:
    """Write a URDF whose meshes are Wavefront files beside it, and return its root link's name."""
    files = MeshFolder(folder, ".obj")
    drawn = drawn_meshes(source, visuals=visuals)
    robot = Element("robot", source.root.attrib)
    for element in source.root:
        if element.tag not in COPIED:
            continue
        if element.tag == "link":
            name = element.get("name", "")
            for visual in element.findall("visual"):
                element.remove(visual)
            for number, mesh in enumerate(drawn.get(name, ())):
                visual = SubElement(element, "visual", name=f"{name}_visual_{number}")
                file = files.save(mesh.mesh, f"{name}_visual_{number}")
                SubElement(SubElement(visual, "geometry"), "mesh", filename=file)
                material = SubElement(visual, "material", name=f"{name}_visual_{number}")
                SubElement(material, "color", rgba=" ".join(f"{x:.4g}" for x in mesh.rgba))
            _convert_collisions(element, source.urdf, files)
        robot.append(element)
    root = _rename_world(robot, source.model.root)
    indent(robot)
    ElementTree(robot).write(folder / f"{source.name}.urdf", encoding="utf-8", xml_declaration=True)
    return root


def _rename_world(robot: Element, root: str) -> str:
    """Rename a link that is called as Drake's world; Drake would take it for that.

    Args:
        robot: The ``<robot>``.
        root: Name of its root link.

    Returns:
        The name of its root link from now on.
    """
    names = {link.get("name", "") for link in robot.iterfind("link")}
    if WORLD not in names:
        return root
    new = next(name for i in count(1) if (name := f"{WORLD}_link{i if i > 1 else ''}") not in names)
    ends = [*robot.iterfind("joint/parent"), *robot.iterfind("joint/child")]
    for element, key in (*((e, "link") for e in ends), *((e, "name") for e in robot.iter("link"))):
        if element.get(key) == WORLD:
            element.set(key, new)
    return new if root == WORLD else root


def _convert_collisions(link: Element, urdf: Path, files: MeshFolder) -> None:
    import trimesh

    where = f"{urdf}, link {link.get('name')!r}"
    for number, mesh in enumerate(link.iterfind("collision/geometry/mesh")):
        path = resolve(mesh.get("filename", ""), urdf.as_posix(), os.path.isfile)
        whole = trimesh.util.concatenate(load_meshes(path, where, urdf.as_posix()))
        name = f"{link.get('name', '')}_collision_{number}"
        mesh.set("filename", files.save(whole, name))

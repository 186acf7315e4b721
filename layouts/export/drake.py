"""A layout for Drake: model directives, and each robot's URDF with meshes that Drake can read."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping, Sequence
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree.ElementTree import Element, ElementTree, SubElement, indent

import yaml

from layouts.export.files import Names, replaced_folder
from layouts.export.urdf import COPIED, base_link
from layouts.visuals import Visual, load_meshes, read_visuals, require_trimesh, simplified
from robot_layouts.core.writing import write_whole
from robot_layouts.kinematics.quaternions import quaternion_rpy
from robots import LayoutError, RobotDescriptor
from robots.urdf.paths import resolve
from robots.urdf.summary import parse_urdf, read_urdf

if TYPE_CHECKING:
    from layouts.arrangement import Arrangement
    from layouts.placement import Placement

ENDING = ".dmd.yaml"  # by which Drake's parser knows directives
WORLD = "world"  # as Drake calls what everything stands in


def write_drake(layout: Arrangement, path: str | os.PathLike[str], *, visuals: bool = True) -> Path:
    """Write a layout as Drake's model directives; see `layouts.Layout.to_drake`."""
    target = Path(path)
    if not target.name.endswith(ENDING):
        raise LayoutError(
            f"cannot save model directives as {target.name!r}; the name must end in {ENDING}"
        )
    require_trimesh("meshes that Drake can read")
    folder = target.absolute().with_name(target.name.removesuffix(ENDING) + "_robots")
    with replaced_folder(folder, _is_own, "save the directives under another name") as made:
        files = _write_models([placement.robot for placement in layout.values()], made, visuals)
        directives = [
            directive
            for place, placement in layout.items()
            for file in [files[placement.robot]]
            for directive in _directives(place, placement, folder / file, base_link(made / file))
        ]
        text = yaml.dump({"directives": directives}, Dumper=_Dumper, sort_keys=False)
        write_whole(target, text)
    return target


class _Rpy(dict[str, Any]):
    """What Drake calls ``!Rpy``: a rotation by roll, pitch and yaw."""


class _Dumper(yaml.SafeDumper):
    """Writes `_Rpy` with its tag."""


_Dumper.add_representer(_Rpy, lambda dumper, rotation: dumper.represent_mapping("!Rpy", rotation))


def _directives(
    place: str, placement: Placement, urdf: Path, base: str
) -> Iterator[dict[str, Any]]:
    robot = placement.robot
    start = zip(robot.joints, placement.start_qpos, strict=True)
    yield {
        "add_model": {
            "name": place,
            "file": urdf.as_uri(),
            "default_joint_positions": {joint: [float(value)] for joint, value in start},
        }
    }
    turn = [math.degrees(angle) for angle in quaternion_rpy(placement.base_quaternion)]
    yield {
        "add_weld": {
            "parent": "world",
            "child": f"{place}::{base}",
            "X_PC": {
                "translation": list(placement.base_position),
                "rotation": _Rpy(deg=turn),
            },
        }
    }


def _write_models(
    robots: Sequence[RobotDescriptor], folder: Path, visuals: bool
) -> dict[RobotDescriptor, Path]:
    """Write each robot once into a folder, and return where in it the URDFs are."""
    given = Names()
    files: dict[RobotDescriptor, Path] = {}
    for robot in dict.fromkeys(robots):
        name = given.new(robot.name)
        urdf = robot.urdf.locate(pictures=visuals)
        drawn = read_visuals(urdf) if visuals else {}
        _write_model(urdf, drawn, folder / name, f"{name}.urdf")
        files[robot] = Path(name, f"{name}.urdf")
    return files


def _is_own(found: Path) -> bool:
    return (found / f"{found.name}.urdf").exists()


def _write_model(
    urdf: Path, visuals: Mapping[str, tuple[Visual, ...]], folder: Path, name: str
) -> None:
    """Write a URDF whose meshes are Wavefront files beside it."""
    folder.mkdir(parents=True)
    files = Names()
    source = parse_urdf(read_urdf(urdf), str(urdf))
    robot = Element("robot", source.attrib)
    for element in source:
        if element.tag not in COPIED:
            continue
        if element.tag == "link":
            link = element.get("name", "")
            for visual in element.findall("visual"):
                element.remove(visual)
            element.extend(_visuals(visuals.get(link, ()), link, folder, files))
            _convert_collisions(element, urdf, folder, files)
        robot.append(element)
    _rename_world(robot)
    indent(robot)
    ElementTree(robot).write(folder / name, encoding="utf-8", xml_declaration=True)


def _rename_world(robot: Element) -> None:
    """Rename a link that is called as Drake's world; Drake would take it for that."""
    names = {link.get("name", "") for link in robot.iterfind("link")}
    if WORLD not in names:
        return
    new = next(name for i in count(1) if (name := f"{WORLD}_link{i if i > 1 else ''}") not in names)
    ends = [*robot.iterfind("joint/parent"), *robot.iterfind("joint/child")]
    for element, key in (*((e, "link") for e in ends), *((e, "name") for e in robot.iter("link"))):
        if element.get(key) == WORLD:
            element.set(key, new)


def _visuals(parts: Sequence[Visual], link: str, folder: Path, files: Names) -> Iterator[Element]:
    for number, part in enumerate(parts):
        name = f"{link}_visual_{number}"
        visual = Element("visual", name=name)
        file = _saved(simplified(part).mesh, folder, files.new(name))
        SubElement(SubElement(visual, "geometry"), "mesh", filename=file)
        material = SubElement(visual, "material", name=name)
        SubElement(material, "color", rgba=" ".join(f"{x:.4g}" for x in part.rgba))
        yield visual


def _convert_collisions(link: Element, urdf: Path, folder: Path, files: Names) -> None:
    import trimesh

    where = f"{urdf}, link {link.get('name')!r}"
    for number, mesh in enumerate(link.iterfind("collision/geometry/mesh")):
        path = resolve(mesh.get("filename", ""), urdf.as_posix(), os.path.isfile)
        whole = trimesh.util.concatenate(load_meshes(path, where, urdf.as_posix()))
        name = files.new(f"{link.get('name', '')}_collision_{number}")
        mesh.set("filename", _saved(whole, folder, name))


def _saved(mesh: Any, folder: Path, name: str) -> str:
    """Save a mesh as a Wavefront file, and return the file's name."""
    import trimesh

    bare = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    file = f"{name}.obj"
    bare.export(folder / file, include_normals=False, include_texture=False, include_color=False)
    return file

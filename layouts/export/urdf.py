"""A layout as one URDF, every robot fixed to a link ``world``; and as Drake's model directives."""

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
from layouts.visuals import load_meshes
from robot_layouts.core.writing import write_whole, written_whole
from robot_layouts.kinematics.quaternions import quaternion_rpy
from robots import RobotDescriptor
from robots.assets.assembled import rename
from robots.bodies.allowed import joined_pairs, read_allowed_pairs
from robots.urdf.paths import resolve
from robots.urdf.reading import model_of
from robots.urdf.summary import root_of, srdf_beside
from robots.urdf.text import joint_element, origin_at

if TYPE_CHECKING:
    from layouts.arrangement import Arrangement

WORLD = "world"  # also what Drake calls that in which everything stands
COPIED = ("material", "link", "joint")  # elements of a robot that are taken over


def write_urdf(
    layout: Arrangement,
    path: str | os.PathLike[str],
    *,
    relative: bool = False,
    visuals: bool = True,
) -> Path:
    """Write a layout as one URDF; see `layouts.Layout.to_urdf`."""
    target = expect_ending(path, "a URDF", ".urdf")
    folder = target.absolute().parent if relative else None
    urdf, semantics = Element("robot", name=target.stem), Element("robot", name=target.stem)
    SubElement(urdf, "link", name=WORLD)
    for place, placement in layout.items():
        file = placement.robot.urdf.locate(pictures=visuals)
        root = f"{place}/{model_of(file).root}"
        origin = origin_at(placement.base_position, placement.base_quaternion)
        urdf.append(joint_element(f"{place}/base", "fixed", WORLD, root, origin))
        urdf.extend(_renamed(file, place, folder, visuals=visuals))
        semantics.extend(_disabled_pairs(placement.robot, file, place))
    _write(urdf, target)
    beside = target.with_suffix(".srdf")
    if len(semantics):
        _write(semantics, beside)
    else:
        beside.unlink(missing_ok=True)
    return target


def _renamed(file: Path, place: str, folder: Path | None, *, visuals: bool) -> Iterator[Element]:
    """Yield the elements of a robot with names behind its place, and files by their paths."""
    for element in root_of(file):
        if element.tag not in COPIED:
            continue
        for visual in [] if visuals else element.findall("visual"):
            element.remove(visual)
        rename(element, lambda name: f"{place}/{name}", lambda name: _file(name, file, folder))
        yield element


def _file(reference: str, urdf: Path, folder: Path | None) -> str:
    path = resolve(reference, urdf.as_posix(), os.path.isfile)
    path = os.path.abspath(path)
    return path if folder is None else Path(os.path.relpath(path, folder)).as_posix()


def _disabled_pairs(robot: RobotDescriptor, file: Path, place: str) -> Iterator[Element]:
    """Yield the pairs of links that a robot may overlap with itself in, renamed.

    They are those that its descriptor allows, or else those of the SRDF beside its URDF.
    """
    pairs: list[Element] = []
    if robot.allowed_collisions is not None:
        model = model_of(file)
        apart = read_allowed_pairs(robot, model, file) - joined_pairs(model)
        for one, other in sorted(sorted(p) for p in apart if p <= model.collisions.keys()):
            pairs.append(Element("disable_collisions", link1=one, link2=other, reason="Default"))
    elif (srdf := srdf_beside(file)) is not None:
        pairs.extend(root_of(srdf).iterfind("disable_collisions"))
    for pair in pairs:
        for key in ("link1", "link2"):
            pair.set(key, f"{place}/{pair.get(key)}")
        yield pair


def _write(root: Element, target: Path) -> None:
    indent(root)
    with written_whole(target) as unfinished:
        ElementTree(root).write(unfinished, encoding="utf-8", xml_declaration=True)


ENDING = ".dmd.yaml"  # by which Drake's parser knows directives


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

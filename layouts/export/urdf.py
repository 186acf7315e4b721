"""A layout as one URDF: every robot fixed to a link ``world``, its names behind its place."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree.ElementTree import Element, ElementTree, SubElement, indent

from layouts.export.files import expect_ending
from robot_layouts.core.writing import written_whole
from robots import RobotDescriptor
from robots.assets.assembled import rename
from robots.bodies.allowed import joined_pairs, read_allowed_pairs
from robots.urdf.paths import resolve
from robots.urdf.reading import model_of
from robots.urdf.summary import root_of, srdf_beside
from robots.urdf.text import joint_element, origin_at

if TYPE_CHECKING:
    from layouts.arrangement import Arrangement

WORLD = "world"
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

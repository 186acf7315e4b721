"""A robot whose visual meshes nobody has, drawn as what collides of it."""

from __future__ import annotations

import shutil
from copy import deepcopy
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

from measurements.gallery.sources import files_of
from robots import RobotDescriptor
from robots.assets.locator import LocalUrdf
from robots.urdf.summary import parse_urdf, read_urdf


def seen_as_shapes(robot: RobotDescriptor, folder: Path) -> RobotDescriptor:
    """Return a robot that looks like its collision shapes.

    Args:
        robot: The robot.
        folder: Where copies of its files go.

    Raises:
        AssetError: If its files cannot be had.
    """
    source = robot.urdf.locate()
    package, urdf = files_of(robot)
    root = source.parents[len(Path(urdf).parents) - 1]
    for file in package.needed(urdf, pictures=False):
        (folder / file.path).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(root / file.path, folder / file.path)
    xml = parse_urdf(read_urdf(source), urdf)
    for link in xml.iterfind("link"):
        for visual in link.findall("visual"):
            link.remove(visual)
        for collision in link.findall("collision"):
            visual = deepcopy(collision)
            visual.tag = "visual"
            link.append(visual)
    (folder / urdf).write_bytes(ElementTree.tostring(xml))
    return replace(robot, urdf=LocalUrdf(folder / urdf))

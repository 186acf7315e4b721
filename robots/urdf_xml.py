"""What a URDF says of its joints, links and meshes, read from its XML alone."""

from __future__ import annotations

import math
import posixpath
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any
from xml.etree import ElementTree

from robots.errors import AssetError

Vector3 = tuple[float, float, float]

_XACRO = "www.ros.org/wiki/xacro"  # of the namespace {http://www.ros.org/wiki/xacro}


@dataclass(frozen=True)
class UrdfReferences:
    """Mesh files of a URDF, as paths with forward slashes, sorted.

    Attributes:
        collision: Meshes that physics needs.
        visual: Meshes and textures that only pictures need.
    """

    collision: tuple[str, ...]
    visual: tuple[str, ...]


@dataclass(frozen=True)
class UrdfJoint:
    """A joint that can move, as the URDF declares it.

    Attributes:
        name: Joint name.
        type: ``revolute``, ``continuous``, ``prismatic``, …
        lower: Lower limit (rad or m), or None if it has none.
        upper: Upper limit (rad or m), or None if it has none.
        effort: Largest effort (N·m or N), or None.
        velocity: Largest speed (rad/s or m/s), or None.
        mimics: Joint that it follows, or None.
    """

    name: str
    type: str
    lower: float | None
    upper: float | None
    effort: float | None
    velocity: float | None
    mimics: str | None

    @property
    def unit(self) -> str:
        """``m`` for a prismatic joint, else ``rad``."""
        return "m" if self.type == "prismatic" else "rad"


def read_joints(xml: bytes, urdf: str) -> tuple[UrdfJoint, ...]:
    """Return the joints that are not fixed, in the URDF's order.

    Raises:
        AssetError: If it is no URDF.
    """
    joints = parse_urdf(xml, urdf).iterfind("joint")
    return tuple(read_joint(joint, urdf) for joint in joints if joint.get("type") != "fixed")


def read_links(xml: bytes, urdf: str) -> tuple[str, ...]:
    """Return the names of all links, in the URDF's order.

    Raises:
        AssetError: If it is no URDF.
    """
    return tuple(link.get("name", "") for link in parse_urdf(xml, urdf).iterfind("link"))


def read_references(
    xml: bytes, urdf: str, exists: Callable[[str], bool] = lambda path: False
) -> UrdfReferences:
    """Return the files a URDF refers to, as paths in the same folder tree as ``urdf``.

    A reference is relative to the URDF's folder. ``package://name/rest`` is read as ``name/rest``
    below that folder, or as ``rest`` there, or as ``name/rest`` below a folder around it,
    whichever ``exists``.

    Args:
        xml: The URDF's contents.
        urdf: Its path, relative to the package or absolute.
        exists: Whether a path exists.

    Raises:
        AssetError: If it is no URDF.
    """
    root = parse_urdf(xml, urdf)
    folder = posixpath.dirname(urdf)
    found: dict[str, set[str]] = {"collision": set(), "visual": set()}
    for kind, paths in found.items():
        for element in (*root.iterfind(f".//{kind}//mesh"), *root.iterfind(f".//{kind}//texture")):
            paths.add(resolve(element.get("filename", ""), folder, exists))
    for texture in root.iterfind("./material/texture"):
        found["visual"].add(resolve(texture.get("filename", ""), folder, exists))
    return UrdfReferences(
        collision=tuple(sorted(found["collision"])),
        visual=tuple(sorted(found["visual"] - found["collision"])),
    )


def parse_urdf(xml: bytes, urdf: str) -> ElementTree.Element:
    """Return the ``<robot>`` element of a URDF.

    Raises:
        AssetError: If the text is no XML, declares entities, holds no robot, or is a template.
    """
    if re.search(rb"<!(DOCTYPE|ENTITY)", xml, re.IGNORECASE):
        raise AssetError(f"{urdf} declares XML entities; a URDF has no use for them")
    try:
        root = ElementTree.fromstring(xml)
    except ElementTree.ParseError as error:
        raise AssetError(f"{urdf} is not a URDF: {error}") from None
    if root.tag != "robot":
        raise AssetError(f"{urdf} is not a URDF: it holds <{root.tag}>, not <robot>")
    templates = [element.tag for element in root.iter() if _XACRO in element.tag]
    if templates:
        raise AssetError(f"{urdf} is a xacro template; `xacro {urdf} > robot.urdf` makes a URDF")
    return root


def read_joint(joint: ElementTree.Element, urdf: str) -> UrdfJoint:
    """Return what a ``<joint>`` element says of a joint.

    Raises:
        AssetError: If a limit is no number.
    """
    limit, mimic = joint.find("limit"), joint.find("mimic")
    where = f"{urdf}: joint {joint.get('name', '')!r}"
    given = [] if limit is None else [key for key in limit.keys() if key in _LIMITS]
    numbers = {key: numbers_of(limit, key, (0.0,), where)[0] for key in given}
    bounded = joint.get("type") in ("revolute", "prismatic")
    return UrdfJoint(
        name=joint.get("name", ""),
        type=joint.get("type", ""),
        lower=numbers.get("lower", 0.0) if bounded else None,
        upper=numbers.get("upper", 0.0) if bounded else None,
        effort=numbers.get("effort"),
        velocity=numbers.get("velocity"),
        mimics=mimic.get("joint") if mimic is not None else None,
    )


def numbers_of(
    element: ElementTree.Element | None, attribute: str, default: tuple[float, ...], where: str
) -> Any:
    """Return the finite numbers of an attribute, as many as ``default`` has.

    Args:
        element: The element, or None for the default.
        attribute: Its attribute.
        default: What it means to leave the attribute out.
        where: What the element belongs to, for messages.

    Raises:
        AssetError: If there are more or fewer numbers, or some that are none or not finite.
    """
    text = None if element is None else element.get(attribute)
    if element is None or text is None:
        return default
    try:
        numbers = tuple(map(float, text.split()))
    except ValueError:
        numbers = ()
    if len(numbers) != len(default) or not all(map(math.isfinite, numbers)):
        raise AssetError(
            f"{where} has {attribute}={text!r} in <{element.tag}>; {len(default)} finite"
            f" number{'s are' if len(default) > 1 else ' is'} needed"
        )
    return numbers


_LIMITS = ("lower", "upper", "effort", "velocity")


def resolve(filename: str, folder: str, exists: Callable[[str], bool]) -> str:
    """Return the path of a file that a URDF refers to; see `read_references`.

    Args:
        filename: The reference.
        folder: Folder of the URDF.
        exists: Whether a path exists.
    """
    if filename.startswith("file://"):
        return posixpath.normpath(filename.removeprefix("file://"))
    reference = filename.removeprefix("package://")
    path = posixpath.normpath(posixpath.join(folder, reference))
    if reference == filename:
        return path
    shorter = posixpath.normpath(posixpath.join(folder, reference.partition("/")[2]))
    above = (posixpath.join(parent, reference) for parent in _parents(folder))
    return next((found for found in (path, shorter, *above) if exists(found)), path)


def _parents(folder: str) -> list[str]:
    """Return the folders around an absolute folder, nearest first; none of a relative one."""
    found: list[str] = []
    while posixpath.isabs(folder) and posixpath.dirname(folder) != folder:
        folder = posixpath.dirname(folder)
        found.append(folder)
    return found

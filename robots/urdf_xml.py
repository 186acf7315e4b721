"""What a URDF says of its joints, links and meshes, read from its XML alone."""

from __future__ import annotations

import posixpath
import re
from collections.abc import Callable
from dataclasses import dataclass
from xml.etree import ElementTree

from robots.errors import AssetError


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
    return tuple(_read_joint(joint) for joint in joints if joint.get("type") != "fixed")


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
    below that folder, or as ``rest`` if only that ``exists``.

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
            paths.add(resolve_reference(element.get("filename", ""), folder, exists))
    for texture in root.iterfind("./material/texture"):
        found["visual"].add(resolve_reference(texture.get("filename", ""), folder, exists))
    return UrdfReferences(
        collision=tuple(sorted(found["collision"])),
        visual=tuple(sorted(found["visual"] - found["collision"])),
    )


def parse_urdf(xml: bytes, urdf: str) -> ElementTree.Element:
    """Return the ``<robot>`` element of a URDF.

    Raises:
        AssetError: If the text is no XML, declares entities, or holds no robot.
    """
    if re.search(rb"<!(DOCTYPE|ENTITY)", xml, re.IGNORECASE):
        raise AssetError(f"{urdf} declares XML entities; a URDF has no use for them")
    try:
        root = ElementTree.fromstring(xml)
    except ElementTree.ParseError as error:
        raise AssetError(f"{urdf} is not a URDF: {error}") from None
    if root.tag != "robot":
        raise AssetError(f"{urdf} is not a URDF: it holds <{root.tag}>, not <robot>")
    return root


def _read_joint(joint: ElementTree.Element) -> UrdfJoint:
    limit, mimic = joint.find("limit"), joint.find("mimic")
    numbers = {key: float(text) for key, text in (limit.items() if limit is not None else ())}
    bounded = joint.get("type") != "continuous"
    return UrdfJoint(
        name=joint.get("name", ""),
        type=joint.get("type", ""),
        lower=numbers.get("lower", 0.0) if bounded else None,
        upper=numbers.get("upper", 0.0) if bounded else None,
        effort=numbers.get("effort"),
        velocity=numbers.get("velocity"),
        mimics=mimic.get("joint") if mimic is not None else None,
    )


def resolve_reference(filename: str, folder: str, exists: Callable[[str], bool]) -> str:
    """Return the path of a file that a URDF refers to, as `read_references` explains.

    Args:
        filename: The reference as written.
        folder: Folder of the URDF.
        exists: Whether a path exists.
    """
    if filename.startswith("file://"):
        return posixpath.normpath(filename.removeprefix("file://"))
    reference = filename.removeprefix("package://")
    path = posixpath.normpath(posixpath.join(folder, reference))
    if reference != filename and not exists(path):
        shorter = posixpath.normpath(posixpath.join(folder, reference.partition("/")[2]))
        return shorter if exists(shorter) else path
    return path

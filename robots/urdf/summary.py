"""What a URDF says of its joints, links and meshes, read from its XML alone."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

from robots.common.errors import AssetError, UnreadableFileError
from robots.common.files import read_regular
from robots.urdf.numbers import numbers_of, shown
from robots.urdf.paths import Exists, resolve
from robots.urdf.xml_text import parse_xml

MAX_URDF_BYTES = 32 << 20

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


def read_urdf(path: Path) -> bytes:
    """Return the contents of a URDF or SRDF.

    Raises:
        AssetError: If it cannot be read, is no regular file, or is larger than `MAX_URDF_BYTES`.
    """
    try:
        return read_regular(path, MAX_URDF_BYTES)
    except UnreadableFileError as error:
        kind = "SRDF" if path.suffix == ".srdf" else "URDF"
        raise AssetError(f"cannot read the {kind} {path}: {error.strerror}") from error


def read_references(xml: bytes, urdf: str, exists: Exists = lambda path: False) -> UrdfReferences:
    """Return the files a URDF refers to, as paths in the same folder tree as ``urdf``.

    Args:
        xml: The URDF's contents.
        urdf: Its path, relative to the package or absolute.
        exists: Whether a path exists.

    Raises:
        AssetError: If it is no URDF, or refers to files that it may not refer to; see
            `robots.urdf.paths`.
    """
    root = parse_urdf(xml, urdf)
    found: dict[str, set[str]] = {"collision": set(), "visual": set()}
    for kind, paths in found.items():
        for element in (*root.iterfind(f".//{kind}//mesh"), *root.iterfind(f".//{kind}//texture")):
            paths.add(resolve(element.get("filename", ""), urdf, exists))
    for texture in root.iterfind("./material/texture"):
        found["visual"].add(resolve(texture.get("filename", ""), urdf, exists))
    return UrdfReferences(
        collision=tuple(sorted(found["collision"])),
        visual=tuple(sorted(found["visual"] - found["collision"])),
    )


def parse_urdf(xml: bytes, urdf: str) -> ElementTree.Element:
    """Return the ``<robot>`` element of a URDF.

    Raises:
        AssetError: If the text is no XML, declares entities, holds no robot, or is a template.
    """
    root = parse_xml(xml, urdf, "a URDF")
    if root.tag != "robot":
        raise AssetError(f"{urdf} is not a URDF: it holds <{root.tag}>, not <robot>")
    if any(_XACRO in element.tag for element in root.iter()):
        raise AssetError(f"{urdf} is a xacro template; `xacro {urdf} > robot.urdf` makes a URDF")
    return root


def read_joint(joint: ElementTree.Element, urdf: str) -> UrdfJoint:
    """Return what a ``<joint>`` element says of a joint.

    Raises:
        AssetError: If a limit is no number, or an effort or velocity is below 0.
    """
    limit, mimic = joint.find("limit"), joint.find("mimic")
    where = f"{urdf}: joint {shown(joint.get('name', ''))}"
    given = [] if limit is None else [key for key in limit.keys() if key in _LIMITS]
    numbers = {key: numbers_of(limit, key, (0.0,), where)[0] for key in given}
    for key in ("effort", "velocity"):
        if numbers.get(key, 0.0) < 0:
            raise AssetError(f"{where} has {key}={numbers[key]:g} in <limit>, below 0")
    bounded = joint.get("type") in ("revolute", "prismatic")
    return UrdfJoint(
        name=joint.get("name", ""),
        type=joint.get("type", ""),
        lower=numbers.get("lower", 0.0) if bounded else None,
        upper=numbers.get("upper", 0.0) if bounded else None,
        effort=numbers.get("effort"),
        velocity=numbers.get("velocity"),
        mimics=mimic.get("joint", "") if mimic is not None else None,
    )


_LIMITS = ("lower", "upper", "effort", "velocity")

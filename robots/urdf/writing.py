"""Parts of URDFs that are written: numbers to the last digit, origins, joints."""

from __future__ import annotations

from xml.etree.ElementTree import Element, SubElement

from robot_layouts.kinematics.quaternions import quaternion_rpy
from robot_layouts.kinematics.rotations import Floats, quaternion_of
from robots.parts import Quaternion, Vector3


def text(*numbers: float) -> str:
    """Return numbers as a URDF has them, to the last digit."""
    return " ".join(repr(float(number)) for number in numbers)


def origin_at(position: Vector3, quaternion: Quaternion) -> dict[str, str]:
    """Return the attributes of an ``<origin>``.

    Args:
        position: m.
        quaternion: wxyz.
    """
    return {"xyz": text(*position), "rpy": text(*quaternion_rpy(quaternion))}


def origin_of(pose: Floats) -> dict[str, str]:
    """Return the attributes of the ``<origin>`` of a pose, (4, 4) (m)."""
    x, y, z = pose[:3, 3].tolist()
    a, b, c, d = quaternion_of(pose[:3, :3]).tolist()
    return origin_at((x, y, z), (a, b, c, d))


def joint_element(name: str, kind: str, parent: str, child: str, origin: dict[str, str]) -> Element:
    """Return a joint.

    Args:
        name: Its name.
        kind: Its type, such as ``"fixed"``.
        parent: The link that carries it.
        child: The link that it carries.
        origin: Of that one in the frame of the other; see `origin_of`.
    """
    made = Element("joint", name=name, type=kind)
    SubElement(made, "parent", link=parent)
    SubElement(made, "child", link=child)
    SubElement(made, "origin", origin)
    return made

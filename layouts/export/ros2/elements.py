"""Elements of a URDF: shapes, colours, masses."""

from __future__ import annotations

from xml.etree.ElementTree import Element, SubElement, indent, tostring

from layouts.export.meshes import CollisionShape
from layouts.visuals import Rgba
from robot_layouts.kinematics.rotations import Floats
from robots.urdf.model import LinkInertia
from robots.urdf.text import origin_of, text


def xml_text(root: Element) -> str:
    """Return a document as text, indented."""
    indent(root)
    return f'<?xml version="1.0"?>\n{tostring(root, encoding="unicode")}\n'


def inertial(own: LinkInertia) -> Element:
    """Return what a link weighs."""
    made = Element("inertial")
    SubElement(made, "origin", xyz=text(*own.origin[:3, 3].tolist()), rpy="0 0 0")
    SubElement(made, "mass", value=repr(own.mass))
    keys = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
    numbers = own.tensor[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]].tolist()
    SubElement(made, "inertia", {k: repr(x) for k, x in zip(keys, numbers, strict=True)})
    return made


def collision(solid: CollisionShape, uri: str) -> Element:
    """Return a shape that collides.

    Args:
        solid: The shape.
        uri: Of the file that its mesh was saved in, if it has one.
    """
    own = solid.shape
    if solid.mesh is not None:
        return mesh_element("collision", uri)
    if own.kind == "box":
        return shape_element("collision", own.origin, "box", size=text(*own.sizes))
    keys = ("radius", "length")[: len(own.sizes)]
    sizes = {key: repr(float(x)) for key, x in zip(keys, own.sizes, strict=True)}
    return shape_element("collision", own.origin, own.kind, **sizes)


def mesh_element(kind: str, uri: str) -> Element:
    """Return a shape, a ``visual`` or a ``collision``, that is a mesh file."""
    shape = Element(kind)
    SubElement(SubElement(shape, "geometry"), "mesh", filename=uri)
    return shape


def shape_element(kind: str, pose: Floats, geometry: str, **sizes: str) -> Element:
    """Return one of another geometry, in a pose of the link's frame, (4, 4) (m)."""
    shape = Element(kind)
    SubElement(shape, "origin", origin_of(pose))
    SubElement(SubElement(shape, "geometry"), geometry, sizes)
    return shape


def paint(shape: Element, name: str, rgba: Rgba) -> None:
    """Give a shape a colour, by a name that no other has."""
    material = SubElement(shape, "material", name=name)
    SubElement(material, "color", rgba=text(*rgba))

"""The shapes of an MJCF's bodies as a URDF has them, and the meshes that go with it."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from kinematics.quaternions import quaternion_rpy
from kinematics.rotations import Floats, inverse_pose, pose_matrix, quaternion_of
from robots.mjcf.compiling import Model, name_of

PLANE, HFIELD, SPHERE, CAPSULE, ELLIPSOID, CYLINDER, BOX, MESH = range(8)  # MuJoCo's kinds
SEEN_GROUPS = 3  # the first groups of shapes, which MuJoCo draws unless it is asked otherwise
FEWEST_FACES = 4  # of what has a volume
_RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


@dataclass(frozen=True)
class Meshes:
    """Meshes that are to be written, by file name."""

    files: dict[str, bytes]


def add_shapes(link: Element, model: Model, body: int, shift: Floats, meshes: Meshes) -> list[str]:
    """Give a link what its body collides with and looks like.

    Args:
        link: The ``<link>``.
        model: MuJoCo's model.
        body: The body.
        shift: Pose of the body's frame in the link's, (4, 4) (m).
        meshes: Takes the meshes that the shapes need.

    Returns:
        What was left out, one sentence each.
    """
    notes: list[str] = []
    for geom in _geoms(model, body):
        kind = int(model.geom_type[geom])
        if kind in (PLANE, HFIELD) or kind > MESH:
            what = {PLANE: "plane", HFIELD: "height field"}.get(kind, "signed distance field")
            notes.append(f"left out: a {what} of {link.get('name')}, which a URDF does not have")
            continue
        for use in _uses(model, geom):
            shape = SubElement(link, use)
            pose = shift @ _pose(model, geom)
            origin(shape, pose)
            _geometry(SubElement(shape, "geometry"), model, geom, meshes)
            if use == "visual":
                _colour(shape, model, geom)
    return notes


def origin(parent: Element, pose: Floats) -> None:
    """Give an element the ``<origin>`` of a pose, (4, 4) (m)."""
    w, x, y, z = quaternion_of(pose[:3, :3]).tolist()
    px, py, pz = pose[:3, 3].tolist()
    SubElement(parent, "origin", xyz=text(px, py, pz), rpy=text(*quaternion_rpy((w, x, y, z))))


def text(*numbers: float) -> str:
    """Return numbers as a URDF has them, to the last digit."""
    return " ".join(repr(float(number)) for number in numbers)


def pose_of(position: Floats, quaternion: Floats) -> Floats:
    """Return a pose, (4, 4), from a position (m) and a quaternion wxyz of any length."""
    return pose_matrix(position, quaternion / np.linalg.norm(quaternion))


def _geoms(model: Model, body: int) -> range:
    first = int(model.body_geomadr[body])
    return range(first, first + int(model.body_geomnum[body]))


def _uses(model: Model, geom: int) -> Iterator[str]:
    """Yield what a shape is for: MuJoCo's bits say what collides, its groups what is drawn."""
    collides = bool(model.geom_contype[geom] | model.geom_conaffinity[geom])
    if collides or geom in model.pair_geom1 or geom in model.pair_geom2:
        yield "collision"
    drawn = not collides or int(model.geom_group[geom]) < SEEN_GROUPS
    if drawn and float(_rgba(model, geom)[3]) > 0:
        yield "visual"


def _pose(model: Model, geom: int) -> Floats:
    return pose_of(model.geom_pos[geom], model.geom_quat[geom])


def _geometry(geometry: Element, model: Model, geom: int, meshes: Meshes) -> None:
    kind = int(model.geom_type[geom])
    x, y, z = model.geom_size[geom].tolist()
    if kind == SPHERE:
        SubElement(geometry, "sphere", radius=text(x))
    elif kind == BOX:
        SubElement(geometry, "box", size=text(2 * x, 2 * y, 2 * z))
    elif kind in (CAPSULE, CYLINDER):
        tag = "capsule" if kind == CAPSULE else "cylinder"
        SubElement(geometry, tag, radius=text(x), length=text(2 * y))
    else:
        name, contents = _ellipsoid(x, y, z) if kind == ELLIPSOID else _mesh(model, geom)
        meshes.files[name] = contents
        SubElement(geometry, "mesh", filename=name)


def _ellipsoid(x: float, y: float, z: float) -> tuple[str, bytes]:
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=2)
    corners = np.asarray(ball.vertices) * (x, y, z)
    return f"ellipsoid_{x:g}_{y:g}_{z:g}.stl", _stl(corners[ball.faces])


def _mesh(model: Model, geom: int) -> tuple[str, bytes]:
    """Return file name and contents of a mesh, as MuJoCo has scaled, turned and centred it."""
    mesh = int(model.geom_dataid[geom])
    vertices = slice(int(model.mesh_vertadr[mesh]), None)
    first = int(model.mesh_faceadr[mesh])
    faces = model.mesh_face[first : first + int(model.mesh_facenum[mesh])]
    given = "".join(c if c.isalnum() and c.isascii() else "_" for c in name_of(model, "mesh", mesh))
    return f"{mesh}_{given[:60]}.stl", _stl(np.asarray(model.mesh_vert[vertices])[faces])


def _stl(triangles: Floats) -> bytes:
    """Return a binary STL of triangles, (n, 3, 3) (m)."""
    records = np.zeros(len(triangles), _RECORD)
    records["corners"] = triangles
    one, other = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    normals = np.cross(one, other)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    records["normal"] = normals / np.where(lengths > 0, lengths, 1.0)
    return bytes(80) + struct.pack("<I", len(triangles)) + records.tobytes()


def _rgba(model: Model, geom: int) -> Floats:
    material = int(model.geom_matid[geom])
    return model.mat_rgba[material] if material >= 0 else model.geom_rgba[geom]


def _colour(visual: Element, model: Model, geom: int) -> None:
    rgba = [round(float(value), 6) for value in _rgba(model, geom)]
    material = SubElement(visual, "material", name="_".join(f"{value:g}" for value in rgba))
    SubElement(material, "color", rgba=text(*rgba))


def inertial(link: Element, model: Model, body: int, shift: Floats) -> None:
    """Give a link the mass and the inertia of its body, if it has any; see `add_shapes`."""
    mass = float(model.body_mass[body])
    if mass <= 0:
        return
    element = SubElement(link, "inertial")
    origin(element, shift @ pose_of(model.body_ipos[body], model.body_iquat[body]))
    SubElement(element, "mass", value=text(mass))
    xx, yy, zz = map(text, model.body_inertia[body])
    SubElement(element, "inertia", ixx=xx, iyy=yy, izz=zz, ixy="0", ixz="0", iyz="0")


__all__ = ["Meshes", "add_shapes", "inertial", "inverse_pose", "origin", "pose_of", "text"]

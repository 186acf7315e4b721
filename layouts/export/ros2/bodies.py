"""A task's bodies in ROS 2: what stands in the cell's URDF, what moves in MoveIt's scene."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from xml.etree.ElementTree import Element, SubElement

import numpy as np
import yaml

from layouts.export.bodies import EARTH, PLANE, BodyJoint, BodyLink, ExportedBody
from layouts.export.meshes import CollisionShape, MeshFolder
from layouts.export.ros2.elements import (
    collision,
    inertial,
    mesh_element,
    paint,
    xml_text,
)
from layouts.export.ros2.groups import WORLD, RosNames
from layouts.visuals import GREY
from robot_layouts.kinematics.rotations import Floats, quaternion_of
from robots.urdf.model import UrdfShape
from robots.urdf.text import joint_element, origin_of, text

SCENE, POSES = "config/bodies.scene", "config/bodies.yaml"
_SLAB = (0.1, 100.0, 100.0)  # m; a box that stands for a plane, which no URDF has
_ORIGIN = np.zeros(3)


def standing_bodies(
    bodies: Iterable[ExportedBody], names: RosNames, meshes: MeshFolder, uri: str
) -> Iterator[Element]:
    """Yield links for bodies that nothing moves, fixed to the world, and save their meshes."""
    for body in bodies:
        if body.name in names.standing:
            name, (link,) = names.standing[body.name], body.links
            yield _link(link, name, meshes, uri)
            fixed = names.fixed_joint(name)
            yield joint_element(fixed, "fixed", WORLD, name, origin_of(link.pose))


def moved_bodies(
    bodies: Iterable[ExportedBody], names: RosNames, meshes: MeshFolder, uri: str
) -> Mapping[str, str]:
    """Return the files of bodies that move: a URDF of each, MoveIt's scene, and where they are.

    Without any, there are none.

    Args:
        bodies: The bodies, those that stand among them.
        names: What everything is called.
        meshes: Where their meshes are saved.
        uri: Of that folder.
    """
    texts, scene, poses = dict[str, str](), ["bodies"], dict[str, object]()
    for body in bodies:
        if body.name in names.moved:
            name = names.moved[body.name]
            texts[f"urdf/bodies/{name}.urdf"] = xml_text(_urdf(body, names, meshes, uri))
            poses[name] = _where(body, names)
            for link in body.links:
                scene.extend(_object(link, names.moved[link.name]))
    if not poses:
        return {}
    texts[SCENE] = "\n".join([*scene, ".", ""])
    texts[POSES] = yaml.safe_dump(poses, sort_keys=False, default_flow_style=None, width=10**6)
    return texts


def _urdf(body: ExportedBody, names: RosNames, meshes: MeshFolder, uri: str) -> Element:
    """Return a body as a URDF of its own; one that is held is fixed to a link ``world``.

    Links that joints move have their frames at those joints, as a URDF asks for.
    """
    name, anchors = names.moved[body.name], {own.model.child: own.anchor for own in body.joints}
    root = Element("robot", name=name)
    if not body.moves:
        SubElement(root, "link", name=WORLD)
        origin = origin_of(body.links[0].pose)
        root.append(joint_element(f"{name}_fixed", "fixed", WORLD, name, origin))
    links = {link.name: link.framed_at(anchors.get(link.name, _ORIGIN)) for link in body.links}
    for link in links.values():
        made = _link(link, names.moved[link.name], meshes, uri)
        if (body.moves or link.name != body.name) and link.collides:
            made.insert(0, inertial(link.inertia))
        root.append(made)
    for own in body.joints:
        before = anchors.get(own.model.parent, _ORIGIN)
        root.append(_joint(own, names, before, _carried(own.model.child, body, links)))
    return root


def _carried(link: str, body: ExportedBody, links: Mapping[str, BodyLink]) -> float:
    """Return the mass of a link and of all that its joints carry (kg)."""
    beyond = (own.model.child for own in body.joints if own.model.parent == link)
    return links[link].inertia.mass + sum(_carried(child, body, links) for child in beyond)


def _link(link: BodyLink, name: str, meshes: MeshFolder, uri: str) -> Element:
    made = Element("link", name=name)
    for number, drawn in enumerate(link.drawn):
        shape = mesh_element("visual", f"{uri}/{meshes.save(drawn.mesh, f'{name}_visual')}")
        paint(shape, f"{name}_{number}", drawn.rgba)
        made.append(shape)
    for solid in _solids(link):
        file = "" if solid.mesh is None else meshes.save(solid.mesh, f"{name}_collision")
        made.append(collision(solid, f"{uri}/{file}"))
    return made


def _solids(link: BodyLink) -> Iterator[CollisionShape]:
    """Yield what collides, with slabs for planes."""
    for solid in (own.solid for own in link.solids()):
        shape = solid.shape
        if shape.kind == PLANE:
            origin = shape.origin.copy()
            origin[:3, 3] -= origin[:3, 0] * _SLAB[0] / 2
            yield replace(solid, shape=replace(shape, kind="box", sizes=_SLAB, origin=origin))
        else:
            yield solid


def _joint(own: BodyJoint, names: RosNames, before: Floats, carries: float) -> Element:
    """Return a joint.

    Args:
        own: The joint.
        names: What everything is called.
        before: Where the frame of the link that carries it is in the body's own, (3,) (m).
        carries: The mass that it moves (kg), by which its friction counts.
    """
    model = own.model
    parent, child = names.moved[model.parent], names.moved[model.child]
    origin = model.origin.copy()
    origin[:3, 3] -= before
    made = joint_element(f"{child}_joint", model.type, parent, child, origin_of(origin))
    SubElement(made, "axis", xyz=text(*model.axis))
    limit = {"effort": "0.0", "velocity": "100.0"}
    if model.lower is not None and model.upper is not None:
        limit |= {"lower": repr(model.lower), "upper": repr(model.upper)}
    SubElement(made, "limit", limit)
    friction = own.drive.friction * carries * -EARTH[2]
    SubElement(made, "dynamics", damping=repr(own.drive.damping), friction=repr(friction))
    return made


def _where(body: ExportedBody, names: RosNames) -> dict[str, object]:
    """Return where a body is, and what its URDF cannot say."""
    pose = body.links[0].pose
    found: dict[str, object] = {
        "position": pose[:3, 3].tolist(),
        "orientation": _xyzw(pose),
        "held": not body.moves,
    }
    if body.joints:
        found["joints"] = {
            f"{names.moved[joint.model.child]}_joint": {
                "position": joint.position,
                "stiffness": float(joint.drive.stiffness),
                "rest": float(joint.rest),
            }
            for joint in body.joints
        }
    return found


def _xyzw(pose: Floats) -> list[float]:
    w, x, y, z = quaternion_of(pose[:3, :3]).tolist()
    return [x, y, z, w]


# -- MoveIt's planning scene ----------------------------------------------------------------------


def _object(link: BodyLink, name: str) -> Iterator[str]:
    """Yield the lines of a scene file that say what a link is, and where."""
    solids = list(_solids(link))
    color = link.drawn[0].rgba if link.drawn else GREY
    yield f"* {name}"
    yield from _pose(link.pose)
    yield str(len(solids))
    for solid in solids:
        yield from _mesh(solid) if solid.mesh is not None else _primitive(solid.shape)
        yield from _pose(np.eye(4) if solid.mesh is not None else solid.shape.origin)
        yield text(*color)
    yield "0"  # subframes


def _pose(pose: Floats) -> Iterator[str]:
    yield text(*pose[:3, 3].tolist())
    yield text(*_xyzw(pose))


def _primitive(shape: UrdfShape) -> Iterator[str]:
    yield shape.kind
    yield text(*shape.sizes)


def _mesh(solid: CollisionShape) -> Iterator[str]:
    yield "mesh"
    yield f"{len(solid.mesh.vertices)} {len(solid.mesh.faces)}"
    yield from (text(*corner) for corner in solid.mesh.vertices.tolist())
    yield from (f"{one} {two} {three}" for one, two, three in solid.mesh.faces.tolist())

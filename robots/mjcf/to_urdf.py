"""A URDF of what MuJoCo made of an MJCF.

A link stands for a body, and its frame is the body's, but for one whose joint lies elsewhere in the
body: there the link's frame is at the joint. Each joint has MuJoCo's own positions: where MuJoCo
says 0.3 rad, so does the URDF, also where the MJCF has a ``ref``. A body with several joints gets
links without a body between them; sites that are named like tools, or are the only one of a last
body, become frames.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np

from robot_layouts.kinematics.rotations import Floats, inverse_pose, pose_matrix, rotation_about
from robots.guessing import words
from robots.mjcf.couplings import Couplings
from robots.mjcf.reading import Model, name_of
from robots.mjcf.robot import SLIDE, MjcfRobot, take_name
from robots.urdf.mesh_files import binary_stl
from robots.urdf.text import joint_element, origin_of, text

FARTHEST = 10.0  # m; how far a slide goes each way whose range nothing says
TOOLS = (*words.TCP, *words.GRASP, *words.TOOL, *words.END, *words.HAND, *words.TIP, *words.FLANGE)
WORLD = "world"
PLANE, HFIELD, SPHERE, CAPSULE, ELLIPSOID, CYLINDER, BOX, MESH = range(8)  # MuJoCo's kinds
SEEN_GROUPS = 3  # the first groups of shapes, which MuJoCo draws unless it is asked otherwise


@dataclass
class UrdfText:
    """A URDF that is being made.

    Attributes:
        xml: Its text.
        meshes: Contents of its meshes by file name, beside it.
        frames: Pose of each body's frame in its link's, by link, (4, 4) (m).
        notes: What was left out or chosen, one sentence each.
    """

    xml: bytes = b""
    meshes: dict[str, bytes] = field(default_factory=dict)
    frames: dict[str, Floats] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


def write_urdf(
    robot: MjcfRobot, couplings: Couplings, efforts: Mapping[int, float], name: str
) -> UrdfText:
    """Return a robot as a URDF.

    Args:
        robot: The robot.
        couplings: What joints follow, and which stand still.
        efforts: The largest force of each joint's actuators, where it is known (N·m, N).
        name: What the robot is called.
    """
    writer = _Writer(robot, couplings, efforts)
    root = Element("robot", name=name)
    if writer.world:
        root.append(Element("link", name=writer.world))
    for body in robot.bodies:
        root.extend(writer.body(body))
    root.extend(writer.sites())
    indent(root)
    writer.made.xml = tostring(root, encoding="utf-8", xml_declaration=True)
    return writer.made


class _Writer:
    """Writes the links and joints of one robot."""

    def __init__(
        self, robot: MjcfRobot, couplings: Couplings, efforts: Mapping[int, float]
    ) -> None:
        self._robot, self._model, self.made = robot, robot.model, UrdfText()
        self._couplings, self._efforts = couplings, efforts
        self._taken = {*robot.links.values()}
        self._joints = {*robot.names.values()}
        self._inside: dict[int, Floats] = {}  # pose of each body's frame in its link's
        self.world = self.free(WORLD) if len(robot.roots) > 1 else ""

    def free(self, name: str) -> str:
        """Return a name that no link has, and take it."""
        return take_name(name, self._taken)

    def body(self, body: int) -> list[Element]:
        """Return the links and joints of a body."""
        link = Element("link", name=self._robot.links[body])
        elements, end = self._chain(body)
        self._inside[body] = inside = inverse_pose(end)
        self.made.frames[self._robot.links[body]] = inside
        inertial(link, self._model, body, inside)
        self.made.notes += add_shapes(link, self._model, body, inside, self.made.meshes)
        return [link, *elements]

    def _chain(self, body: int) -> tuple[list[Element], Floats]:
        """Return the joints of a body, the links between them, and its link's frame in its own."""
        model, robot = self._model, self._robot
        place = pose_of(model.body_pos[body], model.body_quat[body])
        parent = int(model.body_parentid[body])
        joints = robot.joints[body]
        if parent in self._inside:
            carrier, start = robot.links[parent], self._inside[parent] @ place
        elif self.world:
            carrier, start = self.world, place
        else:
            # The base of a robot that stands alone: where its first body is, as upright as that.
            carrier, start = "", np.eye(4)
            start[:3, :3] = place[:3, :3]
        elements: list[Element] = []
        if not carrier:
            if not joints and np.allclose(start, np.eye(4)):
                return [], np.eye(4)
            carrier = self.free("base")
            elements.append(Element("link", name=carrier))
        if not joints:
            name = self._joint_name(f"{robot.links[body]}_fixed")
            elements.append(
                joint_element(name, "fixed", carrier, robot.links[body], origin_of(start))
            )
            return elements, np.eye(4)
        before = np.zeros(3)  # where the frame of the link before is in the body's
        for joint in joints:
            at = model.jnt_pos[joint].copy() if model.jnt_type[joint] != SLIDE else before.copy()
            step = np.eye(4)
            step[:3, 3] = at - before
            last = joint == joints[-1]
            child = robot.links[body] if last else self.free(f"{robot.names[joint]}_link")
            reference = float(model.qpos0[model.jnt_qposadr[joint]])
            pose = start @ step @ self._motion(joint, -reference)  # so that positions are MuJoCo's
            elements.append(self._moving(joint, carrier, child, pose))
            if not last:
                elements.append(Element("link", name=child))
            carrier, start, before = child, np.eye(4), at
        end = np.eye(4)
        end[:3, 3] = before
        return elements, end

    def _motion(self, joint: int, by: float) -> Floats:
        """Return by which a joint moves what it carries, in its own frame, (4, 4)."""
        motion, axis = np.eye(4), self._model.jnt_axis[joint]
        if self._model.jnt_type[joint] == SLIDE:
            motion[:3, 3] = by * axis
        else:
            motion[:3, :3] = rotation_about(axis.tolist(), by)
        return motion

    def _moving(self, joint: int, parent: str, child: str, pose: Floats) -> Element:
        model, name = self._model, self._robot.names[joint]
        if joint in self._couplings.fixed:
            place = pose @ self._motion(joint, self._couplings.fixed[joint])
            return joint_element(name, "fixed", parent, child, origin_of(place))
        slides = model.jnt_type[joint] == SLIDE
        limited = bool(model.jnt_limited[joint])
        kind = "prismatic" if slides else "revolute" if limited else "continuous"
        element = joint_element(name, kind, parent, child, origin_of(pose))
        SubElement(element, "axis", xyz=text(*model.jnt_axis[joint]))
        numbers: dict[str, str] = {}
        if limited:
            low, high = model.jnt_range[joint]
            numbers |= {"lower": text(low), "upper": text(high)}
        elif slides:
            numbers |= {"lower": text(-FARTHEST), "upper": text(FARTHEST)}
            self.made.notes.append(
                f"joint {name!r} slides without a range; it was given {FARTHEST:g} m each way"
            )
        if joint in self._efforts:
            numbers["effort"] = text(self._efforts[joint])
        if numbers:
            SubElement(element, "limit", numbers)
        if (coupling := self._couplings.of.get(joint)) is not None:
            leader = self._robot.names[coupling.leader]
            factor, offset = text(coupling.multiplier), text(coupling.offset)
            SubElement(element, "mimic", joint=leader, multiplier=factor, offset=offset)
        return element

    def sites(self) -> list[Element]:
        """Return the frames of sites that are named like tools, or stand alone at an end."""
        elements: list[Element] = []
        carriers = self._model.site_bodyid.tolist()
        inner = {int(self._model.body_parentid[b]) for b in self._robot.bodies}
        for site, body in enumerate(carriers):
            name = name_of(self._model, "site", site)
            alone = carriers.count(body) == 1 and body not in inner
            if body in self._inside and (alone or words.has(name, TOOLS)):
                name = name or f"{self._robot.links[body]}_site"
                link = self.free(name if name not in self._taken else f"{name}_site")
                pose = pose_of(self._model.site_pos[site], self._model.site_quat[site])
                place = self._inside[body] @ pose
                fixed = self._joint_name(f"{link}_fixed")
                elements += [
                    Element("link", name=link),
                    joint_element(fixed, "fixed", self._robot.links[body], link, origin_of(place)),
                ]
        return elements

    def _joint_name(self, name: str) -> str:
        while name in self._joints:
            name += "_"
        self._joints.add(name)
        return name


def excluded(robot: MjcfRobot) -> tuple[tuple[str, str], ...]:
    """Return the pairs of links that an MJCF leaves out of its contacts."""
    pairs = [(both >> 16, both & 0xFFFF) for both in robot.model.exclude_signature.tolist()]
    named = [
        (robot.links[one], robot.links[other])
        for one, other in pairs
        if one in robot.links and other in robot.links and one != other
    ]
    return tuple(dict.fromkeys(named))


def add_shapes(
    link: Element, model: Model, body: int, shift: Floats, meshes: dict[str, bytes]
) -> list[str]:
    """Give a link what its body collides with and looks like.

    Args:
        link: The ``<link>``.
        model: MuJoCo's model.
        body: The body.
        shift: Pose of the body's frame in the link's, (4, 4) (m).
        meshes: Takes the meshes that the shapes need, by file name.

    Returns:
        What was left out, one sentence each.
    """
    notes: list[str] = []
    for geom in np.flatnonzero(model.geom_bodyid == body).tolist():
        kind = int(model.geom_type[geom])
        if kind in (PLANE, HFIELD) or kind > MESH:
            what = {PLANE: "plane", HFIELD: "height field"}.get(kind, "signed distance field")
            notes.append(f"left out: a {what} of {link.get('name')}, which a URDF does not have")
            continue
        for use in _uses(model, geom):
            shape = SubElement(link, use)
            SubElement(
                shape,
                "origin",
                origin_of(shift @ pose_of(model.geom_pos[geom], model.geom_quat[geom])),
            )
            _geometry(SubElement(shape, "geometry"), model, geom, meshes)
            if use == "visual":
                _colour(shape, model, geom)
    return notes


def pose_of(position: Floats, quaternion: Floats) -> Floats:
    """Return a pose, (4, 4), from a position (m) and a quaternion wxyz of any length."""
    return pose_matrix(position, quaternion / np.linalg.norm(quaternion))


def _uses(model: Model, geom: int) -> Iterator[str]:
    """Yield what a shape is for: MuJoCo's bits say what collides, its groups what is drawn."""
    collides = bool(model.geom_contype[geom] | model.geom_conaffinity[geom])
    if collides or geom in model.pair_geom1 or geom in model.pair_geom2:
        yield "collision"
    drawn = not collides or int(model.geom_group[geom]) < SEEN_GROUPS
    if drawn and float(_rgba(model, geom)[3]) > 0:
        yield "visual"


def _geometry(geometry: Element, model: Model, geom: int, meshes: dict[str, bytes]) -> None:
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
        meshes[name] = contents
        SubElement(geometry, "mesh", filename=name)


def _ellipsoid(x: float, y: float, z: float) -> tuple[str, bytes]:
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=2)
    corners = np.asarray(ball.vertices) * (x, y, z)
    return f"ellipsoid_{x:g}_{y:g}_{z:g}.stl", binary_stl(corners[ball.faces])


def _mesh(model: Model, geom: int) -> tuple[str, bytes]:
    """Return file name and contents of a mesh, as MuJoCo has scaled, turned and centred it."""
    mesh = int(model.geom_dataid[geom])
    vertices = slice(int(model.mesh_vertadr[mesh]), None)
    first = int(model.mesh_faceadr[mesh])
    faces = model.mesh_face[first : first + int(model.mesh_facenum[mesh])]
    given = "".join(c if c.isalnum() and c.isascii() else "_" for c in name_of(model, "mesh", mesh))
    return f"{mesh}_{given[:60]}.stl", binary_stl(np.asarray(model.mesh_vert[vertices])[faces])


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
    SubElement(
        element, "origin", origin_of(shift @ pose_of(model.body_ipos[body], model.body_iquat[body]))
    )
    SubElement(element, "mass", value=text(mass))
    xx, yy, zz = map(text, model.body_inertia[body])
    SubElement(element, "inertia", ixx=xx, iyy=yy, izz=zz, ixy="0", ixz="0", iyz="0")

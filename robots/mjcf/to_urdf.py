"""A URDF of what MuJoCo made of an MJCF.

A link stands for a body, and its frame is the body's, but for one whose joint lies elsewhere in the
body: there the link's frame is at the joint. Each joint has MuJoCo's own positions: where MuJoCo
says 0.3 rad, so does the URDF, also where the MJCF has a ``ref``. A body with several joints gets
links without a body between them; sites that are named like tools, or are the only one of a last
body, become frames.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np

from kinematics.rotations import Floats, inverse_pose, rotation_about
from robots.guessing import words
from robots.mjcf.compiling import Model, name_of
from robots.mjcf.couplings import Couplings
from robots.mjcf.robot import SLIDE, MjcfRobot
from robots.mjcf.shapes import Meshes, add_shapes, inertial, origin, pose_of, text

FARTHEST = 10.0  # m; how far a slide goes each way whose range nothing says
TOOLS = (*words.TCP, *words.GRASP, *words.TOOL, *words.END, *words.HAND, *words.TIP, *words.FLANGE)
WORLD = "world"


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
    made = UrdfText()
    writer = _Writer(robot, couplings, efforts, made)
    root = Element("robot", name=name)
    if writer.world:
        root.append(Element("link", name=writer.world))
    for body in robot.bodies:
        root.extend(writer.body(body))
    root.extend(writer.sites())
    indent(root)
    made.xml = tostring(root, encoding="utf-8", xml_declaration=True)
    return made


class _Writer:
    """Writes the links and joints of one robot."""

    def __init__(
        self,
        robot: MjcfRobot,
        couplings: Couplings,
        efforts: Mapping[int, float],
        made: UrdfText,
    ) -> None:
        self._robot, self._model, self._made = robot, robot.model, made
        self._couplings, self._efforts = couplings, efforts
        self._meshes = Meshes(made.meshes)
        self._taken = {*robot.links.values()}
        self._joints = {*robot.names.values()}
        self._inside: dict[int, Floats] = {}  # pose of each body's frame in its link's
        self.world = self.free(WORLD) if len(robot.roots) > 1 else ""

    def free(self, name: str) -> str:
        """Return a name that no link has, and take it."""
        free, count = name, 2
        while free in self._taken:
            free, count = f"{name}_{count}", count + 1
        self._taken.add(free)
        return free

    def body(self, body: int) -> list[Element]:
        """Return the links and joints of a body."""
        link = Element("link", name=self._robot.links[body])
        elements, end = self._chain(body)
        self._inside[body] = inside = inverse_pose(end)
        self._made.frames[self._robot.links[body]] = inside
        inertial(link, self._model, body, inside)
        self._made.notes += add_shapes(link, self._model, body, inside, self._meshes)
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
        if not joints and not carrier:
            return self._rooted(body, start)
        if not carrier:
            base = Element("link", name=self.free("base"))
            elements = [base]
            carrier = base.get("name", "")
        else:
            elements = []
        if not joints:
            name = self._joint_name(f"{robot.links[body]}_fixed")
            elements.append(_joint(name, "fixed", carrier, robot.links[body], start))
            return elements, np.eye(4)
        before = np.zeros(3)  # where the frame of the link before is in the body's
        for joint in joints:
            at = model.jnt_pos[joint].copy() if model.jnt_type[joint] != SLIDE else before.copy()
            step = np.eye(4)
            step[:3, 3] = at - before
            last = joint == joints[-1]
            child = robot.links[body] if last else self.free(f"{robot.names[joint]}_link")
            pose = self._referred(start @ step, joint)
            elements.append(self._moving(joint, carrier, child, pose))
            if not last:
                elements.append(Element("link", name=child))
            carrier, start, before = child, np.eye(4), at
        end = np.eye(4)
        end[:3, 3] = before
        return elements, end

    def _rooted(self, body: int, start: Floats) -> tuple[list[Element], Floats]:
        """Return the root of a robot that stands alone: upright in its world, at its own place."""
        if np.allclose(start, np.eye(4)):
            return [], np.eye(4)
        base = self.free("base")
        name = self._joint_name(f"{self._robot.links[body]}_fixed")
        joint = _joint(name, "fixed", base, self._robot.links[body], start)
        return [Element("link", name=base), joint], np.eye(4)

    def _referred(self, pose: Floats, joint: int) -> Floats:
        """Return where a joint's frame is such that its positions are those of MuJoCo."""
        reference = float(self._model.qpos0[self._model.jnt_qposadr[joint]])
        return pose @ self._motion(joint, -reference)

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
            return _joint(name, "fixed", parent, child, place)
        slides = model.jnt_type[joint] == SLIDE
        limited = bool(model.jnt_limited[joint])
        kind = "prismatic" if slides else "revolute" if limited else "continuous"
        element = _joint(name, kind, parent, child, pose)
        SubElement(element, "axis", xyz=text(*model.jnt_axis[joint]))
        numbers: dict[str, str] = {}
        if limited:
            low, high = model.jnt_range[joint]
            numbers |= {"lower": text(low), "upper": text(high)}
        elif slides:
            numbers |= {"lower": text(-FARTHEST), "upper": text(FARTHEST)}
            self._made.notes.append(
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
                joint = self._joint_name(f"{link}_fixed")
                elements += [
                    Element("link", name=link),
                    _joint(joint, "fixed", self._robot.links[body], link, place),
                ]
        return elements

    def _joint_name(self, name: str) -> str:
        while name in self._joints:
            name += "_"
        self._joints.add(name)
        return name


def _joint(name: str, kind: str, parent: str, child: str, pose: Floats) -> Element:
    joint = Element("joint", name=name, type=kind)
    SubElement(joint, "parent", link=parent)
    SubElement(joint, "child", link=child)
    origin(joint, pose)
    return joint


def excluded(robot: MjcfRobot) -> tuple[tuple[str, str], ...]:
    """Return the pairs of links that an MJCF leaves out of its contacts."""
    model: Model = robot.model
    pairs: list[tuple[str, str]] = []
    for signature in model.exclude_signature.tolist():
        one, other = signature >> 16, signature & 0xFFFF
        if one in robot.links and other in robot.links and one != other:
            pairs.append((robot.links[one], robot.links[other]))
    return tuple(dict.fromkeys(pairs))

"""Makes a thing of a body of an MJCF: its shapes, what hinges and slides move, its sites."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from objects.descriptor import Grasp, NamedPoint, ObjectDescriptor
from objects.family import Made
from objects.files.convex import few_corners, rounded
from objects.files.grasps import MOST, proposed
from objects.files.mesh import UNKNOWN, identifier
from objects.files.remembering import Files, remembered
from objects.files.rests import UPRIGHT, resting
from objects.joints import Joint
from objects.shapes import (
    MOST_CORNERS,
    Box,
    Capsule,
    Color,
    ConvexHull,
    Cylinder,
    Friction,
    Mesh,
    Shape,
    Sphere,
)
from objects.solids import mass_of, rounded_place, rounded_turn, surface
from robot_layouts.core.bounds import checked_number, checked_whole
from robot_layouts.core.errors import DescriptorError, UnknownNameError
from robot_layouts.kinematics.rotations import Floats, multiply, pose_matrix, quaternion_of
from robots.assets.locator import opened_path
from robots.descriptor import IDENTITY, Quaternion
from robots.mjcf.reading import compiled, mujoco, name_of, read_mjcf
from robots.urdf.mesh_files import binary_stl

Model = Any
"""A ``mujoco.MjModel``, whose package need not be installed."""

_DRAWN = 2  # the last group of shapes that MuJoCo's viewer shows at first
_ALONG_X: Quaternion = (0.7071067811865476, 0.0, -0.7071067811865476, 0.0)  # from x to z
_FAR = {"slide": 1.0, "turn": 100.0}  # m, rad; to both sides, where a joint has no stops
_TO_LIGHT = 2.2  # exponent from what screens encode
_DIGITS = 9


class _Moving(NamedTuple):
    """Bodies that move as one.

    Attributes:
        joint: Number of the joint that moves them; None for those that carry all others.
        carrier: Name of the joint that carries that one.
        bodies: Their numbers.
    """

    joint: int | None
    carrier: str | None
    bodies: list[int]


def thing_from_mjcf(
    path: str | os.PathLike[str],
    name: str | None = None,
    *,
    body: str | int | None = None,
    mass: float | None = None,
    folder: str | os.PathLike[str] | None = None,
    most_grasps: int = MOST,
    **fields: Any,
) -> ObjectDescriptor:
    """Return a thing that is a body of an MJCF; see `objects.descriptor.ThingFromMjcf`."""
    file = opened_path(path, folder)
    text = read_mjcf(file)
    heavy = None if mass is None else checked_number("mass", mass, 1e-6, 1e4, DescriptorError, "kg")
    asked = checked_whole("most_grasps", most_grasps, 1, 1000, DescriptorError)
    made = remembered(
        text.digest.encode(),
        ("mjcf", body, asked),
        None,
        lambda: _Reading(file, compiled(text, file)[0]).made(body, asked),
    )
    everything = [*made.parts, *(part for joint in made.joints for part in joint.parts)]
    ratio = 1.0 if heavy is None else heavy / mass_of(everything).mass
    given: dict[str, Any] = {
        "name": name or identifier(body if isinstance(body, str) else text.name),
        "about": f"A thing from {file.name}",
        "parts": _weighed(made.parts, ratio),
        "joints": tuple(replace(j, parts=_weighed(j.parts, ratio)) for j in made.joints),
        "rests": made.rests,
        "points": made.points,
        "grasps": tuple(made.grasps),
        "source": file.name,
        "licence": UNKNOWN,
    }
    return ObjectDescriptor(**{**given, **fields})


def _weighed(parts: Iterable[Shape], ratio: float) -> tuple[Shape, ...]:
    return tuple(replace(part, density=part.density * ratio) for part in parts)


class _Reading:
    """A model that is being read."""

    def __init__(self, file: Path, model: Model) -> None:
        self._file, self._model = file, model
        self._kinds = mujoco().mjtGeom
        self._files: dict[str, bytes] = {}
        self._poses: dict[int, Floats] = {}  # of bodies in the thing's frame, by number
        self._parts: list[_Moving] = []

    def made(self, body: str | int | None, most_grasps: int) -> tuple[Made, Files]:
        """Return what a body is, and the meshes that are drawn of it."""
        root = self._root(body)
        self._poses[root] = np.eye(4)
        self._parts.append(_Moving(None, None, [root]))
        self._follow(root, self._parts[0])
        shapes = [self._shapes(part) for part in self._parts]
        if not any(shape.visible for own in shapes for shape in own):  # then by what collides
            shapes = [[replace(shape, visible=True) for shape in own] for own in shapes]
        joints = [
            self._joint(part, own) for part, own in zip(self._parts[1:], shapes[1:], strict=True)
        ]
        rests, grasps = _handled(shapes, joints, most_grasps)
        return Made(shapes[0], grasps, self._points(), rests, joints), self._files

    def _root(self, body: str | int | None) -> int:
        model = self._model
        outer = [i for i in range(1, model.nbody) if model.body_parentid[i] == 0]
        names = {name_of(model, "body", i): i for i in range(1, model.nbody)}
        names.pop("", None)
        if isinstance(body, str):
            if body not in names:
                raise UnknownNameError(f"body of {self._file.name}", body, names)
            return names[body]
        if body is None and len(outer) == 1:
            return outer[0]
        if body is None or not 0 <= body < len(outer):
            listed = ", ".join(f"{i}: {name_of(model, 'body', at)!r}" for i, at in enumerate(outer))
            raise DescriptorError(
                f"{self._file} has {len(outer)} bodies in its world ({listed}); body={body!r} must"
                " be the number of one, or the name of any body"
            )
        return outer[body]

    def _follow(self, body: int, part: _Moving) -> None:
        """Take over what a body carries."""
        model = self._model
        for child in range(1, model.nbody):
            if model.body_parentid[child] != body:
                continue
            pose = pose_matrix(model.body_pos[child], model.body_quat[child])
            self._poses[child] = self._poses[body] @ pose
            if model.body_jntnum[child] == 0:
                part.bodies.append(child)
                self._follow(child, part)
                continue
            if model.body_jntnum[child] > 1:
                raise DescriptorError(
                    f"{self._file}: the body {name_of(model, 'body', child)!r} has"
                    f" {model.body_jntnum[child]} joints; a part of a thing has one"
                )
            joint = int(model.body_jntadr[child])
            carrier = None if part.joint is None else self._joint_name(part.joint)
            self._parts.append(_Moving(joint, carrier, [child]))
            self._follow(child, self._parts[-1])

    def _shapes(self, part: _Moving) -> list[Shape]:
        model = self._model
        shapes = [
            shape
            for body in part.bodies
            for geom in range(
                model.body_geomadr[body], model.body_geomadr[body] + model.body_geomnum[body]
            )
            for shape in self._of_geom(geom, self._poses[body])
        ]
        if not any(shape.collides for shape in shapes):
            raise DescriptorError(
                f"{self._file}: no shape of the body {name_of(model, 'body', part.bodies[0])!r}"
                " touches anything (contype and conaffinity), so that it cannot be a part"
            )
        mass = float(model.body_mass[part.bodies].sum())
        density = mass / mass_of(replace(shape, density=1.0) for shape in shapes).mass
        return [replace(shape, density=density) for shape in shapes] if mass > 0 else shapes

    def _of_geom(self, geom: int, body: Floats) -> list[Shape]:
        """Return the shapes that one of MuJoCo's is; of a mesh the hull collides."""
        model, kinds = self._model, self._kinds
        pose = body @ pose_matrix(model.geom_pos[geom], model.geom_quat[geom])
        kind, (a, b, c) = model.geom_type[geom], model.geom_size[geom].tolist()
        color = self._color(geom)
        collides = bool(model.geom_contype[geom] or model.geom_conaffinity[geom])
        visible = bool(model.geom_group[geom] <= _DRAWN and color[3] > 0)
        slides = round(float(model.geom_friction[geom, 0]), _DIGITS)
        common: dict[str, Any] = {
            "friction": Friction(slides, slides),
            "color": color,
            "collides": collides,
            "visible": visible,
        }
        place, turn = rounded_place(pose[:3, 3]), _turn(pose[:3, :3])
        upright = rounded_turn(multiply(turn, _ALONG_X))
        if not (collides or visible):
            return []
        if kind == kinds.mjGEOM_MESH:
            return self._of_mesh(geom, pose, common)
        if kind == kinds.mjGEOM_ELLIPSOID:
            ball = surface(Sphere(1.0)).corners * (a, b, c) @ pose[:3, :3].T + pose[:3, 3]
            return [ConvexHull(rounded(few_corners(ball, MOST_CORNERS)), **common)]
        if kind == kinds.mjGEOM_BOX:
            return [Box((a, b, c), position=place, quaternion=turn, **common)]
        if kind == kinds.mjGEOM_SPHERE:
            return [Sphere(a, position=place, **common)]
        if kind == kinds.mjGEOM_CYLINDER:
            return [Cylinder(a, b, position=place, quaternion=upright, **common)]
        if kind == kinds.mjGEOM_CAPSULE:
            return [Capsule(a, b, position=place, quaternion=upright, **common)]
        raise DescriptorError(f"{self._file}: a plane or a height field is no shape of a thing")

    def _of_mesh(self, geom: int, pose: Floats, common: dict[str, Any]) -> list[Shape]:
        model, mesh = self._model, self._model.geom_dataid[geom]
        first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
        corners = np.array(model.mesh_vert[first : first + count], float)
        found = list[Shape]()
        if common["visible"]:
            start, faces = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
            file = f"mesh_{mesh}.stl"
            self._files[file] = binary_stl(corners[model.mesh_face[start : start + faces]])
            looks: dict[str, Any] = {**common, "collides": False}
            at: dict[str, Any] = {
                "position": rounded_place(pose[:3, 3]),
                "quaternion": _turn(pose[:3, :3]),
            }
            found.append(Mesh(file, **at, **looks))
        if common["collides"]:
            points = corners @ pose[:3, :3].T + pose[:3, 3]
            hull = rounded(few_corners(points, MOST_CORNERS))
            unseen: dict[str, Any] = {**common, "visible": False}
            found.append(ConvexHull(hull, **unseen))
        return found

    def _color(self, geom: int) -> Color:
        model, material = self._model, self._model.geom_matid[geom]
        own = model.geom_rgba[geom]
        plain = material >= 0 and np.allclose(own, (0.5, 0.5, 0.5, 1.0))  # MuJoCo's own grey
        red, green, blue, alpha = (model.mat_rgba[material] if plain else own).tolist()
        light = (round(min(max(tone, 0.0), 1.0) ** _TO_LIGHT, 6) for tone in (red, green, blue))
        return (*light, round(min(max(alpha, 0.0), 1.0), 6))

    def _joint_name(self, joint: int) -> str:
        return identifier(name_of(self._model, "joint", joint) or f"joint_{joint}")

    def _joint(self, part: _Moving, shapes: Sequence[Shape]) -> Joint:
        model, joint = self._model, part.joint
        types = mujoco().mjtJoint
        kinds: dict[int, Literal["slide", "turn"]] = {
            int(types.mjJNT_SLIDE): "slide",
            int(types.mjJNT_HINGE): "turn",
        }
        kind = kinds.get(int(model.jnt_type[joint]))
        name = self._joint_name(int(joint or 0))
        if kind is None:
            raise DescriptorError(
                f"{self._file}: the joint {name!r} is neither a hinge nor a slide"
            )
        pose, first = self._poses[part.bodies[0]], model.jnt_qposadr[joint]
        zero, dof = float(model.qpos0[first]), model.jnt_dofadr[joint]
        far = _FAR[kind]
        stops = model.jnt_range[joint] - zero if model.jnt_limited[joint] else np.array((-far, far))
        lower, upper = (round(stop, _DIGITS) + 0.0 for stop in stops.tolist())
        return Joint(
            name=name,
            kind=kind,
            parts=tuple(shapes),
            axis=rounded_place(pose[:3, :3] @ model.jnt_axis[joint]),
            at=rounded_place(pose[:3, :3] @ model.jnt_pos[joint] + pose[:3, 3]),
            lower=lower,
            upper=upper,
            start=min(max(0.0, lower), upper),
            damping=float(model.dof_damping[dof]),
            stiffness=float(model.jnt_stiffness[joint]),
            rest=float(model.qpos_spring[first]) - zero,
            carrier=part.carrier,
        )

    def _points(self) -> dict[str, NamedPoint]:
        """Return the sites as points; their frames are those of the file."""
        model, found = self._model, dict[str, NamedPoint]()
        for site in range(model.nsite):
            name, body = name_of(model, "site", site), int(model.site_bodyid[site])
            if name and body in self._poses:
                pose = pose_matrix(model.site_pos[site], model.site_quat[site])
                pose = self._poses[body] @ pose
                found[identifier(name)] = NamedPoint(
                    rounded_place(pose[:3, 3]), _turn(pose[:3, :3])
                )
        return found


def _handled(
    shapes: Sequence[Sequence[Shape]], joints: Sequence[Joint], most: int
) -> tuple[dict[str, Quaternion], list[Grasp]]:
    """Return how a thing rests, and where it is grasped: by its moving parts, if it has some."""
    everything = [shape for own in shapes for shape in own]
    if not joints:
        solid = [shape for shape in everything if shape.collides]
        corners = np.concatenate([surface(shape).corners for shape in solid])
        centre = mass_of(solid).centre
        rests = dict(resting(corners, centre))
        lying = next(iter(rests.values()))
        return rests, list(proposed(solid, solid, centre, lying, most=most))
    grasps = list[Grasp]()
    for joint in joints:
        centre = mass_of(joint.parts).centre
        grasps += proposed(joint.parts, everything, centre, IDENTITY, joint.name, most // 2)
    return {UPRIGHT: IDENTITY}, grasps


def _turn(rotation: Floats) -> Quaternion:
    return rounded_turn(quaternion_of(rotation))

"""Gives a robot to SAPIEN's builder of articulations, as the model of its URDF describes it.

SAPIEN's own URDF loader would read the file a second time, by another parser.
What is built here has its numbers to the last bit: poses are composed in its order of operations.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator, Mapping
from functools import cache, lru_cache
from math import inf
from pathlib import Path
from typing import Any, Literal
from xml.etree.ElementTree import Element

import numpy as np
import sapien
from sapien.physx import PhysxMaterial
from sapien.wrapper.articulation_builder import ArticulationBuilder

from robot_layouts.simulation.sapien3.light_meshes import light_parts
from robot_layouts.simulation.world import Visuals
from robots import AssetError, GripperMaterial
from robots.descriptor import Vector3
from robots.urdf.mesh_files import read_corners
from robots.urdf.model import LinkInertia, ModelJoint, UrdfModel, UrdfShape
from robots.urdf.paths import resolve
from robots.urdf.text import numbers_of

# SAPIEN's names of a joint that turns between limits, and of one that turns without end.
_TYPES = {"revolute": "revolute_unwrapped", "continuous": "revolute"}

# Cylinders and capsules lie along z in a URDF and along x in SAPIEN; the digits are its loader's.
_ALONG_Z = sapien.Pose(q=[0.7071068, 0, 0.7071068, 0])


def make_builder(
    model: UrdfModel,
    root: Element,
    urdf: str,
    material: GripperMaterial | None,
    *,
    visuals: Visuals,
) -> Any:
    """Return SAPIEN's builder of a robot whose base is fixed; no joint of it mimics another yet.

    Args:
        model: What a URDF describes.
        root: Its ``<robot>``, which the model was read from.
        urdf: Its path, for what it refers to.
        material: What its fingers are made of; None is SAPIEN's default.
        visuals: Whether to give it what pictures need, and which meshes.

    Raises:
        AssetError: If it has no joints, or a mesh that is to be mirrored cannot be read.
        MissingPackageError: If a package that makes light meshes is missing.
    """
    if not model.joints:
        raise AssetError(f"{urdf} describes a single link; a robot has at least one joint")
    links = {link.get("name"): link for link in root.iterfind("link")}
    joints = {joint.get("name"): joint for joint in root.iterfind("joint")}
    materials = _named_materials(root)
    builder: Any = ArticulationBuilder()
    made: dict[str, Any] = {}
    for name, joint in ((model.root, None), *((joint.child, joint) for joint in model.ordered)):
        link = made[name] = builder.create_link_builder(joint and made[joint.parent])
        link.set_name(name)
        if joint is None:
            link.set_joint_properties("fixed", [], sapien.Pose(), sapien.Pose())
        else:
            _set_joint(link, joint, joints[joint.name])
        if name in model.inertials:
            _set_inertia(link, model.inertials[name], links[name])
        own = material if material is not None and name in material.links else None
        for shape, text in _shapes(links[name], "collision", model.collisions):
            _add_shape(link, "collision", shape, text, urdf, **_contact(own))
        for shape, text in _shapes(links[name], "visual", model.visuals) if visuals else ():
            finish = {"material": _finish(text, materials, urdf), "name": text.get("name", "")}
            if not (visuals == "light" and _add_light(link, shape, text, urdf, **finish)):
                _add_shape(link, "visual", shape, text, urdf, **finish)
    return builder


def _set_joint(link: Any, joint: ModelJoint, text: Element) -> None:
    frame = joint_frame(joint.axis)
    limits = [] if joint.type == "fixed" else [[-inf, inf]]
    if joint.lower is not None and joint.upper is not None:
        limits = [[joint.lower, joint.upper]]
    (damping,) = numbers_of(text.find("dynamics"), "damping", (0.0,), joint.name)
    link.set_joint_name(joint.name)
    link.set_joint_properties(
        _TYPES.get(joint.type, joint.type), limits, _origin(text) * frame, frame, damping=damping
    )


def joint_frame(axis: Vector3, at: Vector3 = (0.0, 0.0, 0.0)) -> sapien.Pose:
    """Return the pose of a joint in a link, along or about whose x axis SAPIEN moves it.

    Args:
        axis: Of the joint, in the link's frame; a fixed one may have any.
        at: A point on it (m).
    """
    x = np.array(axis if any(axis) else (1.0, 0.0, 0.0))
    y = np.cross(x, (0.0, 0.0, 1.0) if abs(x[0]) > 0.9 else (1.0, 0.0, 0.0))
    y /= np.linalg.norm(y)
    return _pose(np.column_stack([x, y, np.cross(x, y)]), at)


def _set_inertia(link: Any, inertia: LinkInertia, text: Element) -> None:
    """Set mass and principal moments; without, SAPIEN takes them from the collision shapes."""
    tensor = inertia.tensor
    if inertia.mass == 0 or not tensor.any():
        return
    moments, axes = np.diag(tensor), np.eye(3)
    if (tensor != np.diag(moments)).any():
        moments, axes = np.linalg.eigh(tensor)
        if np.linalg.det(axes) < 0:
            axes[:, 2] = -axes[:, 2]
    at = _origin(text.find("inertial")) * _pose(axes)
    link.set_mass_and_inertia(inertia.mass, at, moments)


def _shapes(
    link: Element, kind: str, shapes: Mapping[str, tuple[UrdfShape, ...]]
) -> Iterator[tuple[UrdfShape, Element]]:
    return zip(shapes.get(link.get("name", ""), ()), link.iterfind(kind), strict=True)


def _add_shape(
    link: Any,
    kind: Literal["collision", "visual"],
    shape: UrdfShape,
    text: Element,
    urdf: str,
    **more: Any,
) -> None:
    pose = _origin(text)
    match shape.kind:
        case "mesh":
            path, scale = resolve(shape.file, urdf, os.path.isfile), shape.sizes
            add = link.add_visual_from_file
            if kind == "collision":
                add = link.add_convex_collision_from_file
                if min(scale) < 0:
                    path, scale = unmirrored(path, scale, shape.where, urdf), (1.0, 1.0, 1.0)
            add(path, pose, scale, **more)
        case "box":
            half_size = [size / 2 for size in shape.sizes]
            getattr(link, f"add_box_{kind}")(pose, half_size, **more)
        case "sphere":
            getattr(link, f"add_sphere_{kind}")(pose, *shape.sizes, **more)
        case _:
            radius, length = shape.sizes
            getattr(link, f"add_{shape.kind}_{kind}")(pose * _ALONG_Z, radius, length / 2, **more)


def _add_light(
    link: Any, shape: UrdfShape, text: Element, urdf: str, material: Any, name: str
) -> bool:
    """Add a mesh that is drawn with fewer triangles, and tell whether there is one."""
    if shape.kind != "mesh":
        return False
    parts = light_parts(resolve(shape.file, urdf, os.path.isfile), shape.sizes)
    for part in parts:
        own = part.material() if material is None else material
        link.add_visual_from_file(part.file, _origin(text), (1.0, 1.0, 1.0), own, name)
    return bool(parts)


def _contact(material: GripperMaterial | None) -> dict[str, Any]:
    if material is None:
        return {}
    friction = material.static_friction, material.dynamic_friction, material.restitution
    radius = material.patch_radius
    made = PhysxMaterial(*friction)
    return {"material": made, "patch_radius": radius, "min_patch_radius": radius}


def _named_materials(root: Element) -> dict[str, Element]:
    """Return a URDF's materials by name; the robot's go before those of its links."""
    named: dict[str, Element] = {}
    for material in (*root.iterfind("material"), *root.iterfind("link/visual/material")):
        named.setdefault(material.get("name", ""), material)
    return named


def _finish(visual: Element, named: Mapping[str, Element], urdf: str) -> Any:
    """Return the colour or texture of a visual as SAPIEN's material; None if it has none."""
    material = visual.find("material")
    if material is None:
        return None
    material = named[name] if (name := material.get("name")) else material
    color, texture = material.find("color"), material.find("texture")
    finish = sapien.render.RenderMaterial()
    if color is not None:
        finish.base_color = np.clip(numbers_of(color, "rgba", (1.0,) * 4, urdf), 0.0, 1.0)
    elif texture is not None:
        path = resolve(texture.get("filename", ""), urdf, os.path.isfile)
        finish.base_color_texture = sapien.render.RenderTexture2D(path)
    return finish


def _origin(text: Element | None) -> sapien.Pose:
    """Return the pose of an element's ``<origin>``."""
    origin = None if text is None else text.find("origin")
    position, angles = (numbers_of(origin, key, (0.0,) * 3, "") for key in ("xyz", "rpy"))
    (cx, cy, cz), (sx, sy, sz) = np.cos(angles), np.sin(angles)
    turned = [
        [cz * cy, (cz * sy * sx) - (cx * sz), (sz * sx) + (cz * cx * sy)],
        [cy * sz, (cz * cx) + (sz * sy * sx), (cx * sz * sy) - (cz * sx)],
        [-sy, cy * sx, cy * cx],
    ]
    return _pose(turned, position)


def _pose(axes: Any, position: Any = (0.0, 0.0, 0.0)) -> sapien.Pose:
    """Return a pose from its rotation matrix, (3, 3), and position, (3,) (m)."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = axes, position
    return sapien.Pose(matrix)


def unmirrored(path: str, scale: tuple[float, ...], where: str, urdf: str) -> str:
    """Return a mesh file that needs no scale, whose convex hull is that of another one scaled.

    PhysX knows no convex bodies of negative scale: it builds them, and the process crashes where
    two of them touch.

    Args:
        path: A mesh file.
        scale: Its factors along x, y and z, some of them negative.
        where: What refers to it, for messages.
        urdf: The URDF that it belongs to.

    Raises:
        AssetError: If it cannot be read.
    """
    return _written(path, Path(path).stat().st_mtime_ns, scale, where, urdf)


@lru_cache(maxsize=1024)
def _written(path: str, _modified: int, scale: tuple[float, ...], where: str, urdf: str) -> str:
    import trimesh

    hull: Any = trimesh.convex.convex_hull(read_corners(path, scale, where, urdf))
    folder = Path(_folder().name)
    target = folder / f"{len(list(folder.iterdir()))}_{Path(path).stem}.stl"
    hull.export(target)
    return str(target)


@cache
def _folder() -> tempfile.TemporaryDirectory[str]:
    """Return a folder that is removed when this process ends."""
    return tempfile.TemporaryDirectory(prefix="robot-layouts-")

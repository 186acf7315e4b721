"""A layout for MuJoCo: one MJCF model, and its meshes in a folder beside it."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np

from layouts.export.cell import ExportedCell, RobotSource, Standing
from layouts.export.files import LICENCES, expect_ending, licence_note, replaced_folder
from layouts.export.meshes import CollisionShape, Drawn, MeshFolder, drawn_meshes, solid_shapes
from layouts.visuals import GREY, Rgba
from robot_layouts.core.writing import write_whole
from robot_layouts.kinematics.quaternions import multiplied
from robot_layouts.kinematics.rotations import Floats, quaternion_of
from robots import CameraMount
from robots.urdf.model import LinkInertia, ModelJoint

if TYPE_CHECKING:
    from layouts.arrangement import Arrangement

HOME = "home"
TIMESTEPS = (0.002, 0.001, 0.0005, 0.0002, 0.0001)  # s; the first at which all drives are stable
TIED = "0.99 0.99 0.001"  # impedance of what ties a joint to the one that it follows
HULLS = ("mesh",)  # all other shapes of a URDF are MuJoCo's, too
FEWEST_CORNERS = 4  # of a mesh that MuJoCo reads
LEAST_VOLUME = 1e-14  # m³; of a mesh that MuJoCo takes for a body
DRAWN, SOLID = "drawn", "solid"  # default classes
SOLID_RGBA = (0.5, 0.6, 0.7, 0.5)
# MuJoCo's own are a black sky and a dim light.
SKY = {
    "type": "skybox", "builtin": "gradient", "rgb1": "1 1 1", "rgb2": "0.7 0.75 0.8",
    "width": "256", "height": "1536",
}  # fmt: skip
HEADLIGHT = {"ambient": "0.35 0.35 0.35", "diffuse": "0.6 0.6 0.6", "specular": "0 0 0"}
# From a camera that looks along +x, z up, to MuJoCo's, which looks along -z, y up (wxyz).
LOOKING = (0.5, 0.5, -0.5, -0.5)


def write_mjcf(layout: Arrangement, path: str | os.PathLike[str], *, visuals: bool = True) -> Path:
    """Write a layout as MJCF; see `layouts.Layout.to_mjcf`."""
    target = expect_ending(path, "MJCF", ".xml")
    cell = ExportedCell.read(layout, visuals=visuals)
    folder = target.absolute().with_name(f"{target.stem}_assets")
    with replaced_folder(folder, _is_own, "save the model under another name") as made:
        note = licence_note(source.robot for source in cell.sources)
        (made / LICENCES).write_text(note, encoding="utf-8")
        model = mjcf_of(cell, target.stem, made, visuals=visuals)
        model.add_surroundings()
        model.add_home()
        write_whole(target, model.text(folder.name))
    return target


def mjcf_of(cell: ExportedCell, name: str, folder: Path, *, visuals: bool) -> MjcfModel:
    """Return a model of a cell's robots, and save its meshes.

    Args:
        cell: The robots, with what was read of their files.
        name: The model's name.
        folder: Where the meshes go.
        visuals: Whether it has meshes that are drawn, too.

    Raises:
        AssetError: If a mesh is missing or cannot be read.
    """
    model = MjcfModel(cell, name)
    for source in cell.sources:
        model.add_meshes(source, folder / source.name, visuals=visuals)
    model.add_robots()
    return model


def _is_own(found: Path) -> bool:
    return found.name == LICENCES or (
        found.is_dir() and all(file.suffix == ".stl" for file in found.iterdir())
    )


class MjcfModel:
    """A model that grows robot by robot.

    Attributes:
        timestep: At which every drive is stable (s).
    """

    def __init__(self, cell: ExportedCell, name: str) -> None:
        """Begin without robots."""
        self._cell, self._shapes = cell, dict[int, Mapping[str, list[dict[str, str]]]]()
        self._root = Element("mujoco", model=name)
        self.timestep = _timestep(cell.sources)
        # MuJoCo's own 20 ms is so soft that what is light and held sinks into fingers.
        self._stiff = _text([2 * self.timestep, 1.0])
        compiler = {"angle": "radian", "autolimits": "true", "balanceinertia": "true"}
        self._compiler = SubElement(self._root, "compiler", compiler)
        option = SubElement(
            self._root, "option", timestep=repr(self.timestep), integrator="implicitfast"
        )
        # Which links may touch is said pair by pair, below.
        SubElement(option, "flag", filterparent="disable")
        self._add_defaults()
        visual = SubElement(self._root, "visual")
        SubElement(visual, "headlight", HEADLIGHT)
        self._assets = SubElement(self._root, "asset")
        SubElement(self._assets, "texture", SKY)
        self._world = SubElement(self._root, "worldbody")
        self._qpos: list[float] = []

    def add_meshes(self, source: RobotSource, folder: Path, *, visuals: bool) -> None:
        """Save the meshes of a robot, and keep what each of its links looks like."""
        files = MeshFolder(folder)
        geoms: dict[str, list[dict[str, str]]] = {link: [] for link in source.model.links}
        for link, drawn in drawn_meshes(source, visuals=visuals).items():
            for mesh in drawn:
                file = files.save(_with_corners(mesh.mesh), f"{link}_visual")
                name = self._add_mesh(f"{source.name}/{file}", "shell")
                geoms[link].append(_drawn(mesh, name))
        for link, solids in solid_shapes(source, HULLS).items():
            for solid in solids:
                name = ""
                if solid.mesh is not None:
                    file = files.save(solid.mesh, f"{link}_collision")
                    inertia = "convex" if solid.mesh.volume > LEAST_VOLUME else "shell"
                    name = self._add_mesh(f"{source.name}/{file}", inertia)
                geoms[link].append(_solid(solid, name, source.friction_of(link)))
        self._shapes[id(source)] = geoms

    def text(self, meshes: str) -> str:
        """Return the model as XML; ``meshes`` is the folder that has them."""
        self._compiler.set("meshdir", meshes)
        indent(self._root)
        return tostring(self._root, encoding="unicode") + "\n"

    def add_robots(self) -> None:
        """Add all robots, with their drives."""
        for standing in self._cell.robots.values():
            self._add_robot(standing)
        self._add_pairs()
        self._add_followers()
        self._add_actuators()

    def add_home(self) -> None:
        """Add the keyframe at which the layout starts the robots."""
        qpos, ctrl = self._qpos, self._ctrl()
        keyframe = SubElement(self._root, "keyframe")
        SubElement(keyframe, "key", name=HOME, qpos=_text(qpos), ctrl=_text(ctrl))

    def _add_defaults(self) -> None:
        defaults = SubElement(self._root, "default")
        SubElement(defaults, "geom", solref=self._stiff)
        drawn = SubElement(defaults, "default", {"class": DRAWN})
        SubElement(drawn, "geom", type="mesh", contype="0", conaffinity="0", group="2", mass="0")
        solid = SubElement(defaults, "default", {"class": SOLID})
        SubElement(solid, "geom", group="3", rgba=_text(SOLID_RGBA))

    def _add_mesh(self, file: str, inertia: str) -> str:
        name = file.removesuffix(".stl")
        SubElement(self._assets, "mesh", name=name, file=file, inertia=inertia)
        return name

    def add_surroundings(self) -> None:
        """Add the layout's tables and frames."""
        for name, (pose, size) in self._cell.tables.items():
            place = {**_pose(pose), "size": _text((size / 2).tolist())}
            SubElement(self._world, "geom", place, name=name, type="box", rgba=_text(GREY))
        for name, frame in self._cell.layout.frame_poses.items():
            place = {"pos": _text(frame.position), "quat": _text(frame.quaternion)}
            SubElement(self._world, "site", place, name=name, group="4")

    def _add_robot(self, standing: Standing) -> None:
        source, place = standing.source, standing.place
        bodies = {source.model.root: self._add_body(standing, self._world, standing.base, None)}
        for joint in source.model.ordered:
            parent = bodies[joint.parent]
            bodies[joint.child] = self._add_body(standing, parent, joint.origin, joint)
        for tool in self._cell.tools:
            if tool.place == place:
                name, where = f"{tool.arm.replace('.', '/')}/tcp", _text(tool.position.tolist())
                SubElement(bodies[tool.link], "site", name=name, pos=where, group="4")
        for camera in source.robot.cameras:
            SubElement(bodies[camera.link], "camera", _camera(camera, place))

    def _add_body(
        self, standing: Standing, parent: Element, pose: Floats, joint: ModelJoint | None
    ) -> Element:
        source, place = standing.source, standing.place
        link = source.model.root if joint is None else joint.child
        # Drives hold the robots, as they do here, without the weight of the links.
        body = SubElement(parent, "body", _pose(pose), name=f"{place}/{link}", gravcomp="1")
        if link in source.inertials:
            SubElement(body, "inertial", _inertial(source.inertials[link]))
        if joint is not None and joint.moves:
            numbers = _joint(joint, source, self.timestep)
            SubElement(body, "joint", numbers, name=f"{place}/{joint.name}")
            self._qpos.append(standing.home[joint.name])
        for geom in self._shapes[id(source)][link]:
            SubElement(body, "geom", geom)
        return body

    def _add_pairs(self) -> None:
        contact = SubElement(self._root, "contact")
        for place, standing in self._cell.robots.items():
            for one, other in sorted(sorted(pair) for pair in standing.source.allowed):
                SubElement(contact, "exclude", body1=f"{place}/{one}", body2=f"{place}/{other}")

    def _add_followers(self) -> None:
        equality = SubElement(self._root, "equality")
        for place, standing in self._cell.robots.items():
            for joint in standing.source.followers:
                ends = {"joint1": f"{place}/{joint.name}", "joint2": f"{place}/{joint.mimics}"}
                law = _text([joint.offset, joint.multiplier, 0.0, 0.0, 0.0])
                SubElement(equality, "joint", ends, polycoef=law, solref=self._stiff, solimp=TIED)

    def _add_actuators(self) -> None:
        actuators = SubElement(self._root, "actuator")
        for place, standing in self._cell.robots.items():
            limits = {joint.name: joint for joint in standing.source.model.moving}
            for name, drive in standing.source.drives.items():
                joint = limits[name]
                strong = drive.force > 0
                numbers = {
                    "kp": repr(drive.stiffness if strong else 0.0),
                    "kv": repr(drive.damping if strong else 0.0),
                }
                if strong:
                    numbers["forcerange"] = _text([-drive.force, drive.force])
                if joint.lower is not None and joint.upper is not None:
                    numbers["ctrlrange"] = _text([joint.lower, joint.upper])
                full = f"{place}/{name}"
                SubElement(actuators, "position", numbers, name=full, joint=full)

    def _ctrl(self) -> list[float]:
        return [
            standing.home[joint]
            for standing in self._cell.robots.values()
            for joint in standing.source.drives
        ]


def _timestep(sources: Iterable[RobotSource]) -> float:
    """Return the longest timestep (s) at which no drive shakes its joint.

    MuJoCo takes dampers implicitly and springs explicitly, which is stable while
    stiffness · timestep² stays below four times (inertia + damping · timestep); half that is used.
    """
    longest = min(step for source in sources for step in _stable_steps(source))
    return next((step for step in TIMESTEPS if step <= longest), TIMESTEPS[-1])


def _stable_steps(source: RobotSource) -> Iterator[float]:
    yield TIMESTEPS[0]
    for joint in source.model.moving:
        drive = source.drives.get(joint.name)
        if drive is not None and drive.stiffness > 0 and drive.force > 0:
            inertia = drive.armature + _least_inertia(joint, source)
            root = math.sqrt(drive.damping**2 + 2 * drive.stiffness * inertia)
            yield (drive.damping + root) / drive.stiffness


def _with_corners(mesh: Any) -> Any:
    """Return a trimesh that looks the same and has as many corners as MuJoCo wants."""
    corners = np.asarray(mesh.triangles, np.float32)
    few = all(
        len(np.unique(some.reshape(-1, 3), axis=0)) < FEWEST_CORNERS
        for some in (corners[:FEWEST_CORNERS], corners)  # most meshes show it at once
    )
    return mesh.subdivide() if few else mesh


def _drawn(drawn: Drawn, mesh: str) -> dict[str, str]:
    return {"class": DRAWN, "mesh": mesh, "rgba": _text(drawn.rgba)}


def _solid(
    solid: CollisionShape, mesh: str, friction: tuple[float, float] | None
) -> dict[str, str]:
    geom = {"class": SOLID, **_shape(solid, mesh)}
    if friction is not None:
        # MuJoCo has one coefficient for what slides and what sticks; the others are its defaults.
        geom["friction"] = _text([friction[0], 0.005, 0.0001])
    return geom


def _shape(solid: CollisionShape, mesh: str) -> dict[str, str]:
    shape = solid.shape
    match shape.kind:
        case "mesh":
            return {"type": "mesh", "mesh": mesh}
        case "box":
            size = [side / 2 for side in shape.sizes]
        case "sphere":
            size = list(shape.sizes)
        case _:
            radius, length = shape.sizes
            size = [radius, length / 2]
    return {"type": shape.kind, "size": _text(size), **_pose(shape.origin)}


def _joint(joint: ModelJoint, source: RobotSource, timestep: float) -> dict[str, str]:
    found = {
        "type": "slide" if joint.type == "prismatic" else "hinge",
        "axis": _text(joint.axis),
    }
    if joint.lower is not None and joint.upper is not None:
        found["range"] = _text([joint.lower, joint.upper])
    damping, friction = source.dynamics.get(joint.name, (0.0, 0.0))
    numbers = {
        "damping": damping,
        "frictionloss": friction,
        "armature": _armature(joint, source, timestep),
    }
    return {**found, **{key: repr(value) for key, value in numbers.items() if value}}


def _armature(joint: ModelJoint, source: RobotSource, timestep: float) -> float:
    """Return the armature of a joint: its own, or what it takes for its drive to be stable.

    A drive's force is clamp(stiffness · way - damping · speed). MuJoCo takes the damper implicitly,
    but explicitly while the force is clamped; what weighs less than damping · timestep is then
    thrown beyond the speed at which the damper would hold it.
    """
    drive = source.drives.get(joint.name)
    if drive is None:
        return 0.0
    if not drive.force > 0:
        return drive.armature
    return max(drive.armature, drive.damping * timestep - _least_inertia(joint, source))


def _least_inertia(joint: ModelJoint, source: RobotSource) -> float:
    """Return the least inertia that the links rigid with a joint's child can have (kg·m², kg)."""
    moved = source.model.rigid_with(joint.child)
    own = [source.inertials[link] for link in moved if link in source.inertials]
    if joint.type == "prismatic":
        return sum(inertial.mass for inertial in own)
    return sum(max(0.0, float(np.linalg.eigvalsh(inertial.tensor)[0])) for inertial in own)


def _inertial(inertial: LinkInertia) -> dict[str, str]:
    full = inertial.tensor[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    return {
        "pos": _text(inertial.origin[:3, 3].tolist()),
        "mass": repr(inertial.mass),
        "fullinertia": _text(full.tolist()),
    }


def _camera(camera: CameraMount, place: str) -> dict[str, str]:
    return {
        "name": f"{place}/{camera.name}",
        "pos": _text(camera.position),
        "quat": _text(multiplied(camera.quaternion, LOOKING)),
        "fovy": repr(math.degrees(camera.fov)),
        "resolution": f"{camera.width} {camera.height}",
    }


def _pose(pose: Floats) -> dict[str, str]:
    """Return position and orientation, as far as they are none of the parent's."""
    found: dict[str, str] = {}
    if pose[:3, 3].any():
        found["pos"] = _text(pose[:3, 3].tolist())
    if (pose[:3, :3] != np.eye(3)).any():
        found["quat"] = _text(quaternion_of(pose[:3, :3]).tolist())
    return found


def _text(values: Sequence[float] | Iterable[float] | Rgba) -> str:
    return " ".join(repr(float(value)) for value in values)

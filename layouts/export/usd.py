"""A layout as one USD stage: articulations of UsdPhysics, with the attributes that PhysX reads."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from layouts.export.cell import ExportedCell, RobotSource, Standing
from layouts.export.files import Names, licence_note
from layouts.export.meshes import drawn_meshes, solid_shapes
from layouts.export.usd_prims import (
    Usd,
    UsdGeom,
    UsdPhysics,
    UsdShade,
    add_box,
    add_camera,
    add_drawn,
    add_fixed_base,
    add_joint,
    add_solid,
    place,
    set_attribute,
    set_inertia,
    surface,
    tie,
)
from robot_layouts.core.writing import PARTIAL, written_whole
from robot_layouts.kinematics.rotations import Floats, inverse_pose, pose_matrix

if TYPE_CHECKING:
    from layouts.arrangement import Arrangement

FORBIDDEN = r"[^A-Za-z0-9_]"


def write_usd(layout: Arrangement, target: Path, *, visuals: bool = True) -> Path:
    """Write a layout as a USD stage; see `layouts.Layout.to_usd`."""
    cell = ExportedCell.read(layout, visuals=visuals)
    stage = _Stage(cell, _identifier(target.stem))
    for source in cell.sources:
        stage.add_shapes(source, visuals=visuals)
    stage.add_surroundings()
    for standing in cell.robots.values():
        stage.add_robot(standing)
    partial = target.with_name(f"{target.stem}.{os.getpid()}{PARTIAL}{target.suffix}")
    with written_whole(target, partial=partial):
        stage.save(partial)
    return target


def _identifier(name: str) -> str:
    plain = Names(FORBIDDEN).new(name)
    return f"_{plain}" if plain[:1].isdigit() or not plain else plain


class _Paths:
    """Paths of prims below another one, by the names that they have here."""

    def __init__(self, above: str, *taken: str) -> None:
        self.above, self._names = above, Names(FORBIDDEN)
        self._paths: dict[str, str] = {}
        for name in taken:
            self._names.new(name)

    def of(self, name: str) -> str:
        """Return the path of a prim, the same each time."""
        if name not in self._paths:
            self._paths[name] = f"{self.above}/{self._names.new(_identifier(name))}"
        return self._paths[name]


class _Stage:
    """A stage that grows robot by robot."""

    def __init__(self, cell: ExportedCell, name: str) -> None:
        self._cell, self._stage = cell, Usd.Stage.CreateInMemory()
        UsdGeom.SetStageUpAxis(self._stage, UsdGeom.Tokens.z)
        UsdGeom.SetStageMetersPerUnit(self._stage, 1.0)
        UsdPhysics.SetStageKilogramsPerUnit(self._stage, 1.0)
        note = licence_note(source.robot for source in cell.sources)
        self._stage.GetRootLayer().documentation = note
        self._stage.SetMetadata("comment", "lengths in m, z up; see the documentation for licences")
        root = UsdGeom.Xform.Define(self._stage, f"/{name}").GetPrim()
        self._stage.SetDefaultPrim(root)
        self._paths = _Paths(f"/{name}", "scene", "tables", "frames", "surfaces")
        UsdPhysics.Scene.Define(self._stage, f"/{name}/scene")
        library = f"/{name}_shapes"
        self._stage.CreateClassPrim(library)
        self._shapes = {
            id(source): _Paths(_Paths(library).of(source.name)) for source in cell.sources
        }

    def save(self, path: Path) -> None:
        """Write the stage."""
        self._stage.GetRootLayer().Export(path.as_posix())

    def add_shapes(self, source: RobotSource, *, visuals: bool) -> None:
        """Define what each link of a robot looks like and collides with, for all its places."""
        paths = self._shapes[id(source)]
        for link, meshes in drawn_meshes(source, visuals=visuals).items():
            for number, drawn in enumerate(meshes):
                add_drawn(self._stage, f"{paths.of(link)}/drawn/mesh_{number}", drawn)
        for link, solids in solid_shapes(source, ("mesh",)).items():
            for number, solid in enumerate(solids):
                add_solid(self._stage, f"{paths.of(link)}/solid/shape_{number}", solid)

    def add_surroundings(self) -> None:
        """Define tables and frames."""
        tables, frames = (_Paths(f"{self._paths.above}/{what}") for what in ("tables", "frames"))
        for name, (pose, size) in self._cell.tables.items():
            add_box(self._stage, tables.of(name), pose, size)
        for name, frame in self._cell.layout.frame_poses.items():
            made = UsdGeom.Xform.Define(self._stage, frames.of(name))
            place(made, pose_matrix(frame.position, frame.quaternion))

    def add_robot(self, standing: Standing) -> None:
        """Define a robot: its links where they are at home, and its joints."""
        source = standing.source
        prim = UsdGeom.Xform.Define(self._stage, self._paths.of(standing.place))
        place(prim, standing.base)
        UsdPhysics.ArticulationRootAPI.Apply(prim.GetPrim())
        prim.GetPrim().AddAppliedSchema("PhysxArticulationAPI")
        set_attribute(prim.GetPrim(), "physxArticulation:enabledSelfCollisions", "Bool", True)
        links = _Paths(str(prim.GetPath()), "joints")
        back = inverse_pose(standing.base)
        for link in source.model.links:
            self._add_link(source, link, links.of(link), back @ standing.poses[link])
        for one, other in sorted(sorted(pair) for pair in source.allowed):
            api = UsdPhysics.FilteredPairsAPI.Apply(self._stage.GetPrimAtPath(links.of(one)))
            api.CreateFilteredPairsRel().AddTarget(links.of(other))
        self._add_joints(standing, links)
        self._add_mounts(standing, links)

    def _add_link(self, source: RobotSource, link: str, path: str, pose: Floats) -> None:
        made = UsdGeom.Xform.Define(self._stage, path)
        prim = made.GetPrim()
        place(made, pose)
        prim.SetDisplayName(link)  # which may have letters that no path has
        UsdPhysics.RigidBodyAPI.Apply(prim)
        prim.AddAppliedSchema("PhysxRigidBodyAPI")
        set_attribute(prim, "physxRigidBody:disableGravity", "Bool", True)
        if link in source.inertials:
            set_inertia(prim, source.inertials[link])
        for kind in ("drawn", "solid"):
            shapes = f"{self._shapes[id(source)].of(link)}/{kind}"
            if self._stage.GetPrimAtPath(shapes):
                held = UsdGeom.Xform.Define(self._stage, f"{path}/{kind}").GetPrim()
                held.GetReferences().AddInternalReference(shapes)
                held.SetInstanceable(True)
        friction = source.friction_of(link)
        if friction is not None:
            name = f"{self._paths.above}/surfaces/{_identifier(source.name)}"
            material = surface(self._stage, name, source.robot.gripper_material)
            UsdShade.MaterialBindingAPI.Apply(prim).Bind(
                material, UsdShade.Tokens.weakerThanDescendants, "physics"
            )

    def _add_joints(self, standing: Standing, links: _Paths) -> None:
        source, joints = standing.source, _Paths(f"{links.above}/joints")
        self._stage.DefinePrim(joints.above, "Scope")
        add_fixed_base(
            self._stage, joints.of("fixed_to_world"), links.of(source.model.root), standing.base
        )
        for joint in source.model.ordered:
            ends = links.of(joint.parent), links.of(joint.child)
            home = standing.home.get(joint.name, 0.0)
            add_joint(self._stage, joints.of(joint.name), ends, joint, source, home)
        for joint in source.followers:
            prim = self._stage.GetPrimAtPath(joints.of(joint.name))
            tie(prim, joints.of(joint.mimics or ""), joint)

    def _add_mounts(self, standing: Standing, links: _Paths) -> None:
        """Define tool centre points and cameras, on the links that carry them."""
        for tool in self._cell.tools:
            if tool.place == standing.place:
                name = _identifier(f"tcp_{tool.arm}")
                made = UsdGeom.Xform.Define(self._stage, f"{links.of(tool.link)}/{name}")
                pose = np.eye(4)
                pose[:3, 3] = tool.position
                place(made, pose)
        for camera in standing.source.robot.cameras:
            path = f"{links.of(camera.link)}/camera_{_identifier(camera.name)}"
            add_camera(self._stage, path, camera)

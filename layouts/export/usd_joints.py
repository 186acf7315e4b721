"""Joints of a USD stage: frames, limits, drives, and what follows what.

USD counts turns in degrees. Joints turn about or slide along the x axis of frames on both links.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from layouts.export.cell import Drive, RobotSource
from layouts.export.usd_modules import usd_modules
from layouts.export.usd_shapes import quaternion
from robot_layouts.kinematics.rotations import Floats
from robots.urdf.model import ModelJoint


class UsdJoint:
    """A joint that is defined; `finish` gives it limits and a drive."""

    def __init__(self, prim: Any, kind: Any, per_unit: float) -> None:
        """Keep the prim.

        Args:
            prim: The joint's prim.
            kind: Its schema.
            per_unit: USD's units per unit of the joint: degrees per rad, or 1.
        """
        self.prim, self._kind, self._per_unit = prim, kind, per_unit

    def finish(
        self, joint: ModelJoint, drive: Drive | None, source: RobotSource, home: float
    ) -> None:
        """Give it limits, a drive, and its position at home.

        Args:
            joint: The joint.
            drive: How it is driven; None for one that is fixed or follows another.
            source: Its robot.
            home: Its position at home (rad or m).
        """
        if not joint.moves:
            return
        unit = self._per_unit
        if joint.lower is not None and joint.upper is not None:
            self._kind.CreateLowerLimitAttr(joint.lower * unit)
            self._kind.CreateUpperLimitAttr(joint.upper * unit)
        way = "linear" if joint.type == "prismatic" else "angular"
        self.prim.AddAppliedSchema(f"PhysicsJointStateAPI:{way}")
        self._set(f"state:{way}:physics:position", home * unit)
        self.prim.AddAppliedSchema("PhysxJointAPI")
        if joint.velocity:
            self._set("physxJoint:maxJointVelocity", joint.velocity * unit)
        own = source.drives.get(joint.name)
        if own is not None and own.armature:
            self._set("physxJoint:armature", own.armature)
        if own is not None and own.friction:
            self._set("physxJoint:jointFriction", own.friction)
        if drive is not None:
            self._drive(way, drive, home)

    def _drive(self, way: str, drive: Drive, home: float) -> None:
        UsdPhysics = usd_modules("UsdPhysics")

        api = UsdPhysics.DriveAPI.Apply(self.prim, way)
        api.CreateTypeAttr(UsdPhysics.Tokens.force)
        api.CreateStiffnessAttr(drive.stiffness / self._per_unit)
        api.CreateDampingAttr(drive.damping / self._per_unit)
        api.CreateMaxForceAttr(drive.force)
        api.CreateTargetPositionAttr(home * self._per_unit)

    def _set(self, name: str, value: float) -> None:
        Sdf = usd_modules("Sdf")

        self.prim.CreateAttribute(name, Sdf.ValueTypeNames.Float).Set(value)


def add_fixed_base(stage: Any, path: str, link: str, base: Floats) -> None:
    """Define the joint that fixes a robot to the world.

    Args:
        stage: The stage.
        path: Of the joint.
        link: Path of the root link.
        base: Pose of that link in the world, (4, 4) (m).
    """
    UsdPhysics = usd_modules("UsdPhysics")

    joint = UsdPhysics.FixedJoint.Define(stage, path)
    joint.CreateBody1Rel().SetTargets([link])
    _set_frames(joint, base, np.eye(3))


def add_joint(stage: Any, path: str, links: tuple[str, str], joint: ModelJoint) -> UsdJoint:
    """Define a joint between two links.

    Args:
        stage: The stage.
        path: Of the joint.
        links: Paths of the link that carries it, and of the one that it carries.
        joint: The joint.
    """
    UsdPhysics = usd_modules("UsdPhysics")

    kinds: dict[str, Any] = {
        "fixed": UsdPhysics.FixedJoint,
        "prismatic": UsdPhysics.PrismaticJoint,
    }
    made = kinds.get(joint.type, UsdPhysics.RevoluteJoint).Define(stage, path)
    made.CreateBody0Rel().SetTargets([links[0]])
    made.CreateBody1Rel().SetTargets([links[1]])
    if joint.moves:
        made.CreateAxisAttr(UsdPhysics.Tokens.x)
    _set_frames(made, joint.origin, _along(joint.axis) if joint.moves else np.eye(3))
    return UsdJoint(made.GetPrim(), made, 1.0 if joint.unit == "m" else math.degrees(1.0))


def tie(prim: Any, leader: str, joint: ModelJoint) -> None:
    """Make a joint follow another one, as PhysX reads it: own + gearing · other + offset = 0.

    Args:
        prim: The joint's prim.
        leader: Path of the joint that it follows.
        joint: The joint.
    """
    Sdf = usd_modules("Sdf")

    unit = 1.0 if joint.unit == "m" else math.degrees(1.0)
    prim.AddAppliedSchema("PhysxMimicJointAPI:rotX")
    numbers = {"gearing": -joint.multiplier, "offset": -joint.offset * unit}
    for name, value in numbers.items():
        attribute = prim.CreateAttribute(f"physxMimicJoint:rotX:{name}", Sdf.ValueTypeNames.Float)
        attribute.Set(value)
    prim.CreateRelationship("physxMimicJoint:rotX:referenceJoint").SetTargets([leader])
    axis = prim.CreateAttribute("physxMimicJoint:rotX:referenceJointAxis", Sdf.ValueTypeNames.Token)
    axis.Set("rotX")


def _set_frames(joint: Any, origin: Floats, turned: Floats) -> None:
    """Set a joint's frames on both links, the second at that link's origin."""
    Gf = usd_modules("Gf")

    joint.CreateLocalPos0Attr(Gf.Vec3f(*origin[:3, 3].tolist()))
    joint.CreateLocalRot0Attr(quaternion(origin[:3, :3] @ turned))
    joint.CreateLocalPos1Attr(Gf.Vec3f(0.0, 0.0, 0.0))
    joint.CreateLocalRot1Attr(quaternion(turned))


def _along(axis: tuple[float, float, float]) -> Floats:
    """Return a rotation whose x axis lies along an axis of length 1, (3, 3)."""
    x = np.array(axis)
    y = np.cross(np.eye(3)[int(np.argmin(np.abs(x)))], x)
    y /= np.linalg.norm(y)
    return np.column_stack([x, y, np.cross(x, y)])

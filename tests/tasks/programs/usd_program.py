"""usd-core reads stages of tasks' worlds: bodies, joints and shapes where the task has them."""

import sys
from pathlib import Path

import numpy as np
from pxr import Gf, Usd, UsdGeom, UsdPhysics

import tasks
from robot_layouts.kinematics.rotations import pose_matrix

SINGLE = 5e-6  # m; joints' frames have single precision
TASKS = ("CellCloseDrawers-v1", "RotateValveLevel2-v1", "PegInsertionSide-v1", "CellSqueezeBox-v1")


def check(task, folder):
    env = tasks.make(task)
    env.reset(seed=3)
    for _ in range(5):
        env.step(np.full((1, env.layout.action_dim), 0.3, np.float32))
    stage = Usd.Stage.Open(str(env.to_usd(folder / "world.usdc")))
    bodies = env.simulation.worlds[0].bodies
    root = stage.GetDefaultPrim().GetPath().AppendChild("bodies")
    prims = {
        prim.GetDisplayName(): prim
        for prim in stage.Traverse()
        if prim.GetPath().HasPrefix(root) and prim.IsA(UsdGeom.Xform) and prim.GetDisplayName()
    }
    assert prims.keys() == bodies.keys()
    cache = UsdGeom.XformCache()
    poses = {name: np.array(cache.GetLocalToWorldTransform(prim)).T for name, prim in prims.items()}
    for name, pose in poses.items():
        here = env.state.pose(name)[0]
        assert np.abs(pose - pose_matrix(here[:3], here[3:])).max() < SINGLE, name
        check_kind(bodies[name], prims[name])
        check_shapes(bodies[name], prims[name])
    joints = [UsdPhysics.Joint(prim) for prim in stage.Traverse() if is_of(prim, root)]
    jointed = [name for name, body in bodies.items() if body.joints]
    held = sum(bodies[name].kind != "dynamic" for name in jointed)
    assert len(joints) == sum(len(bodies[name].joints) for name in jointed) + held
    by_path = {prim.GetPath(): name for name, prim in prims.items()}
    for joint in joints:
        check_joint(joint, by_path, poses, bodies)
    print(f"{task}: {len(prims)} bodies, {len(joints)} joints", flush=True)


def is_of(prim, root):
    return prim.IsA(UsdPhysics.Joint) and prim.GetPath().HasPrefix(root)


def check_kind(body, prim):
    """What physics moves is a rigid body, what the task moves a kinematic one."""
    rigid = prim.HasAPI(UsdPhysics.RigidBodyAPI)
    stands = body.kind == "static" or (body.kind == "kinematic" and body.anchored)
    part = bool(body.joints or body.part_of)
    assert rigid == (part or not stands), body.name
    if rigid:
        kinematic = UsdPhysics.RigidBodyAPI(prim).GetKinematicEnabledAttr().Get()
        assert kinematic == (body.kind == "kinematic" and not part), body.name
    above = prim.GetParent().HasAPI(UsdPhysics.ArticulationRootAPI)
    assert above == part, body.name


def check_shapes(body, prim):
    """As many shapes collide, with the density and friction that they have here."""
    solid = [shape for shape in body.shapes if shape.collides]
    found = [own for own in Usd.PrimRange(prim) if own.HasAPI(UsdPhysics.CollisionAPI)]
    assert len(found) >= len(solid), body.name
    if not solid:
        return
    densities = {shape.density for shape in solid}
    for own in found:
        assert UsdPhysics.MassAPI(own).GetDensityAttr().Get() in densities
        material = own.GetRelationship("material:binding:physics").GetTargets()[0]
        rough = UsdPhysics.MaterialAPI(own.GetStage().GetPrimAtPath(material))
        static = rough.GetStaticFrictionAttr().Get()
        assert any(
            shape.friction is None or np.isclose(shape.friction.static, static) for shape in solid
        )


def frame(position, rotation):
    quaternion = np.array([rotation.GetReal(), *rotation.GetImaginary()], float)
    return pose_matrix(list(position), quaternion / np.linalg.norm(quaternion))


def check_joint(joint, by_path, poses, bodies):
    """A joint, at the position that it says, puts its bodies where they are."""
    ends = [rel.GetTargets() for rel in (joint.GetBody0Rel(), joint.GetBody1Rel())]
    before = poses[by_path[ends[0][0]]] if ends[0] else np.eye(4)
    after = poses[by_path[ends[1][0]]]
    one = frame(joint.GetLocalPos0Attr().Get(), joint.GetLocalRot0Attr().Get())
    other = frame(joint.GetLocalPos1Attr().Get(), joint.GetLocalRot1Attr().Get())
    prim, motion = joint.GetPrim(), np.eye(4)
    if prim.IsA(UsdPhysics.RevoluteJoint):
        degrees = prim.GetAttribute("state:angular:physics:position").Get()
        motion[:3, :3] = np.array(Gf.Matrix3d(Gf.Rotation(Gf.Vec3d(1, 0, 0), degrees))).T
    elif prim.IsA(UsdPhysics.PrismaticJoint):
        motion[0, 3] = prim.GetAttribute("state:linear:physics:position").Get()
    assert np.abs(before @ one @ motion @ np.linalg.inv(other) - after).max() < 2e-5, prim.GetPath()
    if ends[0]:
        name, own = by_path[ends[1][0]].split(".")
        declared = next(j for j in bodies[name].joints if j.name == own)
        assert prim.HasAPI(UsdPhysics.DriveAPI) == bool(declared.stiffness or declared.damping)


for one in TASKS:
    check(one, Path(sys.argv[1]))

"""usd-core reads exported stages: links at home, joints, filtered pairs and drives."""

import sys
from itertools import combinations
from pathlib import Path

import numpy as np
from pxr import Gf, Usd, UsdGeom, UsdPhysics

from layouts.export.cell import ExportedCell
from robot_layouts.kinematics.rotations import pose_matrix
from robots.bodies.hulls import load_model
from tests.layouts.travelling import EXACT, cells, draws

SINGLE = 5e-6  # m; joints' frames have single precision


def check(name, layout, folder):
    path = layout.to_usd(folder / f"{name}.usd", visuals=False)
    stage = Usd.Stage.Open(str(path))
    assert UsdGeom.GetStageUpAxis(stage) == "Z"
    assert UsdGeom.GetStageMetersPerUnit(stage) == UsdPhysics.GetStageKilogramsPerUnit(stage) == 1
    cell = ExportedCell.read(layout, visuals=False)
    home = {
        (place, link): pose
        for place, standing in cell.robots.items()
        for link, pose in standing.poses.items()
    }
    links = links_of(stage, cell)
    assert links.keys() == home.keys()
    cache = UsdGeom.XformCache()
    worst = max(
        np.abs(np.array(cache.GetLocalToWorldTransform(prim)).T - home[key]).max()
        for key, prim in links.items()
    )
    assert worst < EXACT, (name, worst)
    joints = joints_of(stage, links)
    assert len(joints) == len(links)  # one to the world for each robot
    moved = max(compare(joints, links, *draw) for draw in draws(cell, 10))
    assert moved < SINGLE, (name, moved)
    check_pairs(cell, links)
    check_drives(stage, cell)
    print(f"{name}: {worst:.1e} m at home, {moved:.1e} m by its joints", flush=True)


def links_of(stage, cell):
    """Return the prim of each link, by place and the link's name."""
    root = stage.GetDefaultPrim()
    return {
        (place, prim.GetDisplayName()): prim
        for place in cell.robots
        for prim in root.GetChild(place).GetChildren()
        if prim.HasAPI(UsdPhysics.RigidBodyAPI)
    }


def joints_of(stage, links):
    """Return for each link its joint, that joint's name, and the link that carries it."""
    by_path = {prim.GetPath(): key for key, prim in links.items()}
    found = {}
    for prim in stage.Traverse():
        if prim.IsA(UsdPhysics.Joint):
            joint = UsdPhysics.Joint(prim)
            parents, (child,) = (
                rel.GetTargets() for rel in (joint.GetBody0Rel(), joint.GetBody1Rel())
            )
            found[by_path[child]] = (prim, by_path[parents[0]] if parents else None)
    return found


def frame(position, rotation):
    quaternion = np.array([rotation.GetReal(), *rotation.GetImaginary()], float)
    return pose_matrix(list(position), quaternion / np.linalg.norm(quaternion))


def compare(joints, links, positions, poses):
    """Return how far links are from where the stage's joints put them."""
    return max(np.abs(placed(key, joints, positions) - poses[key])[:3, 3].max() for key in links)


def placed(key, joints, positions):
    prim, parent = joints[key]
    joint = UsdPhysics.Joint(prim)
    before = np.eye(4) if parent is None else placed(parent, joints, positions)
    one = frame(joint.GetLocalPos0Attr().Get(), joint.GetLocalRot0Attr().Get())
    other = frame(joint.GetLocalPos1Attr().Get(), joint.GetLocalRot1Attr().Get())
    motion = np.eye(4)
    value = positions.get((key[0], prim.GetDisplayName()), 0.0)
    if prim.IsA(UsdPhysics.RevoluteJoint):
        turn = Gf.Rotation(Gf.Vec3d(1, 0, 0), np.degrees(value))
        motion[:3, :3] = np.array(Gf.Matrix3d(turn)).T
    elif prim.IsA(UsdPhysics.PrismaticJoint):
        motion[0, 3] = value
    return before @ one @ motion @ np.linalg.inv(other)


def check_pairs(cell, links):
    """Of two links of a robot, those are not filtered that `Layout.validate` counts."""
    filtered = set()
    for prim in links.values():
        for other in UsdPhysics.FilteredPairsAPI(prim).GetFilteredPairsRel().GetTargets():
            filtered.add(frozenset((prim.GetPath(), other)))
    for place, standing in cell.robots.items():
        own = load_model(standing.placement.robot)
        counted = {
            frozenset(links[place, own.link_name(hull)].GetPath() for hull in pair)
            for pair in own.self_pairs
        }
        solid = [links[place, link].GetPath() for link in standing.source.model.collisions]
        assert {frozenset(pair) for pair in combinations(solid, 2)} - filtered == counted


def check_drives(stage, cell):
    found = {}
    for prim in stage.Traverse():
        for way in ("angular", "linear"):
            if prim.HasAPI(UsdPhysics.DriveAPI, way):
                unit = 180 / np.pi if way == "angular" else 1.0
                drive = UsdPhysics.DriveAPI(prim, way)
                place = prim.GetParent().GetParent().GetName()
                found[place, prim.GetDisplayName()] = (
                    drive.GetStiffnessAttr().Get() * unit,
                    drive.GetDampingAttr().Get() * unit,
                    drive.GetMaxForceAttr().Get(),
                    drive.GetTargetPositionAttr().Get() / unit,
                )
    expected = {}
    for place, standing in cell.robots.items():
        for joint in standing.source.leaders:
            drive = standing.source.drives[joint]
            numbers = (drive.stiffness, drive.damping, drive.force, standing.home[joint])
            expected[place, joint] = numbers
    assert found.keys() == expected.keys()
    for key, numbers in expected.items():
        np.testing.assert_allclose(found[key], numbers, rtol=1e-6, atol=1e-9)


for cell_name, cell_layout in cells(sys.argv[2:]).items():
    check(cell_name, cell_layout, Path(sys.argv[1]))

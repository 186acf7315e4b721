"""Exported cells in MuJoCo itself: joints go as fast as in SAPIEN, and grippers lift a cube."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from layouts import single
from robot_layouts.kinematics.rotations import quaternion_of
from robot_layouts.simulation import PhysicsSettings, build_scene

HALF, DENSITY = 0.02, 1000.0  # of the cube: half a side (m), and kg/m³, as ManiSkill's
CLOSING, LIFTING = 0.8, 1.5  # s
SPLAYED, SLIPPED, RAISED = 1e-4, 0.003, 0.15  # m
# Below and above the way at which the drive comes to its force limit, and far above.
STEPS = (0.0999, 0.11, 0.5)  # rad
SLOWEST, FASTEST = 0.9, 1.02  # times SAPIEN's speed, which takes springs implicitly, too
SECONDS = 0.4


def exported(robot, folder):
    path = single({"arm": robot}).to_mjcf(folder / "cell.xml", visuals=False)
    return mujoco.MjSpec.from_file(str(path))


def at_home(model):
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    return data


def advance(model, data, seconds):
    """Step for a while, and return the largest speed of each joint (rad/s, m/s)."""
    fastest = np.zeros(model.nv)
    for _ in range(round(seconds / model.opt.timestep)):
        mujoco.mj_step(model, data)
        fastest = np.maximum(fastest, np.abs(data.qvel))
    assert not any(warning.number for warning in data.warning)
    return fastest


def add_cube(spec, place, turn):
    """Stand a cube in the gripper, on a column."""
    box, height = mujoco.mjtGeom.mjGEOM_BOX, (place[2] - HALF) / 2
    spec.worldbody.add_geom(type=box, size=[0.01, 0.01, height], pos=[*place[:2], height])
    cube = spec.worldbody.add_body(name="cube", pos=place, quat=turn)
    cube.add_freejoint()
    cube.add_geom(type=box, size=[HALF] * 3, density=DENSITY)
    spec.keys[0].qpos = [*spec.keys[0].qpos, *place, *turn]


@pytest.mark.parametrize(
    ("robot", "lifts", "by"),
    [("panda", "panda_joint2", -0.4), ("fetch", "shoulder_lift_joint", -0.3)],
)
def test_a_gripper_lifts_a_cube(robot, lifts, by, tmp_path):
    spec = exported(robot, tmp_path)
    tcp = at_home(spec.compile()).site("arm/tcp")
    start, turn = tcp.xpos.copy(), quaternion_of(tcp.xmat.reshape(3, 3))
    add_cube(spec, start, turn)
    model = spec.compile()
    data = at_home(model)
    tcp, cube = data.site("arm/tcp"), data.body("cube")
    fingers = single({"arm": robot})["arm"].robot.action_split.groups["gripper"].joints

    def held():
        return tcp.xmat.reshape(3, 3).T @ (cube.xpos - tcp.xpos)

    for finger in fingers:
        data.actuator(f"arm/{finger}").ctrl = 0.0
    advance(model, data, CLOSING)
    gripped = held()
    data.actuator(f"arm/{lifts}").ctrl += by
    advance(model, data, LIFTING)
    one, other = (data.joint(f"arm/{finger}").qpos.item() for finger in fingers)
    assert abs(one - other) < SPLAYED
    assert np.abs(held() - gripped).max() < SLIPPED
    assert cube.xpos[2] - start[2] > RAISED


def sapiens_speed(layout, joint, step, timestep):
    """Return the largest speed of any joint in SAPIEN while one goes a step (rad/s, m/s)."""
    scene = build_scene(layout, PhysicsSettings(timestep=timestep))
    (robot,) = scene.get_all_articulations()
    (driven,) = (found for found in robot.active_joints if found.name == joint)
    driven.set_drive_target(float(driven.drive_target[0]) + step)
    fastest = 0.0
    for _ in range(round(SECONDS / timestep)):
        scene.step()
        fastest = max(fastest, np.abs(robot.qvel).max())
    return fastest


@pytest.mark.parametrize(
    ("robot", "joint"),
    [("panda", "panda_joint5"), ("panda", "panda_joint7"), ("so100", "elbow_flex")],
)
def test_a_step_moves_joints_as_fast_as_in_sapien(robot, joint, tmp_path):
    model = exported(robot, tmp_path).compile()
    for step in STEPS:
        expected = sapiens_speed(single({"arm": robot}), joint, step, model.opt.timestep)
        data = at_home(model)
        data.actuator(f"arm/{joint}").ctrl += step
        fastest = advance(model, data, SECONDS).max()
        assert SLOWEST < fastest / expected < FASTEST, step

"""Whether a URDF that was made of an MJCF moves as MuJoCo moves the MJCF."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from kinematics.rotations import Floats, inverse_pose
from robots.mjcf.conversion import convert, locate
from robots.mjcf.couplings import find_couplings
from robots.mjcf.reading import compiled, mujoco, read_mjcf
from robots.mjcf.robot import find_robot
from robots.urdf.reading import read_model
from robots.urdf.summary import read_urdf
from robots.urdf.tree import kinematic_tree

POSTURES = 100  # random ones


def largest_difference(path: Path, postures: int = POSTURES) -> float:
    """Return by how much the poses of bodies differ at most, seen from the first body.

    Each joint stands anywhere within its limits, also those that follow others. Compared is every
    entry of the pose matrices: places (m), and the axes' directions.

    Args:
        path: The MJCF.
        postures: How many.

    Raises:
        RobotLayoutsError: If it cannot be converted.
    """
    model: Any = compiled(read_mjcf(path), path)
    robot, urdf, frames = find_robot(model, path), locate(path), convert(path).frames
    fixed = find_couplings(robot, path).fixed
    tree = kinematic_tree(read_model(read_urdf(urdf), urdf.as_posix()))
    generator, data, largest = np.random.default_rng(0), mujoco().MjData(model), 0.0
    for _ in range(postures):
        qpos = np.zeros(len(tree.coordinates))
        data.qpos[:] = model.qpos0
        for joint, name in robot.names.items():
            at = fixed.get(joint, generator.uniform(*_span(model, joint)))
            data.qpos[model.jnt_qposadr[joint]] = at
            if joint not in fixed:
                qpos[tree.coordinates.index(name)] = at
        mujoco().mj_kinematics(model, data)
        poses = tree.forward(qpos[None])[0]
        ours = [poses[tree.link(robot.links[b])] @ frames[robot.links[b]] for b in robot.bodies]
        theirs = [_pose(data, body) for body in robot.bodies]
        largest = max(largest, _difference(np.array(ours), np.array(theirs)))
    return largest


def _difference(ours: Floats, theirs: Floats) -> float:
    sides = [inverse_pose(poses[0]) @ poses for poses in (ours, theirs)]
    return float(np.abs(sides[0] - sides[1]).max())


def _pose(data: Any, body: int) -> Floats:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = data.xmat[body].reshape(3, 3), data.xpos[body]
    return pose


def _span(model: Any, joint: int) -> tuple[float, float]:
    low, high = model.jnt_range[joint].tolist() if model.jnt_limited[joint] else (-math.pi, math.pi)
    return low, high

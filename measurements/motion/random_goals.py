"""Goals of all arms of a cell: those that a posture stands for, and some that nothing can reach."""

from __future__ import annotations

import numpy as np

from kinematics.rotations import Floats, quaternion_of
from motion import TcpGoal
from motion.collision.cell import Cell
from motion.planning.goals import Goal, arm_joints
from robots.urdf.tcp import find_tcp

BEYOND = 1.5  # of an arm's reach: where nothing gets


def goals_at(cell: Cell, end: Floats, *, tcp: bool) -> dict[str, Goal]:
    """Return the goals of all arms that a posture, (D,), stands for."""
    found: dict[str, Goal] = {}
    poses = cell.poses(end[None]) if tcp else None
    for name, placement in cell.layout.items():
        robot, own = placement.robot, end[cell.slices[name]]
        if poses is None:
            found[name] = [float(own[robot.joints.index(joint)]) for joint in arm_joints(robot)]
            continue
        tree = cell.models[name].kinematics
        point = find_tcp(robot, tree)
        first = cell.links.index((name, tree.links[0]))
        links = poses[:, first : first + len(tree.links)]
        found[name] = TcpGoal(
            point.places(links)[0].tolist(), quaternion_of(links[0, point.turned, :3, :3]).tolist()
        )
    return found


def out_of_reach(cell: Cell, end: Floats) -> dict[str, Goal]:
    """Return goals as TCP poses, the last arm's beyond its reach."""
    found = goals_at(cell, end, tcp=True)
    name = cell.robots[-1]
    base, reach = cell.layout[name].base_position, cell.layout[name].robot.reach
    found[name] = TcpGoal((float(base[0]) + BEYOND * reach, float(base[1]), 0.2))
    return found


def in_collision(cell: Cell, end: Floats, seed: int) -> dict[str, Goal]:
    """Return goals as joint positions, in which the last arm overlaps with something.

    Args:
        cell: The cell.
        end: A posture, (D,) (rad, m), in which nothing does.
        seed: Of everything random.
    """
    name, state = cell.robots[-1], end.copy()
    robot, first = cell.layout[name].robot, cell.slices[name].start
    columns = [first + robot.joints.index(joint) for joint in arm_joints(robot)]
    checker, random = cell.checker([name]), np.random.default_rng(seed)
    low, high = np.clip(cell.limits, cell.start[:, None] - np.pi, cell.start[:, None] + np.pi).T
    while checker.free(state[None])[0]:
        state[columns] = random.uniform(low[columns], high[columns])
    return goals_at(cell, state, tcp=False)

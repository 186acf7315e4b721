"""A robot's TCP driven along a square by end-effector control."""

from __future__ import annotations

import numpy as np

from layouts import Layout, Placement
from robot_layouts.kinematics.rotations import inverse, multiply, rotate, rotation_of
from robot_layouts.simulation import PhysicsSettings, Simulation

CORNERS = ((0, 0), (1, 0), (1, 1), (0, 1), (0, 0))
STEPS, REST = 20, 20  # of a side, and at its end
FAR = 0.1  # m per step, of an action number of 1


def farthest_off(robot, mode, side=0.05):
    """How far the TCP is from where it was sent, at rest in the corners of a square (m), at most.

    The square stands upright, and begins where the TCP is, which keeps its orientation.
    """
    layout = Layout({"arm": Placement(robot)}).in_control_mode(mode)
    simulation = Simulation(layout, lambda world, _: None, 1, PhysicsSettings())
    simulation.worlds[0].stand("arm", layout["arm"].start_qpos)
    start = simulation.read().tcp_pose("arm")[0].astype(float)
    before, off = start[:3], []
    for (y0, z0), (y1, z1) in zip(CORNERS, CORNERS[1:], strict=False):
        for step in range(STEPS + REST):
            share = min((step + 1) / STEPS, 1.0)
            at = start[:3] + side * np.array([0, y0 + share * (y1 - y0), z0 + share * (z1 - z0)])
            state = simulation.read()
            now = before if "target" in mode else state.tcp_position("arm")[0]
            action = _action(simulation, mode, state, at, at - now, start[3:])
            simulation.step(action[None].astype(np.float32), state.joint_positions)
            before = at
        off.append(np.linalg.norm(simulation.read().tcp_position("arm")[0] - before))
    return float(max(off))


def _action(simulation, mode, state, at, way, turn):
    action = np.zeros(simulation.layout.action_dim)
    base = state.base_pose("arm")[0].astype(float)
    back = inverse(base[3:])
    split = simulation.layout["arm"].robot.action_split
    numbers = next(split[name] for name, group in split.groups.items() if group.asks.tcp)
    if "delta" in mode:
        action[numbers.start : numbers.start + 3] = np.clip(rotate(back, way) / FAR, -1, 1)
        return action
    matrix = rotation_of(multiply(back, turn))
    angles = (
        np.arctan2(-matrix[1, 2], matrix[2, 2]),
        np.arcsin(np.clip(matrix[0, 2], -1, 1)),
        np.arctan2(-matrix[0, 1], matrix[0, 0]),
    )
    action[numbers] = *rotate(back, at - base[:3]), *angles
    return action

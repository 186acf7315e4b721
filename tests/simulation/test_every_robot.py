"""Every robot of the catalogue stands, and each of its action numbers moves its own joints."""

from __future__ import annotations

import functools

import numpy as np
import pytest

from layouts import single
from robots import ActionNumber, RobotRegistry
from robots.registry import CATALOGUE
from robots.urdf_xml import parse_urdf
from simulation import PhysicsSettings, Simulation
from simulation.controller import JointPositionController

ROBOTS = tuple(CATALOGUE)
STEPS = 5


@functools.cache
def simulation_of(robot: str) -> Simulation:
    return Simulation(single({"arm": robot}), lambda world, _: None, 1, PhysicsSettings())


def stand(robot: str, keyframe: str | None = None) -> tuple[Simulation, np.ndarray]:
    """Stand the robot at a keyframe; return joint positions in the descriptor's order."""
    simulation = simulation_of(robot)
    placement = simulation.layout["arm"]
    start = np.array(placement.robot.keyframe(keyframe) if keyframe else placement.start_qpos)
    for world in simulation.worlds:
        world.robots["arm"].reset(start)
    simulation.touched()
    return simulation, start


def qpos(simulation: Simulation) -> np.ndarray:
    """Joint positions in the descriptor's order."""
    order = simulation.worlds[0].robots["arm"].active_index
    return simulation.read().joint_positions[0, order]


def play(simulation: Simulation, action: np.ndarray, steps: int) -> np.ndarray:
    for _ in range(steps):
        simulation.step(action[None], simulation.read().joint_positions)
    return qpos(simulation)


def staying(robot: str, start: np.ndarray) -> np.ndarray:
    """Return the action that asks for nothing: 0, or the position itself where it is absolute."""
    descriptor = RobotRegistry.load(robot)
    action = np.zeros(descriptor.action_dim, np.float32)
    for number in descriptor.describe_action():
        if not number.relative:
            value = start[descriptor.joints.index(number.joints[0])]
            middle = (number.upper + number.lower) / 2
            action[number.index] = (value - middle) / ((number.upper - number.lower) / 2)
    return action


def numbers() -> list[tuple[str, ActionNumber]]:
    return [(name, n) for name in ROBOTS for n in RobotRegistry.load(name).describe_action()]


@pytest.mark.parametrize("robot", ROBOTS)
def test_every_collision_shape_of_its_urdf_is_there(robot):
    root = parse_urdf(RobotRegistry.load(robot).urdf.locate().read_bytes(), robot)
    expected = {str(e.get("name")): len(e.findall("collision")) for e in root.iterfind("link")}
    links = simulation_of(robot).worlds[0].robots["arm"].links
    assert {name: len(link.collision_shapes) for name, link in links.items()} == expected
    assert sum(expected.values()) > 0


@pytest.mark.parametrize("robot", ROBOTS)
def test_it_stays_at_every_keyframe(robot):
    for keyframe in RobotRegistry.load(robot).keyframes:
        simulation, start = stand(robot, keyframe)
        after = play(simulation, staying(robot, start), 20)
        np.testing.assert_allclose(after, start, atol=0.02, err_msg=keyframe)


@pytest.mark.parametrize(("robot", "number"), numbers(), ids=lambda x: getattr(x, "name", x))
def test_an_action_number_moves_its_own_joints_and_no_others(robot, number):
    simulation, start = stand(robot)
    still = staying(robot, start)
    mine = [simulation.layout["arm"].robot.joints.index(joint) for joint in number.joints]
    joints = simulation.worlds[0].robots["arm"].driven
    low, high = np.concatenate([joints[i].limits for i in mine]).min(0)
    room_above = high - start[mine[0]] > start[mine[0]] - low
    action = still.copy()
    action[number.index] = 0.8 if room_above else -0.8

    controller = JointPositionController(simulation.layout, simulation.worlds)
    now = simulation.read().joint_positions
    change = controller.targets(action[None], now) - controller.targets(still[None], now)
    assert np.flatnonzero(change[0]).tolist() == mine

    moved = np.abs(play(simulation, action, STEPS) - start)
    own, others = moved[mine], np.delete(moved, mine)
    assert (own > 0.003).all()
    assert others.max(initial=0.0) < 0.4 * max(own.max(), 0.02)

"""Robots move as native's agents do, to the last bit: in the air, or on a floor if they drive."""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np
import pytest
import sapien

from layouts import Layout, Placement
from robot_layouts.simulation import PhysicsSettings, Simulation
from robot_layouts.simulation.checks.trial import adds_floor
from robot_layouts.simulation.sapien3.backend import worlds_below
from robots import CONTROL_MODES, RobotDescriptor, RobotRegistry
from tests.native import NATIVE
from tests.quick import quick_cases

pytestmark = NATIVE

STEPS = 100
HEIGHT = 1.5  # m over native's ground, so that nothing touches it
ON_FLOOR = ("fetch", "fetch_driving")
AGENTS = {
    "allegro_hand_left": "allegro_hand_left",
    "allegro_hand_right": "allegro_hand_right",
    "dclaw": "dclaw",
    "fetch": "fetch",
    "fetch_driving": "fetch",
    "floating_panda_gripper": "floating_panda_gripper",
    "koch": "koch-v1.1",
    "panda": "panda",
    "panda_stick": "panda_stick",
    "panda_wristcam": "panda_wristcam",
    "so100": "so100",
    "trifingerpro": "trifingerpro",
    "unitree_g1_simplified_upper_body_with_head_camera": (
        "unitree_g1_simplified_upper_body_with_head_camera"
    ),
}
BASE_NUMBERS = {"fetch": 2}  # of native's action, at its end; here the base stands still


DELTAS = CONTROL_MODES[0]
# A root link that moves, and nine joints without an arm. The long tests try every mode that
# native's agent has.
MODES = (("fetch", "pd_ee_delta_pose"), ("trifingerpro", "pd_joint_delta_pos_vel"))
HANDS = dict.fromkeys(("allegro_hand_left", "dclaw", "koch", "so100"), CONTROL_MODES[1:3])
OFFERED = {
    **HANDS,
    "fetch": [m for m in CONTROL_MODES if m not in ("pd_ee_pose", "pd_joint_pos_vel")],  # NaN there
    "panda": CONTROL_MODES,
    "panda_stick": CONTROL_MODES,
    "panda_wristcam": CONTROL_MODES,
    "trifingerpro": CONTROL_MODES[:6],
    "unitree_g1_simplified_upper_body_with_head_camera": CONTROL_MODES[:2],
}


def native_motion(name: str, actions: np.ndarray, mode: str = DELTAS) -> np.ndarray:
    """Return qpos and qvel after every step, (steps, 2, dof), SAPIEN's order."""
    import gymnasium
    import mani_skill.envs  # noqa: F401
    import torch

    env = gymnasium.make(
        "Empty-v1",
        robot_uids=AGENTS[name],
        control_mode=mode,
        sim_backend="physx_cpu",
        reconfiguration_freq=0,
    )
    native = env.unwrapped
    native.reset(seed=0)
    agent = native.agent
    agent.reset(torch.from_numpy(start(name)[None]))
    agent.robot.set_pose(pose(name))
    agent.controller.reset()
    assert [joint.name for joint in agent.robot.active_joints] == active(name)
    rows = []
    for action in actions:
        native.step(np.concatenate([action, np.zeros(BASE_NUMBERS.get(name, 0), np.float32)]))
        rows.append([agent.robot.get_qpos()[0].numpy(), agent.robot.get_qvel()[0].numpy()])
    env.close()
    return np.array(rows)


def ours(robot: str | RobotDescriptor, mode: str = DELTAS) -> Simulation:
    layout = Layout({"arm": Placement(robot)}).in_control_mode(mode)
    return Simulation(layout, adds_floor(0.0), 1, PhysicsSettings())


def pose(name: str) -> sapien.Pose:
    return sapien.Pose([0.0, 0.0, 0.0 if name in ON_FLOOR else HEIGHT])


@functools.cache
def active(name: str) -> list[str]:
    return [joint.name for joint in worlds_below(ours(name))[0].robots["arm"].joints]


def start(name: str) -> np.ndarray:
    """Return the first keyframe in SAPIEN's order."""
    robot = RobotRegistry.load(name)
    qpos = dict(zip(robot.joints, next(iter(robot.keyframes.values())), strict=True))
    return np.array([qpos[joint] for joint in active(name)], np.float32)


def our_motion(robot: str | RobotDescriptor, actions: np.ndarray, mode: str = DELTAS) -> np.ndarray:
    simulation = ours(robot, mode)
    arm = worlds_below(simulation)[0].robots["arm"]
    arm.reset(next(iter(arm.descriptor.keyframes.values())))
    arm.articulation.set_root_pose(pose(arm.descriptor.name))  # built elsewhere, as native
    simulation.touched()
    rows = []
    for action in actions:
        simulation.step(action[None], simulation.read().joint_positions)
        rows.append([arm.articulation.get_qpos(), arm.articulation.get_qvel()])
    return np.array(rows)


def random_actions(name: str, mode: str = DELTAS) -> np.ndarray:
    """Return actions a little beyond their bounds; those for poses ask for places in reach."""
    robot = RobotRegistry.load(name).in_control_mode(mode)
    low, high = np.array(robot.action_bounds).T
    actions = np.random.default_rng(0).uniform(1.2 * low, 1.2 * high, (STEPS, robot.action_dim))
    if mode == "pd_ee_pose":
        actions[:, :6] = (0.5, 0.0, 0.4, np.pi, 0.0, 0.0) + actions[:, :6] / 30
    return actions.astype(np.float32)


def expect_native(name: str, mode: str = DELTAS) -> None:
    actions = random_actions(name, mode)
    expected = native_motion(name, actions, mode)
    assert np.abs(expected[-1, 0] - expected[0, 0]).max() > 0.1
    np.testing.assert_array_equal(our_motion(name, actions, mode), expected)


# The comparisons of the clones move the Pandas and the SO100.
@pytest.mark.parametrize("name", quick_cases(AGENTS, ["floating_panda_gripper"]))
def test_a_robot_moves_as_its_native_agent(name):
    expect_native(name)


@pytest.mark.parametrize(("name", "mode"), MODES)
def test_a_robot_moves_as_its_native_agent_in_a_mode(name, mode):
    expect_native(name, mode)


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "mode"), [(n, mode) for n, own in OFFERED.items() for mode in own]
)
def test_a_robot_moves_as_its_native_agent_in_every_mode(name, mode):
    expect_native(name, mode)


@pytest.mark.parametrize(
    ("name", "group", "change"),
    [
        ("koch", "gripper", {"stiffness": 93.4}),
        ("fetch", "base_turn", {"damping": 990.0}),
        ("floating_panda_gripper", "rotation", {"upper": 0.101}),
    ],
)
def test_a_robot_that_is_driven_otherwise_is_told_apart(name, group, change):
    actions = random_actions(name)
    robot = RobotRegistry.load(name)
    other = replace(robot.action_split.groups[group], **change)
    mutant = replace(robot, action_split=robot.action_split.replace(**{group: other}))
    assert not np.array_equal(our_motion(mutant, actions), our_motion(robot, actions))

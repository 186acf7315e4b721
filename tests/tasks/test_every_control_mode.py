"""Every control mode of ManiSkill's is native's to the last bit, and each arm may have its own."""

from __future__ import annotations

from contextlib import closing
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
import torch

import tasks
from parity.episodes import random_episodes
from parity.lockstep import HISTORIES, NativeSide
from robot_layouts.data.playing.mode_conversion import converted_steps
from robots import (
    CONTROL_MODES,
    ActionError,
    DescriptorError,
    RobotDescriptor,
    RobotRegistry,
    TaskError,
    UnknownNameError,
)
from tasks.episode import Episode, play
from tasks.registry import make_scenario
from tests.motions import touching_episode
from tests.native import NATIVE, TASKS, complaints, pair
from tests.quick import quick_cases
from tests.simulation.test_tcp_control import alone
from tests.tasks.test_native_camera_settings import leaves

SAMPLE = (
    ("TwoRobotPickCube-v1", "pd_joint_pos"),
    ("PickCube-v1", "pd_ee_delta_pose"),
    ("PickCube-v1", "pd_ee_target_delta_pos"),
    ("PickCubeSO100-v1", "pd_joint_target_delta_pos"),
    ("PushT-v1", "pd_joint_pos_vel"),
)
ARMS = ("PickCube-v1", "TwoRobotPickCube-v1", "StackCube-v1", "PegInsertionSide-v1", "PushT-v1")
# Random positions drive its light fingers against the counter, where physics diverges.
DIVERGES = ("UnitreeG1PlaceAppleInBowl-v1",)
EVERY = (
    *((task_id, "pd_joint_pos") for task_id in TASKS if task_id not in DIVERGES),
    *product(ARMS, CONTROL_MODES[2:]),
)
MIXED = {"left": "pd_ee_target_delta_pose", "right": "pd_joint_pos"}


def episodes(task_id, mode, steps):
    """Random actions beyond their bounds, and the task's scripted contact in the mode."""
    layout = pair(task_id, control_mode=mode).ours.env.layout
    found = random_episodes((1,), steps, layout.action_dim, layout.action_bounds)
    with (
        closing(tasks.make(task_id, obs_mode="none")) as source,
        closing(tasks.make(task_id, obs_mode="none", control_mode=mode)) as task,
    ):
        actions, _ = converted_steps(source, 1, touching_episode(task_id, 1).actions, task)
    return [*found, Episode(1, actions)]


def expect_native(task_id, mode, history, steps):
    results = pair(task_id, control_mode=mode).play(episodes(task_id, mode, steps), history)
    assert complaints(results) == []
    if task_id in ARMS:
        assert sum(result.contact_steps for result in results) >= 5, "hardly anything was touched"


class TestNative:
    pytestmark = NATIVE

    @pytest.mark.parametrize(("task_id", "mode"), quick_cases(SAMPLE, SAMPLE[:2]))
    def test_a_sample(self, task_id, mode):
        expect_native(task_id, mode, "fresh", 20)
        native, ours = pair(task_id, control_mode=mode)
        theirs = native.envs[0].single_action_space
        spaces = list(theirs.values()) if hasattr(theirs, "values") else [theirs]
        space = ours.env.single_action_space
        np.testing.assert_array_equal(space.low, np.concatenate([s.low for s in spaces]))
        np.testing.assert_array_equal(space.high, np.concatenate([s.high for s in spaces]))
        expected = leaves(native.envs[0].get_state_dict().get("controller", {}))
        found = leaves(ours.env.get_state_dict().get("controller", {}))
        assert list(found) == list(expected)
        assert all(torch.equal(found[name], expected[name]) for name in found)

    @pytest.mark.long
    @pytest.mark.parametrize("history", HISTORIES)
    @pytest.mark.parametrize(("task_id", "mode"), EVERY)
    def test_every_mode(self, task_id, mode, history):
        expect_native(task_id, mode, history, 60)

    def test_a_mode_for_each_arm(self):
        task_id = "TwoRobotPickCube-v1"
        native = NativeSide(task_id).envs[0]
        native.agent.set_control_mode([MIXED["left"], MIXED["right"]])
        with closing(tasks.make(task_id, control_mode=MIXED)) as ours:
            expected, _ = native.reset(seed=3)
            found, _ = ours.reset(seed=3)
            np.testing.assert_array_equal(found, expected)
            rng = np.random.default_rng(0)
            for _ in range(25):
                action = rng.uniform(-1, 1, (1, 15)).astype(np.float32)
                by_robot = {name: action[:, part] for name, part in ours.action_split.items()}
                uids = zip(native.agent.agents_dict, by_robot.values(), strict=True)
                expected = native.step({uid: torch.from_numpy(a) for uid, a in uids})[0]
                found = ours.step(by_robot)[0]
                np.testing.assert_array_equal(found, expected)
            expected, found = (leaves(env.get_state_dict()) for env in (native, ours))
            assert list(found) == list(expected)
            assert all(torch.equal(found[name], expected[name]) for name in found)
        native.close()


# -- targets -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("mode", "kind", "size"),
    [
        ("pd_joint_target_delta_pos", "target_qpos", 7),
        ("pd_ee_target_delta_pose", "target_pose", 7),
    ],
)
def test_targets_are_part_of_the_state(mode, kind, size):
    with (
        closing(tasks.make("PickCube-v1", control_mode=mode, obs_mode="state_dict")) as one,
        closing(tasks.make("PickCube-v1", control_mode=mode, num_envs=2)) as other,
    ):
        width = one.layout.action_dim
        obs = one.step(np.full((1, width), 0.5, np.float32))[0]
        state = one.get_state_dict()
        target = state["controller"]["arm"][kind]
        assert target.shape == (1, size)
        assert torch.equal(obs["agent"]["controller"]["arm"][kind], target)
        other.set_state_dict(state, env_ids=[1])
        rows = other.get_state_dict()["controller"]["arm"][kind]
        assert torch.equal(rows[1], target[0])
        assert not torch.equal(rows[0], target[0])
        without = {name: rows for name, rows in state.items() if name != "controller"}
        other.set_state_dict(without, env_ids=[0])
        assert torch.equal(other.get_state_dict()["controller"]["arm"][kind], rows)
        with pytest.raises(TaskError, match=f"controller/arm/{kind}.*nan"):
            other.set_state_dict({"controller": {"arm": {kind: target * np.nan}}}, env_ids=[0])
        with pytest.raises(TaskError, match="unknown entry of controller 'leg/"):
            other.set_state_dict({"controller": {"leg": {kind: target}}}, env_ids=[0])
        obs, _ = other.reset(env_ids=[1])
        entry = other.observation_slices[f"arm.controller.arm.{kind}"]
        assert entry.stop - entry.start == size
        assert not torch.equal(obs[1, entry], target[0])


def test_worlds_do_not_disturb_each_other():
    mode = "pd_ee_target_delta_pose"
    rng = np.random.default_rng(0)
    actions = rng.uniform(-1, 1, (8, 2, 7)).astype(np.float32)
    with (
        closing(tasks.make("PickCube-v1", num_envs=2, control_mode=mode)) as both,
        closing(tasks.make("PickCube-v1", control_mode=mode)) as one,
    ):
        both.reset(seed=[5, 6])
        one.reset(seed=6)
        for action in actions:
            found = both.step(action)[0]
            expected = one.step(action[1:])[0]
            np.testing.assert_array_equal(found[1], expected[0])


# -- arms by name --------------------------------------------------------------------------------


def test_spaces_and_descriptions_follow_the_modes_of_arms():
    with closing(tasks.make("TwoRobotPickCube-v1", control_mode=MIXED)) as task:
        assert task.action_split == {"left": slice(0, 7), "right": slice(7, 15)}
        numbers = task.layout.arm("left").robot.describe_action()
        assert [number.name for number in numbers[:6]] == [
            *("arm.x", "arm.y", "arm.z", "arm.roll", "arm.pitch", "arm.yaw")
        ]
        assert (numbers[3].lower, numbers[3].upper) == (0.1, -0.1)  # as ManiSkill scales turns
        assert str(numbers[0]).endswith("-0.1 … +0.1 m per step")


def test_each_robot_observes_its_own_targets():
    mode = {"left": "pd_ee_target_delta_pose"}
    flat = tasks.parallel_env("TwoRobotPickCube-v1", control_mode=mode)
    named = tasks.parallel_env("TwoRobotPickCube-v1", control_mode=mode, obs_mode="state_dict")
    with closing(flat), closing(named):
        start, _ = flat.reset(seed=0)
        assert len(start["left"]) == len(start["right"]) + 7
        own, _ = named.reset(seed=0)
        assert list(own["left"]["agent"]) == ["qpos", "qvel", "controller"]
        assert list(own["right"]["agent"]) == ["qpos", "qvel"]


# -- any robot -----------------------------------------------------------------------------------


@pytest.mark.parametrize("robot", ["panda", "so100"])  # the second has too few joints for poses
def test_a_tcp_goes_where_it_is_sent(robot):
    simulation = alone(robot, "pd_ee_delta_pos")
    base = simulation.read().base_pose("arm")[0].astype(float)
    goal = simulation.read().tcp_position("arm")[0] + (-0.02, 0.03, 0.02)
    turn = np.array([[0.0, -1.0], [1.0, 0.0]]) if abs(base[6]) > 0.1 else np.eye(2)
    for _ in range(30):
        state = simulation.read()
        way = goal - state.tcp_position("arm")[0]
        action = np.zeros((1, simulation.layout.action_dim), np.float32)
        action[0, :3] = np.clip([*(turn.T @ way[:2]), way[2]], -0.02, 0.02) / 0.1
        simulation.step(action, state.joint_positions)
    assert np.abs(goal - simulation.read().tcp_position("arm")[0]).max() < 5e-4


def test_a_robot_from_a_urdf_has_every_mode():
    urdf = RobotRegistry.load("panda").urdf.locate()
    robot = RobotDescriptor.from_urdf(urdf, "mine", quiet=True)
    assert [robot.in_control_mode(mode).action_dim for mode in CONTROL_MODES] == [
        *(8, 8, 8, 8, 15, 15, 4, 7, 7, 4, 7)
    ]


def test_a_pose_out_of_reach_leaves_the_joints_where_they_are():
    simulation = alone("panda", "pd_ee_pose")
    before = simulation.read().joint_positions.copy()
    far = np.array([[1.9, 1.9, 1.9, 0, 0, 0, 1]], np.float32)
    simulation.step(far, before)
    np.testing.assert_array_equal(simulation.drive_targets[:, :7], before[:, :7])


def test_what_a_robot_cannot_be_asked_for():
    hand = RobotRegistry.load("floating_panda_gripper")
    with pytest.raises(DescriptorError, match=r"panda_gripper: 'pd_ee_pose' moves the TCP"):
        hand.in_control_mode("pd_ee_pose")
    panda = RobotRegistry.load("panda")
    with pytest.raises(UnknownNameError, match="limb of panda"):
        panda.in_control_mode({"left": "pd_joint_pos"})
    arm = panda.action_split.groups["arm"]
    with pytest.raises(DescriptorError, match="command of a joint group.*Did you mean 'velocity'"):
        replace(arm, command="velocitie")
    with pytest.raises(DescriptorError, match="only a delta has a target"):
        replace(arm, delta=False, target=True)
    with pytest.raises(DescriptorError, match="the action split has no such group"):
        replace(panda, control_modes={"mine": {"leg": arm}})
    with pytest.raises(TaskError, match="control_mode: unknown .*'lefft'. Did you mean 'left'"):
        tasks.make("TwoRobotPickCube-v1", control_mode={"lefft": "pd_joint_pos"})
    with pytest.raises(TaskError, match="control_mode of 'left' 'pd_joint' is not offered"):
        tasks.make("TwoRobotPickCube-v1", control_mode={"left": "pd_joint"})


def test_a_mode_of_a_robots_own():
    panda = RobotRegistry.load("panda")
    arm = panda.in_control_mode("pd_ee_delta_pose").action_split.groups["arm"]
    slow = replace(panda, control_modes={"slow": {"arm": replace(arm, lower=-0.01, upper=0.01)}})
    scenario = make_scenario(tasks.get_task_class("PickCube-v1"), robots=slow, control_mode="slow")
    with closing(tasks.get_task_class("PickCube-v1")(scenario)) as task:
        assert task.layout.action_dim == 7
        with pytest.raises(ActionError, match=r"shape \(1, 8\); it must be \(1, 7\)"):
            task.step(np.zeros((1, 8), np.float32))
        with pytest.raises(ActionError, match=r"nan in environment 0: .*\(arm.roll\)"):
            task.step(np.array([[0, 0, 0, np.nan, 0, 0, 0]], np.float32))
        assert play(task, 0, np.zeros((2, 7), np.float32)).solved is False

from contextlib import closing
from math import pi

import numpy as np
import pytest
import torch

import tasks
from robot_layouts.simulation.sapien3.backend import worlds_below
from tasks.interfaces import vector_env
from tasks.maniskill.rotate_valve import LEAST_GAP, VALVE, ValveDesign, drawn_angles, even_angles

LEVELS = [f"RotateValveLevel{level}-v1" for level in range(5)]
HARDEST = LEVELS[4]


def designs(env: tasks.TaskEnv) -> list[ValveDesign]:
    return [world.design for world in env.simulation.worlds]


def test_spokes_are_apart():
    for seed in range(50):
        angles = drawn_angles(5, tasks.EpisodeRandom(seed))
        assert angles[0] >= 0
        assert np.diff(angles, append=2 * pi).min() >= LEAST_GAP


def test_spokes_for_which_no_angles_are_found_are_even():
    assert drawn_angles(12, tasks.EpisodeRandom(0)) == even_angles(12)
    for count in (3, 4, 5):
        assert even_angles(count) == tuple(np.arange(0, 2 * pi, 2 * pi / count).tolist())
    assert even_angles(4) == pytest.approx((0.0, pi / 2, pi, pi * 3 / 2))


@pytest.mark.parametrize("task_id", LEVELS)
def test_what_is_built_is_the_design(task_id: str):
    env = tasks.make(task_id, num_envs=2)
    for built, design in zip(worlds_below(env.simulation), designs(env), strict=True):
        shapes = built.bodies[f"{VALVE}.valve"].component.collision_shapes
        assert 3 <= len(shapes) == len(design.angles) <= 5
        for shape in shapes:
            assert shape.half_length == pytest.approx(design.length / 2)
            assert shape.radius == pytest.approx(design.radius)
            assert (shape.patch_radius, shape.min_patch_radius) == pytest.approx((0.1, 0.03))
    even = task_id in LEVELS[:2]
    assert (designs(env)[0] == designs(env)[1]) == even


def test_valves_are_drawn_when_worlds_are_built_and_not_at_resets():
    env = tasks.make(HARDEST, num_envs=2)
    first = designs(env)
    env.reset(seed=3)
    assert designs(env) == first
    env.reset(seed=[3], options={"reconfigure": True}, env_ids=[1])
    assert designs(env)[0] == first[0]
    second = designs(env)[1]
    assert second != first[1]
    env.reset(options={"reconfigure": True})
    assert second not in designs(env)
    env.reset(seed=[3], options={"reconfigure": True}, env_ids=[1])
    assert designs(env)[1] == second


def test_each_episode_has_a_direction_and_a_start_of_its_own():
    env = tasks.make(HARDEST, num_envs=3, obs_mode="state_dict")
    seen = set()
    for seed in range(6):
        obs, info = env.reset(seed=[seed], env_ids=[1])
        seen.add(obs["extra"]["rotate_dir"][1].item())
        assert info["valve_rotation"][1] == 0.0
    assert seen == {-1.0, 1.0}
    before = env.reset(seed=5)[0]["extra"]
    state = env.get_state_dict()
    state["articulations"][VALVE][:, 13] += 0.5
    env.set_state_dict(state)
    action = torch.zeros(3, 9)
    assert env.step(action)[4]["valve_rotation"].tolist() == pytest.approx([0.5] * 3, abs=1e-3)
    obs, info = env.reset(seed=[6], env_ids=[2])
    assert info["valve_rotation"].tolist() == pytest.approx([0.5, 0.5, 0.0], abs=1e-3)
    assert torch.equal(obs["extra"]["rotate_dir"][:2], before["rotate_dir"][:2])


@pytest.mark.parametrize(("task_id", "turned"), [(LEVELS[0], pi / 2), (LEVELS[2], pi)])
def test_it_is_solved_once_the_valve_has_turned_far_enough(task_id: str, turned: float):
    env = tasks.make(task_id)
    env.reset(seed=1)  # it begins at -0.77 rad
    for far, solved in ((turned - 0.01, False), (turned + 0.01, True), (-turned - 0.01, False)):
        env.reset(seed=1)
        state = env.get_state_dict()
        state["articulations"][VALVE][:, 13] += far
        env.set_state_dict(state)
        assert env.evaluate(env.state)["success"].tolist() == [solved]


def test_beyond_a_full_turn_the_valve_is_a_full_turn_back_as_in_native():
    env = tasks.make(LEVELS[0])
    env.reset(seed=0)
    state = env.get_state_dict()
    state["articulations"][VALVE][:, 13:] = torch.tensor([6.28, 500.0])  # rad, rad/s
    env.set_state_dict(state)
    env.step(torch.zeros(1, 9))
    assert -2 * pi < env.state.joint(VALVE, "valve")[0] < -6.2


def test_rewards_are_doubles_as_natives():
    for mode in ("dense", "normalized_dense"):
        env = tasks.make(LEVELS[0], reward_mode=mode)
        env.reset(seed=0)
        assert env.step(torch.zeros(1, 9))[1].dtype == torch.float64
    assert tasks.make("PushT-v1").step(torch.zeros(1, 7))[1].dtype == torch.float32
    with closing(vector_env(LEVELS[0], 2)) as vector:
        vector.reset(seed=0)
        assert vector.step(np.zeros((2, 9), np.float32))[1].dtype == np.float64


def test_another_robot_is_rewarded_by_its_tcp():
    env = tasks.make(LEVELS[0], robots="panda", reward_mode="dense")
    env.reset(seed=0)
    (reward,) = env.step(torch.zeros(1, 8))[1].tolist()
    assert np.isfinite(reward)
    tips = env.task.agent_tip_positions(env.state, "arm")
    assert np.array_equal(tips, env.state.tcp_position("arm")[:, None])


class TestTips:
    """A robot with tips observes their poses of itself, in whatever task."""

    def test_they_come_after_joints_and_targets(self):
        mode = "pd_joint_target_delta_pos"
        env = tasks.make(LEVELS[0], 2, obs_mode="state_dict", control_mode=mode)
        obs, _ = env.reset(seed=0)
        assert list(obs["agent"]) == ["qpos", "qvel", "controller", "tip_poses"]
        tips = obs["agent"]["tip_poses"].reshape(2, 3, 7)
        links = env.layout["arm"].robot.native_agent.tip_links
        for i, link in enumerate(links):
            assert np.array_equal(tips[:, i], env.state.link_pose("arm", link))
        flat = tasks.make(LEVELS[0], 2, control_mode=mode)
        slices = flat.observation_slices
        assert list(slices)[:5] == [
            *("arm.qpos", "arm.qvel", "arm.controller.joint.target_qpos", "arm.tip_poses"),
            "rotate_dir",
        ]
        observed = flat.reset(seed=0)[0][:, slices["arm.tip_poses"]]
        assert torch.equal(observed, obs["agent"]["tip_poses"])

    def test_noise_may_be_added_to_them(self):
        noise = tasks.Randomization(sensor_noise={"arm.tip_poses": tasks.Normal(0.1)})
        plain, noisy = (
            tasks.make(LEVELS[0], obs_mode="state_dict", randomization=varied).reset(seed=0)[0]
            for varied in (None, noise)
        )
        assert torch.equal(plain["agent"]["qpos"], noisy["agent"]["qpos"])
        off = plain["agent"]["tip_poses"] - noisy["agent"]["tip_poses"]
        assert 0.02 < off.std() < 0.3

    def test_of_several_robots_each_observes_its_own(self):
        making = {"robots": {"left": "dclaw"}, "check_layout": False}
        env = tasks.parallel_env("TwoRobotPickCube-v1", **making)
        slices = env.task.observation_slices
        tips = range(*slices["left.tip_poses"].indices(10_000))
        assert set(tips) <= set(env.observed["left"].tolist())
        assert not set(tips) & set(env.observed["right"].tolist())

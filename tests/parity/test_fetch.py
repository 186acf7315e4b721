"""Fetch, standing on the floor, does native's tasks as native's does, to the last bit."""

from __future__ import annotations

import gc
from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest
import torch

import tasks
from parity.lockstep import NativeSide, OurSide
from parity.native import make_native, quiet
from robots import RobotRegistry
from tasks.episode import Episode
from tests.native import NATIVE, Pair, complaints
from tests.tasks.test_native_camera_settings import differences

pytestmark = NATIVE

TASKS = (
    "LiftPegUpright-v1",
    "PickCube-v1",
    "PlaceSphere-v1",
    "PokeCube-v1",
    "PullCube-v1",
    "PullCubeTool-v1",
    "PushCube-v1",
    "StackCube-v1",
    "StackPyramid-v1",
)
ACTION_DIM, DOF = 13, 15
ROOT = 13  # numbers of a state row before the joints


class StandingStill(OurSide):
    """Our robot whose base takes no numbers, beside native's that is told to stand still."""

    def __init__(self, env: tasks.MultiRobotTask) -> None:
        super().__init__(env)
        self.action_dim += 2

    def step(self, actions):
        assert not actions[:, -2:].any()
        return super().step(actions[:, :-2])


def both(task_id: str, name: str) -> Pair:
    robot = replace(RobotRegistry.load(name), name="fetch")  # native's name in state dicts
    ours = tasks.make(task_id, robots=robot)
    native = NativeSide(task_id, robot_uid="fetch")
    gc.freeze()
    return Pair(native, (OurSide if name == "fetch_driving" else StandingStill)(ours))


def episodes(*, drives: bool, steps: int = 50) -> list[Episode]:
    """Return an episode that ends in driving forwards, and one in turning backwards."""
    found: list[Episode] = []
    for seed, base in enumerate(((1.0, 0.3), (-0.5, -1.0))):
        actions = np.random.default_rng(seed).uniform(-1.2, 1.2, (steps, ACTION_DIM))
        actions[steps // 2 :, -2:] = base
        actions[-10:, :-2] /= 100
        actions[:, -2:] *= drives
        found.append(Episode(seed, actions.astype(np.float32)))
    return found


def test_fetch_drives_and_turns_on_the_floor_as_in_native():
    pair = both("PickCube-v1", "fetch_driving")
    assert complaints(pair.play(episodes(drives=True, steps=25))) == []
    assert np.abs(pair.ours.env.simulation.read().qpos("arm")[0, -3:]).max() > 0.5


@pytest.mark.long
@pytest.mark.parametrize("name", ["fetch", "fetch_driving"])
@pytest.mark.parametrize("task_id", TASKS)
def test_fetch_in_native_s_tasks(task_id, name):
    pair, drives = both(task_id, name), name == "fetch_driving"
    for history in ("fresh", "reused"):
        assert complaints(pair.play(episodes(drives=drives), history)) == []
    base = np.abs(pair.ours.env.simulation.read().qpos("arm")[0, -3:])
    assert base.max() > 1.0 if drives else base.max() < 0.1


# Not pd_joint_pos_vel: native normalises it by limits that three of Fetch's joints do not have, and
# drives them to nowhere; nor pd_ee_delta_pose_align, which native does not finish making.
MODES = (
    "pd_ee_delta_pos",
    "pd_ee_delta_pose",
    "pd_ee_target_delta_pos",
    "pd_ee_target_delta_pose",
    "pd_joint_delta_pos_vel",
    "pd_joint_pos",
    "pd_joint_target_delta_pos",
    "pd_joint_vel",
)


@pytest.mark.long
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.filterwarnings("ignore:robot 'arm' is thrown about:RuntimeWarning")
def test_fetch_in_native_s_control_modes(mode: str):
    with (
        closing(make_native("PickCube-v1", None, mode, robot_uid="fetch")) as native,
        closing(tasks.make("PickCube-v1", robots="fetch_driving", control_mode=mode)) as ours,
    ):
        for seed in range(2):
            with quiet():
                expected, _ = native.reset(seed=seed, options={"reconfigure": True})
            observed, _ = ours.reset(seed, {"reconfigure": True})
            assert torch.equal(observed, expected)
            for action in drawn_actions(seed, 15, ours.single_action_space.shape[0]):
                expected, reward, *_ = native.step(action)
                observed, own, *_ = ours.step(action[None])
                assert torch.equal(observed, expected)
                assert torch.equal(own, reward)


def test_native_s_other_control_mode_drives_fetch_to_nowhere():
    with closing(make_native("PickCube-v1", None, "pd_joint_pos_vel", robot_uid="fetch")) as native:
        native.reset(seed=0)
        observed, *_ = native.step(np.zeros(20, np.float32))
        assert observed.isnan().any()


@pytest.mark.long
@pytest.mark.usefixtures("renderer")
@pytest.mark.parametrize("task_id", TASKS)
def test_fetch_s_cameras_see_what_native_s_see(task_id: str):
    with (
        closing(make_native(task_id, obs_mode="rgbd", robot_uid="fetch")) as native,
        closing(tasks.make(task_id, obs_mode="rgbd", robots="fetch_driving")) as ours,
    ):
        actions = drawn_actions(3, 2, ACTION_DIM)
        with quiet():
            expected = [native.reset(seed=3, options={"reconfigure": True})[0]]
            expected += [native.step(action)[0] for action in actions]
        seen = [ours.reset(3, {"reconfigure": True})[0]]
        seen += [ours.step(action[None])[0] for action in actions]
        assert {"fetch_head", "fetch_hand"} < set(seen[0]["sensor_data"])
        assert differences(expected, seen) == []


def drawn_actions(seed: int, steps: int, count: int) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-1, 1, (steps, count)).astype(np.float32)


def numbers(found) -> dict[str, np.ndarray]:
    return {key: np.asarray(value) for key, value in found.items()}


@pytest.mark.long
@pytest.mark.parametrize("task_id", TASKS)
def test_what_is_said_of_states_that_random_actions_do_not_reach(task_id):
    """Things on top of each other, a robot at rest and one whose joints move backwards."""
    pair = both(task_id, "fetch_driving")
    native, ours = pair.native.envs[0], pair.ours.env
    pair.forget()
    seen: set[str] = set()
    for random in map(np.random.default_rng, range(300)):
        state = drawn(native.get_state_dict(), random)
        for env in (native, ours):
            env.set_state_dict(state)
        expected, read = native.evaluate(), ours.simulation.read()
        info = ours.evaluate(read)
        for key, value in numbers(expected).items():
            np.testing.assert_array_equal(np.ravel(info[key]), np.ravel(value), key)
            seen |= {f"{key} {value.all()}"} if value.dtype == bool else set()
        told = numbers(expected)
        for key, value in numbers(native._get_obs_extra(expected)).items():
            np.testing.assert_array_equal(np.ravel(ours.observe(read, told)[key]), np.ravel(value))
        if "dense" in ours.reward_modes:
            action = torch.zeros(1, ACTION_DIM)
            reward = native.compute_dense_reward(obs=None, action=action, info=expected)
            np.testing.assert_array_equal(ours.dense_reward(read, action.numpy(), told), reward)
    if task_id == "PickCube-v1":
        assert {"is_robot_static True", "is_robot_static False", "success True"} <= seen


def drawn(state, random: np.random.Generator):
    """Return a state with other joints, and things put where other things are."""
    state = {kind: {k: v.clone() for k, v in rows.items()} for kind, rows in state.items()}
    speeds = random.uniform(-1, 1, DOF) * random.choice([0.0, 0.03, 0.3])
    if random.random() < 0.3:
        speeds = -5 * np.abs(speeds)
    robot = state["articulations"]["fetch"][0]
    robot[ROOT + DOF :] = torch.from_numpy(speeds.astype(np.float32))
    robot[ROOT + DOF - 2 : ROOT + DOF] = torch.from_numpy(random.uniform(0, 0.05, 2))
    things = [name for name in state["actors"] if name != "table-workspace"]
    for name in things:
        if random.random() < 0.5:
            other = state["actors"][random.choice(things)]
            place = state["actors"][name]
            beside = random.uniform(-1, 1, 3) * random.choice([0.002, 0.02])  # m
            place[0, :3] = other[0, :3] + torch.from_numpy(beside)
            place[0, 2] = other[0, 2] + random.choice([0.0, 0.022, 0.04])
            place[0, 7:] = random.choice([0.0, 0.2])
    return state

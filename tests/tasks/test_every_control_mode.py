"""Every control mode of ManiSkill is native's to the last bit; modes may differ by arm."""

import numpy as np
import pytest

import tasks
from parity.compare.episodes import random_episodes
from robots import CONTROL_MODES
from tasks.episode import Episode
from tests.native import NATIVE, complaints, pair

LATER = [mode for mode in CONTROL_MODES if mode not in ("pd_joint_delta_pos", "pd_joint_pos")]
ALONE, TWO = "PickCube-v1", "TwoRobotPickCube-v1"
SLOW = [TWO, "StackCube-v1", "PegInsertionSide-v1"]


def against_native(task_id, mode, history, steps, seeds=(1,)):
    sides = pair(task_id, control_mode=mode)
    layout = sides.ours.env.layout
    episodes = random_episodes(seeds, steps, layout.action_dim, layout.action_bounds)
    if mode == "pd_ee_pose":  # random ones are out of reach, where the arm stays
        episodes += [near_poses(seed, steps, len(layout)) for seed in seeds]
    return sides.play(episodes, history)


def near_poses(seed, steps, arms):
    """Poses in front of each arm, in its root's frame: place (m), then turns (rad), gripper."""
    rng = np.random.default_rng(seed)
    middle, spread = (0.6, 0.0, 0.2, np.pi, 0.0, 0.0, 0.0), (0.1, 0.15, 0.08, 0.2, 0.2, 0.2, 1.0)
    poses = middle + rng.uniform(-1, 1, (steps, arms, 7)) * spread
    return Episode(seed, poses.reshape(steps, -1).astype(np.float32))


class TestNative:
    pytestmark = NATIVE

    @pytest.mark.parametrize("mode", LATER)
    def test_random_actions(self, mode):
        assert complaints(against_native(ALONE, mode, "reused", 25, seeds=(1, 2))) == []

    @pytest.mark.parametrize("mode", ["pd_joint_target_delta_pos", "pd_ee_target_delta_pose"])
    def test_two_arms(self, mode):
        assert complaints(against_native(TWO, mode, "reused", 20, seeds=(1, 2))) == []

    @pytest.mark.long
    @pytest.mark.parametrize("history", ["fresh", "reused"])
    @pytest.mark.parametrize("mode", LATER)
    @pytest.mark.parametrize("task_id", [ALONE, *SLOW])
    def test_more_tasks(self, task_id, mode, history):
        assert complaints(against_native(task_id, mode, history, 100, seeds=range(5))) == []

    @pytest.mark.parametrize("mode", LATER)
    def test_a_wrong_target_is_noticed(self, mode, monkeypatch):
        """A mutant: the controller's targets are one bit off for one joint, from step 5 on."""
        sides = pair(ALONE, control_mode=mode)
        drive, count = type(sides.ours.env.simulation)._drive, iter(range(10**6))

        def off(self, action, *others):
            changed = action.copy()
            if next(count) >= 5:
                changed[:, 0] = np.nextafter(changed[:, 0], np.float32(1e3)) + np.float32(1e-4)
            return drive(self, changed, *others)

        monkeypatch.setattr(type(sides.ours.env.simulation), "_drive", off)
        assert complaints(against_native(ALONE, mode, "reused", 12)) != []


def test_modes_differ_by_arm():
    modes = {"left": "pd_ee_delta_pose", "right": "pd_joint_pos"}
    env = tasks.make(TWO, control_mode=modes)
    assert {name: part.stop - part.start for name, part in env.action_split.items()} == {
        "left": 7,
        "right": 8,
    }
    low = env.single_action_space.low
    assert (low[:7] == -1).all()
    assert low[7] < -2
    env.reset(seed=0)
    before = env.simulation.read().tcp_position("left").copy()
    start = env.layout["right"].start_qpos
    action = np.zeros((1, 15), np.float32)
    action[0, :7], action[0, 7:] = (0, 0, -1, 0, 0, 0, 1), (*start[:7], 1)
    for _ in range(3):
        env.step(action)
    state = env.simulation.read()
    assert state.tcp_position("left")[0, 2] < before[0, 2] - 0.05
    np.testing.assert_allclose(state.qpos("right")[0, :7], start[:7], atol=0.02)


@pytest.mark.parametrize("mode", LATER)
def test_what_is_remembered_comes_back_with_the_state(mode):
    env = tasks.make(ALONE, control_mode=mode)
    rng = np.random.default_rng(0)
    env.reset(seed=0)
    actions = rng.uniform(-1, 1, (8, 1, env.layout.action_dim)).astype(np.float32)
    for action in actions[:4]:
        env.step(action)
    state = env.get_state_dict()
    assert ("controller" in state) == ("target" in mode)
    other = tasks.make(ALONE, control_mode=mode)
    other.reset(seed=0)
    other.set_state_dict(state)
    again = other.get_state_dict()
    assert str(again.get("controller")) == str(state.get("controller"))

"""Two-arm tasks with one robot that has both arms."""

from __future__ import annotations

from math import pi

import gymnasium
import numpy as np
import pytest

import tasks
from layouts import Layout, Placement, at_task
from robot_layouts.experts import Rehearsal, Waypoint, find_expert
from robot_layouts.kinematics.rotations import rotation_of
from robots import TaskError, UnknownNameError
from tasks.episode import play
from tasks.registry import TASKS, make_scenario

TWO = "TwoRobotPickCube-v1"
# High behind the table, as its column reaches 1.6 m down: what is looked at here needs no reach.
CELL = Layout({"cell": Placement("mobile_panda_dual", position=(2.5, 0.0, 1.0), rpy=(0, 0, pi))})


@pytest.fixture(scope="module")
def env():
    env = tasks.make(TWO, num_envs=2, layout=CELL)
    yield env
    env.close()


def test_limbs_take_the_places_that_they_are_called_like(env):
    assert env.action_split == CELL.action_split
    state = env.simulation.read()
    for place, first in (("left", 0), ("right", 9)):
        full = f"cell.{place}"
        np.testing.assert_array_equal(state.qpos(place), state.qpos("cell")[:, first : first + 9])
        np.testing.assert_array_equal(state.tcp_pose(place), state.tcp_pose(full))
        hand = state.link_pose("cell", f"{place}_panda_hand_tcp")
        np.testing.assert_array_equal(state.tcp_pose(place), hand)
        assert state.arm_qvel(place).shape == (2, 7)
        np.testing.assert_allclose(state.gripper_opening(full), 1.0, atol=1e-5)
        assert not state.is_grasping(place, "cube").any()
    np.testing.assert_array_equal(state.qpos("cell.body"), state.qpos("cell")[:, 18:19])
    apart = state.tcp_position("left") - state.tcp_position("right")
    assert (np.abs(apart[:, 1]) > 0.2).all()


def test_an_action_by_name_moves_that_limb_alone(env):
    env.reset(seed=0)
    before = env.simulation.read().qpos("cell").copy()
    still = {
        "cell.left": np.zeros((2, 8)),
        "cell.right": np.zeros((2, 8)),
        "cell.body": [[0.0]] * 2,
    }
    still = {name: np.array(numbers, np.float32) for name, numbers in still.items()}
    still["cell.left"][:, 7] = still["cell.right"][:, 7] = 1.0  # grippers stay open
    moved = {**still, "cell.right": np.ones((2, 8), np.float32)}
    env.step(moved)
    way = np.abs(env.simulation.read().qpos("cell") - before)
    assert (way[:, 9:16] > 0.01).all()
    assert (way[:, :7] < 0.005).all()


def test_the_observation_is_that_of_two_robots_with_joints_once():
    own = tasks.make(TWO, layout=CELL, obs_mode="state_dict")
    obs, _ = own.reset(seed=0)
    assert obs["agent"]["qpos"].shape == (1, 22)
    assert set(obs["extra"]) == set(tasks.make(TWO, obs_mode="state_dict").start[0]["extra"])
    flat = tasks.make(TWO, layout=CELL)
    assert flat.observation_slices["cell.qpos"] == slice(0, 22)


def test_every_limb_is_an_agent():
    pytest.importorskip("pettingzoo")
    env = tasks.parallel_env(TWO, layout=CELL)
    assert env.possible_agents == ["cell.left", "cell.right", "cell.body"]
    observations, _ = env.reset(seed=0)
    state = env.task.simulation.read()
    for name, dof in (("cell.left", 9), ("cell.right", 9), ("cell.body", 1)):
        joints = np.concatenate([state.qpos(name)[0], state.qvel(name)[0]])
        np.testing.assert_array_equal(observations[name][: 2 * dof], joints)
        assert observations[name].shape == env.observation_space(name).shape
    env.step({name: env.action_space(name).sample() for name in env.agents})


def test_one_robot_of_two_limbs_stands_where_both_reach():
    task = tasks.get_task_class(TWO)
    layout = make_scenario(task, robots="baxter").layout
    assert layout == at_task("baxter", task)
    assert {"left", "right"} <= {name.rpartition(".")[2] for name in layout.arms}


@pytest.mark.parametrize(("task", "place"), [(TWO, "left"), ("PickCube-v1", "arm")])
def test_a_body_takes_all_places_or_none(task, place):
    words = f"limbs left, right, .* '{place}' takes; robots='baxter' lets them serve all"
    with pytest.raises(TaskError, match=words):
        tasks.make(task, robots={place: "baxter"})


def test_places_that_no_limb_takes_are_refused():
    with pytest.raises(TaskError, match=r"places \['left', 'right'\]; .* \['cell'\]"):
        tasks.make(TWO, layout=Layout({"cell": Placement("panda")}))


def test_a_task_may_be_declared_with_a_robot_of_two_arms():
    @tasks.register_task("OneRobotTwoArms-v1")
    class OneRobotTwoArms(tasks.MultiRobotTask):
        layout = CELL
        max_episode_steps = 5

        def evaluate(self, state):
            apart = state.tcp_position("left") - state.tcp_position("right")
            return {"success": apart[:, 1] > 10.0}

    try:
        env = tasks.make("OneRobotTwoArms-v1")
        assert env.action_split == CELL.action_split
        pandas = {"left": (0.0, 1.0, 0.0), "right": (0.0, -1.0, 0.0)}
        two = Layout({n: Placement("panda", position=p) for n, p in pandas.items()})
        assert tasks.make("OneRobotTwoArms-v1", layout=two).layout.action_dim == 16
    finally:
        TASKS.registered.pop("OneRobotTwoArms-v1", None)
        gymnasium.registry.pop("RobotLayouts/OneRobotTwoArms-v1", None)


def test_a_script_names_limbs_not_their_robot(env):
    rehearsal = Rehearsal(env)
    rehearsal.begin(0)
    for name in ("left", "cell.left"):
        rehearsal.play({name: [Waypoint("stay", most=2, steps=5)]})
    with pytest.raises(UnknownNameError, match=r"arm that takes numbers 'cell'. .*left, right"):
        rehearsal.play({"cell": [Waypoint("stay")]})


HAND_OVER = "TwoRobotHandOver-v1"


@pytest.fixture(scope="module")
def body():
    env = tasks.make(HAND_OVER, robots="mobile_panda_dual", obs_mode="none")  # collides nowhere
    yield env
    env.close()


def test_a_body_stands_behind_the_table_with_its_hands_over_it(body):
    body.reset(seed=0)
    placement, table = body.layout["robot"], body.task.table.outline(body.layout)
    assert placement.base_position[0] > table[2] + 0.15  # half its column
    state, frame = body.simulation.read(), body.task.fit
    for place, side in (("left", -1), ("right", 1)):
        x, y, z = state.tcp_position(place)[0]
        assert x == pytest.approx(frame.x, abs=0.05)
        assert (y - frame.y) * side > 0.1
        assert 0.1 < z < 0.3
        assert rotation_of(state.tcp_pose(place)[0, 3:])[2, 2] < -0.9  # the gripper points down
    assert table[0] < frame.x < table[2]


def test_a_body_drifts_nowhere_while_its_arm_moves(body):
    body.reset(seed=0)
    before = body.simulation.read().qpos("robot")[0, 18:].copy()
    for _ in range(10):
        body.step(body.single_action_space.high[None])
    assert np.abs(body.simulation.read().qpos("robot")[0, 19:] - before[1:]).max() < 1e-3


@pytest.mark.long
@pytest.mark.parametrize(
    "body", ["mobile_panda_dual", pytest.param("baxter", marks=pytest.mark.example_robots)]
)
def test_a_body_hands_over_from_arm_to_arm(body):
    env = tasks.make(HAND_OVER, robots=body, obs_mode="none")
    expert = find_expert(HAND_OVER)
    assert all(play(env, seed, expert(env, seed)).solved for seed in range(2))

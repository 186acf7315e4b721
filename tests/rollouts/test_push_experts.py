"""The experts that push, pull, poke, stand up and roll do so by the means their tasks intend."""

import functools

import numpy as np
import pytest
import torch

import tasks
from layouts import Layout, Placement
from parity.native import make_native, native_action
from robots import TaskError
from rollouts.episode import Episode, play
from rollouts.experts import find_expert
from rollouts.experts.geometry import rotate

TASKS = (
    "LiftPegUpright-v1",
    "PokeCube-v1",
    "PullCube-v1",
    "PullCubeTool-v1",
    "PushCube-v1",
    "RollBall-v1",
)
HELD = {"PokeCube-v1": "peg", "PullCubeTool-v1": "l_shape_tool"}
X_AXIS = np.array([1.0, 0.0, 0.0])
REBUILT = {"reconfigure": True}


@functools.cache
def task(name: str) -> tasks.MultiRobotTask:
    return tasks.make(name)


@functools.cache
def plan(name: str, seed: int) -> np.ndarray:
    return find_expert(name)(task(name), seed)


@functools.cache
def episode(name: str, seed: int) -> Episode:
    return play(task(name), seed, plan(name, seed))


def path(name: str, seed: int, body: str) -> np.ndarray:
    """Return where a body was before and after every step, (T + 1, 3) (m)."""
    return episode(name, seed).states["actors"][body][:, :3]


@pytest.mark.parametrize("name", TASKS)
@pytest.mark.parametrize("seed", [0, 1])
def test_an_expert_solves_its_task_in_time(name, seed):
    actions = plan(name, seed)
    assert actions.dtype == np.float32
    assert actions.shape[1:] == (8,)
    assert len(actions) <= task(name).max_episode_steps
    assert np.abs(actions).max() <= 1
    success = play(tasks.make(name), seed, actions).success
    assert success[-1]
    assert not success[:-1].any()


@pytest.mark.long
@pytest.mark.parametrize("name", TASKS)
def test_an_expert_solves_48_of_50_seeds(name):
    failed = [seed for seed in range(50) if not play(task(name), seed, plan(name, seed)).solved]
    assert len(failed) <= 2, f"failed: {failed}"


@pytest.mark.long
@pytest.mark.native
# mani_skill's own
@pytest.mark.filterwarnings("ignore:__array_wrap__:DeprecationWarning")
@pytest.mark.filterwarnings("ignore:The 'warn' method:DeprecationWarning")
@pytest.mark.parametrize("name", TASKS)
def test_the_same_actions_succeed_in_native(name):
    native = make_native(name)
    for seed in range(10):
        native.reset(seed=seed, options=REBUILT)
        for action in plan(name, seed):
            *_, info = native.step(native_action(native, action))
        assert bool(info["success"][0]), f"seed {seed}"
    native.close()


@pytest.mark.parametrize("name", TASKS)
def test_an_expert_repeats_itself(name):
    np.testing.assert_array_equal(find_expert(name)(tasks.make(name), 1), plan(name, 1))


@pytest.mark.parametrize("name", TASKS)
def test_an_expert_leaves_the_task_alone(name):
    env = tasks.make(name)
    env.reset(seed=11)
    env.step(torch.zeros(1, 8))
    before = env.get_state_dict()
    find_expert(name)(env, 1)
    after = env.get_state_dict()
    for group, entries in before.items():
        for body, row in entries.items():
            assert torch.equal(after[group][body], row), body


@pytest.mark.parametrize("name", ["PushCube-v1", "PullCube-v1"])
@pytest.mark.parametrize("seed", [0, 1])
def test_a_cube_slides_over_the_table_all_the_way(name, seed):
    heights = path(name, seed, "cube")[:, 2]
    assert np.abs(heights - 0.02).max() < 0.003


@pytest.mark.parametrize("seed", [0, 1])
def test_the_peg_truly_stands(seed):
    """The task's own measure is satisfied by pegs that lie along y, too."""
    quaternion = episode("LiftPegUpright-v1", seed).states["actors"]["peg"][-1, 3:7]
    assert abs(rotate(quaternion.astype(float), X_AXIS)[2]) > 0.99


@pytest.mark.parametrize("name", HELD)
@pytest.mark.parametrize("seed", [0, 1])
def test_the_cube_is_moved_by_what_the_arm_holds(name, seed):
    """Whenever the cube moves, the arm holds peg or tool, its fingers away from the cube."""
    env = tasks.make(name)
    env.reset(seed, options=REBUILT)
    was = env.simulation.read().position("cube")[0, :2]
    moved = 0
    for action in plan(name, seed):
        env.step(action)
        state = env.simulation.read()
        now = state.position("cube")[0, :2]
        if np.linalg.norm(now - was) > 0.003:
            moved += 1
            assert bool(state.is_grasping("arm", HELD[name])[0])
            assert np.linalg.norm(state.tcp_offset("arm", "cube")) > 0.08
        was = now
    assert moved > 3


@pytest.mark.parametrize("seed", [0, 1])
def test_the_ball_rolls_by_itself(seed):
    """It comes to the target at the speed at which it left the arm, far from it."""
    rolling = path("RollBall-v1", seed, "ball")
    speeds = np.linalg.norm(np.diff(rolling[-10:], axis=0), axis=1)
    assert speeds.max() - speeds.min() < 0.01 * speeds.max()
    state = task("RollBall-v1").simulation.read()
    assert np.linalg.norm(state.tcp_offset("arm", "ball")) > 0.5


@pytest.mark.parametrize(
    ("name", "plan_name"),
    [
        ("LiftPegUpright-v1", "standing a peg up"),
        ("PokeCube-v1", "poking with a peg"),
        ("PullCubeTool-v1", "pulling with a tool"),
    ],
)
def test_an_arm_without_fingers_is_an_error(name, plan_name):
    env = tasks.make(name, robots={"arm": "panda_stick"})
    message = f"{plan_name} needs fingers on 'arm'; 'arm' is a panda_stick, which has none"
    with pytest.raises(TaskError, match=message):
        find_expert(name)(env, 0)


@pytest.mark.parametrize(
    ("name", "robot"),
    [
        ("PushCube-v1", "panda_stick"),
        ("PullCube-v1", "panda_stick"),
        ("RollBall-v1", "panda_stick"),
        ("RollBall-v1", "panda_wristcam"),
    ],
)
def test_other_robots_push_as_well(name, robot):
    env = tasks.make(name, robots={"arm": robot})
    assert play(env, 0, find_expert(name)(env, 0)).solved


@pytest.mark.parametrize("name", TASKS)
def test_an_arm_too_far_away_is_an_error(name):
    env = tasks.make(name, layout=Layout({"arm": Placement("panda", position=(-3.0, 0.0, 0.0))}))
    with pytest.raises(TaskError, match=rf"{name}, seed 0: no plan: arm\.above is out of reach"):
        find_expert(name)(env, 0)

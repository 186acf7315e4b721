"""The experts that push, pull, poke, stand up and roll do so by the means their tasks intend."""

import numpy as np
import pytest

import tasks
from robot_layouts.experts import find_expert
from robot_layouts.kinematics.rotations import rotate
from tasks.episode import play
from tests.data.expert_plays import REBUILT, episode, path, plan

pytestmark = pytest.mark.xdist_group("experts")  # they share plans

HELD = {"PokeCube-v1": "peg", "PullCubeTool-v1": "l_shape_tool"}
X_AXIS = np.array([1.0, 0.0, 0.0])


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
    env = tasks.make("RollBall-v1")
    play(env, seed, plan("RollBall-v1", seed))
    state = env.simulation.read()
    assert np.linalg.norm(state.tcp_offset("arm", "ball")) > 0.5


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

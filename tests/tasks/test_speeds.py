"""Joints that fly off: reported with robot, joint, environment, step and cause; no bit changes."""

from __future__ import annotations

import math
import warnings

import numpy as np
import pytest

from layouts import Layout, Placement
from robot_layouts.simulation.sapien3.backend import worlds_below
from robots import SimulationError
from tasks.engine.divergence import SpeedWatch
from tasks.maniskill.two_robot_pick_cube import TwoRobotPickCube
from tests.tasks.made import STILL, make


def throw(env, number, speed):
    """Give the last joint of the arm of one environment a speed (rad/s)."""
    (robot,) = worlds_below(env.simulation)[number].robots.values()
    qvel = np.zeros(robot.descriptor.dof, np.float32)
    qvel[6] = -speed  # there is more room
    robot.articulation.set_qvel(qvel)


def loose(env):
    """Take the drives of the arm away, so that it keeps its speed."""
    for world in worlds_below(env.simulation):
        for joint in next(iter(world.robots.values())).driven:
            joint.set_drive_properties(0.0, 0.0, 0.0, "force")


def test_ten_times_the_largest_speed_is_reported_once_in_an_episode():
    env = make()
    loose(env)
    throw(env, 1, 40.0)
    message = r"'panda' .*panda_joint7 moves at .* rad/s in environment 1 at step 1, 1\d.* times"
    with pytest.warns(RuntimeWarning, match=message.replace("'panda'", "robot '.*'")):
        env.step(STILL)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        throw(env, 1, 40.0)
        env.step(STILL)
        env.reset(seed=0, env_ids=[0])
        throw(env, 1, 40.0)
        env.step(STILL)
    env.reset(seed=0)
    throw(env, 1, 40.0)
    with pytest.warns(RuntimeWarning, match="in environment 1 at step 1"):
        env.step(STILL)


def test_a_joint_is_reported_a_few_times_only():
    """Who learns from nothing throws arms about in every other episode."""
    env = make()
    loose(env)
    told = []
    for _ in range(5):
        env.reset(seed=0)
        throw(env, 1, 40.0)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            env.step(STILL)
        told += [str(warning.message) for warning in caught]
    assert ["is not reported again" in text for text in told] == [False, False, True]


def test_what_moves_as_fast_as_it_may_is_not_reported():
    env = make()
    loose(env)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        throw(env, 0, 20.0)
        env.step(STILL)


@pytest.fixture
def strict(monkeypatch):
    """Let what PhysX lets a joint keep be too much: it allows 100 rad/s."""
    monkeypatch.setattr("tasks.engine.divergence.REFUSES", 12.0)


@pytest.mark.usefixtures("strict")
def test_far_beyond_that_is_an_error():
    env = make()
    loose(env)
    throw(env, 1, 45.0)
    message = r"physics diverged: .*panda_joint7 moves at .* environment 1 at step 1"
    with pytest.raises(SimulationError, match=message) as refused:
        env.step(STILL)
    assert "the likely cause: the drive of panda_joint7" in str(refused.value)
    assert "reset(options={'reconfigure': True})" in str(refused.value)
    env.reset(seed=0, options={"reconfigure": True})
    env.step(STILL)


def step_until_refused(env):
    for _ in range(50):
        env.step(np.zeros((1, 16), np.float32))


def test_robots_in_one_place_are_named():
    near = Placement("panda", position=(0.0, 0.0, 0.0)), Placement("panda", position=(0.02, 0, 0))
    layout = Layout(dict(zip(("left", "right"), near, strict=True)))
    env = make(TwoRobotPickCube, num_envs=1, layout=layout, check_layout=False)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        with pytest.raises(
            SimulationError, match=r"at the start (left|right)\.\w+ and (left|right)"
        ):
            step_until_refused(env)


def test_a_robot_that_is_nowhere_is_named_with_joint_and_cause():
    env = make()
    throw(env, 1, math.nan)
    message = r"environment 1 at step 1 \(before, (panda_\w+) was the fastest .* the drive of \1 "
    with pytest.raises(SimulationError, match=message):
        env.step(STILL)


def test_looking_changes_no_bit(monkeypatch):
    def play(env):
        env.reset(seed=0, options={"reconfigure": True})
        loose(env)
        throw(env, 1, 40.0)
        rows = []
        for _ in range(10):
            env.step(np.full((2, 8), 0.3, np.float32))
            rows += [x.numpy().copy() for x in env.get_state_dict()["actors"].values()]
            rows += [x.numpy().copy() for x in env.get_state_dict()["articulations"].values()]
        return rows

    with pytest.warns(RuntimeWarning, match="panda_joint7"):
        watched = play(make())
    monkeypatch.setattr(SpeedWatch, "look", lambda *_: None)
    for seen, unseen in zip(watched, play(make()), strict=True):
        assert np.array_equal(seen, unseen)

from dataclasses import replace

import numpy as np
import pytest
import torch

import tasks
from layouts import single
from robot_layouts.simulation import Simulation, State
from robot_layouts.simulation.checks.overlaps import empty, stand
from robot_layouts.simulation.maths import norm
from robot_layouts.simulation.sapien3.backend import worlds_below
from robots import SimulationError, UnknownNameError
from tasks import TaskEnv


@pytest.fixture
def env() -> TaskEnv:
    return tasks.make("TwoRobotPickCube-v1", num_envs=2, robots={"right": "panda_stick"})


def state_of(env: TaskEnv) -> State:
    return env.simulation.read()


def test_gripper_opening_is_a_share_of_its_range(env: TaskEnv):
    env.reset(seed=0)
    assert state_of(env).gripper_opening("left").tolist() == [1.0, 1.0]
    action = torch.zeros(2, 15)
    action[1, 7] = 1.0
    for _ in range(20):
        env.step(action)  # 0 closes to the middle between -0.01 m and 0.04 m
    opening = state_of(env).gripper_opening("left")
    np.testing.assert_allclose(opening, [0.015 / 0.04, 1.0], atol=5e-3)


def test_a_robot_without_a_gripper_is_open(env: TaskEnv):
    assert state_of(env).gripper_opening("right").tolist() == [1.0, 1.0]
    with pytest.raises(UnknownNameError, match="Did you mean 'right'"):
        state_of(env).gripper_opening("rigth")


def test_joints_that_are_held_are_no_gripper():
    fetch = Simulation(single({"arm": "fetch"}), empty, 1)  # its base is held
    stand(fetch)
    np.testing.assert_allclose(fetch.read().gripper_opening("arm"), [0.3])


def test_velocities_are_those_of_the_body_asked_for(env: TaskEnv):
    for world in worlds_below(env.simulation):
        world.bodies["cube"].component.set_linear_velocity([0.0, 0.0, 4.0])
        world.bodies["cube"].component.set_angular_velocity([0.0, 2.0, 0.0])
    env.simulation.touched()
    for order in (["goal_site", "cube"], ["cube", "goal_site"], ["cube"]):
        state = state_of(env)
        spins = {body: state.spin(body).tolist() for body in order}
        speeds = {body: state.speed(body).tolist() for body in order}
        assert spins["cube"] == [2.0, 2.0]
        assert speeds["cube"] == [4.0, 4.0]
        assert spins.get("goal_site") == speeds.get("goal_site") in (None, [0.0, 0.0])
    with pytest.raises(UnknownNameError, match="Did you mean 'cube'"):
        state.speed("cub")
    assert state_of(env).linear_velocity("cube").tolist() == [[0.0, 0.0, 4.0]] * 2


def test_velocities_are_read_while_the_state_is_present(env: TaskEnv):
    read, unread = state_of(env), state_of(env)
    before = read.linear_velocity("cube").tolist()
    env.step(torch.zeros(2, 15))
    assert read.linear_velocity("cube").tolist() == before
    with pytest.raises(SimulationError, match="no longer the present one"):
        unread.linear_velocity("cube")


def test_lengths_that_are_taken_together_are_those_of_single_rows(env: TaskEnv):
    env.reset(seed=0)
    for _ in range(3):
        env.step(torch.full((2, 15), 0.7))
    state = state_of(env)
    for _ in range(2):  # the second state takes all of them together
        spin, speed = state.spin("cube"), state.speed("cube")
        away = state.distance("cube", "goal_site")
        aside = state.planar_distance("cube", "goal_site")
        for env_id in range(2):
            row = slice(env_id, env_id + 1)
            assert norm(state.angular_velocity("cube")[row]) == spin[row] > 0
            assert norm(state.linear_velocity("cube")[row]) == speed[row] > 0
            assert norm(state.offset("cube", "goal_site")[row]) == away[row] > 0
            assert norm(state.offset("cube", "goal_site")[row, :2]) == aside[row] > 0
        state = state_of(env)


def test_a_remembered_answer_is_that_of_the_same_question(env: TaskEnv):
    env.step(torch.ones(2, 15))
    state = state_of(env)
    assert not state.is_static("left", threshold=0.0).any()
    assert state.is_static("left", threshold=100.0).all()


def test_contacts_of_unknown_names_are_refused_where_nothing_touches(env: TaskEnv):
    state = state_of(env)
    with pytest.raises(UnknownNameError, match="Did you mean 'cube'"):
        state.is_grasping("left", "cub")
    with pytest.raises(UnknownNameError, match="Did you mean 'cube'"):
        state.contact_force("left", "panda_leftfinger", "cub")
    with pytest.raises(UnknownNameError, match="Did you mean 'panda_leftfinger'"):
        state.contact_force("left", "panda_leftfingr", "cube")


def holding_a_tool():
    env = tasks.make("PullCubeTool-v1")
    env.reset(seed=0)
    world = env.simulation.worlds[0]
    x, y, z = state_of(env).tcp_position("arm")[0].tolist()
    world.set_pose("l_shape_tool", (x - 0.05, y, z))
    for _ in range(3):
        env.step(torch.tensor([[0.0] * 7 + [-1.0]]))
    return env


def test_a_grasp_may_be_told_by_a_narrower_angle():
    env = holding_a_tool()
    state = state_of(env)
    assert state.is_grasping("arm", "l_shape_tool").all()
    assert state.is_grasping("arm", "l_shape_tool", 90.0).all()
    assert not state.is_grasping("arm", "l_shape_tool", 0.0).any()


def test_other_links_than_a_robots_own_fingers_may_hold_a_body():
    env = holding_a_tool()
    state, own = state_of(env), env.layout["arm"].robot.fingers
    assert own is not None
    outwards = replace(own, opening_signs=(-1, 1))
    other = replace(own, links=("panda_leftfinger", "panda_hand"))
    assert state.is_held("arm", "l_shape_tool", own).all()
    assert not state.is_held("arm", "l_shape_tool", outwards).any()
    assert not state.is_held("arm", "l_shape_tool", other).any()
    with pytest.raises(UnknownNameError, match="Did you mean 'panda_leftfinger'"):
        state.is_held("arm", "l_shape_tool", replace(own, links=("panda_leftfingr", "panda_hand")))

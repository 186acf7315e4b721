"""FMBAssembly1Easy: when the bridge is in its place, and where the task's files come from."""

import numpy as np
import pytest
import torch

import tasks
from robot_layouts.simulation.sapien3.backend import worlds_below

TASK = "FMBAssembly1Easy-v1"
PLACE = (0.135, 0.0, 0.048667, 0.5**0.5, 0.0, 0.0, 0.5**0.5)  # of the bridge


def with_bridge_at(env: tasks.TaskEnv, x: float = 0.0, z: float = 0.0) -> None:
    """Put the bridge somewhere from its place (m), at rest."""
    bridge = env.get_state_dict()["actors"]["green_bridge"].clone()
    bridge[:] = torch.tensor([*PLACE, *[0.0] * 6])
    bridge[:, 0] += x
    bridge[:, 2] += z
    env.set_state_dict({"actors": {"green_bridge": bridge}})


def test_it_succeeds_within_half_a_centimetre_of_the_place():
    env = tasks.make(TASK)
    env.reset(seed=0)
    for x, success in ((0.0, True), (0.0045, True), (0.0055, False), (-0.0055, False)):
        with_bridge_at(env, x)
        assert env.evaluate(env.simulation.read())["success"].tolist() == [success], x


def test_a_bridge_that_is_let_go_above_its_place_settles_there():
    env = tasks.make(TASK)
    env.reset(seed=0)
    with_bridge_at(env, z=0.004)
    for _ in range(20):
        info = env.step(torch.zeros(1, 8))[-1]
    assert info["success"].all()
    assert env.state.speed("green_bridge").max() < 1e-3
    assert env.state.position("green_bridge")[0, 2] == pytest.approx(PLACE[2], abs=1e-3)


def test_the_frame_of_the_grasp_stays_where_the_bridge_began():
    env = tasks.make(TASK, num_envs=2)
    env.reset(seed=0)
    off = env.state.position("green_bridge") - env.state.position("bridge_grasp")
    np.testing.assert_allclose(off, [(0.0, 0.03, 0.0)] * 2, atol=1e-6)


def test_nothing_is_observed_but_the_robot():
    env = tasks.make(TASK, obs_mode="state_dict")
    obs, _ = env.reset(seed=0)
    assert obs["extra"] == {}


def test_parts_of_equal_files_weigh_the_same():
    env = tasks.make(TASK)
    bodies = worlds_below(env.simulation)[0].bodies
    purple, blue = (bodies[name].component.mass for name in ("purple_u", "blue_u"))
    assert purple == blue == pytest.approx(0.222, rel=1e-3)

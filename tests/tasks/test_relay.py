"""Relay: zones in reach of two neighbours each, visited in order, for three to eight robots."""

from itertools import cycle, islice
from math import hypot

import numpy as np
import pytest
import torch

import tasks
from layouts import Layout, ring
from robots import TaskError
from tasks.originals.relay import FARTHEST_REACH, find_zones
from tests.tasks.own import look, make, put

TASK = "Relay-v1"
KINDS = ("panda", "panda_stick", "panda_wristcam", "so100")


def mixed(count: int, radius: float = 0.9, kinds: tuple[str, ...] = KINDS) -> Layout:
    """Robots of all kinds in turn."""
    return ring(
        {f"robot{i}": kind for i, kind in enumerate(islice(cycle(kinds), count))}, radius=radius
    )


def three_kinds() -> Layout:
    """Two long arms that look along the ring, so that they start apart, and a short one."""
    robots = {"first": "panda", "second": "panda_stick", "third": "so100"}
    along, across = ring(robots, radius=0.62, facing="tangent"), ring(robots, radius=0.62)
    return Layout({**along, "third": across["third"]})


def at(zone: tuple[float, float]) -> tuple[float, float, float]:
    return (*zone, 0.015)


@pytest.mark.parametrize("count", range(3, 9))
def test_any_ring_builds_steps_and_is_observed_robot_by_robot(count: int):
    layout = three_kinds() if count == 3 else mixed(count, radius=0.7 + 0.03 * count)
    env = tasks.make(TASK, layout=layout)
    obs, _ = env.reset(seed=1)
    assert env.single_action_space.shape == (layout.action_dim,)
    obs, reward, *_ = env.step(env.action_space.sample())
    assert torch.isfinite(obs).all()
    assert torch.isfinite(reward).all()
    state = env.simulation.read()
    for robot in layout:
        part = env.observation_slices[f"{robot}_tcp_pose"]
        np.testing.assert_array_equal(obs[:, part], state.tcp_pose(robot))


@pytest.mark.parametrize("count", [2, 9])
def test_other_numbers_of_robots_are_refused(count: int):
    with pytest.raises(TaskError, match=f"Relay takes 3 to 8 robots; the layout has {count}"):
        tasks.make(TASK, layout=mixed(count))


@pytest.mark.parametrize(
    "layout", [three_kinds(), mixed(5), mixed(8, 0.95), mixed(8, 1.8, ("panda",))]
)
def test_each_zone_is_in_reach_of_both(layout: Layout):
    placements = list(layout.values())
    for i, (x, y) in enumerate(find_zones(layout)):
        for placement in (placements[i], placements[(i + 1) % len(placements)]):
            base_x, base_y, _ = placement.base_position
            share = hypot(x - base_x, y - base_y) / placement.robot.reach
            assert 0.6 <= share <= FARTHEST_REACH


def test_robots_too_far_apart_are_named():
    with pytest.raises(TaskError, match="'robot0' and 'robot1' stand 1.73 m apart.*Move them"):
        tasks.make(TASK, layout=mixed(3, 1.0))


def test_zones_count_in_order_only():
    env = make(TASK)
    zones = find_zones(env.layout)
    still = torch.zeros(1, env.layout.action_dim)
    for zone, expected in ((2, 0), (1, 0), (0, 1), (2, 1), (0, 1), (1, 2)):
        put(env, baton=at(zones[zone]))
        info = env.step(still)[4]
        assert info["zones_visited"].tolist() == [expected], f"after zone {zone}"
        assert not info["success"].any()
    put(env, baton=at(zones[2]))
    assert env.step(still)[4]["zones_visited"].tolist() == [3]
    assert env.step(still)[2].all()


def test_a_zone_ends_five_centimetres_from_its_middle():
    env = make(TASK)
    (x, y), *_ = find_zones(env.layout)
    still = torch.zeros(1, env.layout.action_dim)
    for way, expected in ((0.052, 0), (0.048, 1)):
        put(env, baton=(x + way, y, 0.015))
        assert env.step(still)[4]["zones_visited"].tolist() == [expected]


def test_the_state_dict_holds_the_progress():
    env, other = make(TASK), make(TASK)
    put(env, baton=at(find_zones(env.layout)[0]))
    env.step(torch.zeros(1, env.layout.action_dim))
    assert look(other)["zones_visited"].tolist() == [0]
    other.set_state_dict(env.get_state_dict())
    assert look(other)["zones_visited"].tolist() == [1]


def test_success_needs_rest_in_the_last_zone():
    env = make(TASK)
    zones = find_zones(env.layout)
    done = (*zones[-1], 0.2)
    assert put(env, baton=at(zones[-1]), beacon=done)["success"].all()
    assert not put(env, baton=at(zones[0]), beacon=done)["success"].any()
    assert not put(env, baton=at(zones[-1]), beacon=(*zones[-1], 0.1))["success"].any()
    state = env.get_state_dict()
    state["actors"]["beacon"][:, 2] = 0.2
    state["actors"]["baton"][:, 7] = 0.05
    env.set_state_dict(state)
    assert not look(env)["success"].any()


def test_environments_go_on_by_themselves():
    env = tasks.make(TASK, num_envs=2)
    env.reset(seed=0)
    state = env.get_state_dict()
    state["actors"]["baton"][1, :3] = torch.tensor(at(find_zones(env.layout)[0]))
    env.set_state_dict(state)
    info = env.step(torch.zeros(2, env.layout.action_dim))[4]
    assert info["zones_visited"].tolist() == [0, 1]
    env.reset(seed=0, env_ids=[1])
    assert look(env)["zones_visited"].tolist() == [0, 0]

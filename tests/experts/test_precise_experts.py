"""The experts that draw, insert, plug in and push do so by the means their tasks intend."""

import numpy as np
import pytest

import tasks
from layouts import Layout, Placement
from robot_layouts.experts import find_expert
from robot_layouts.experts.maniskill import push_t as push_t_module
from robot_layouts.kinematics.rotations import rotate
from robots import TaskError
from tasks.episode import play
from tests.data.expert_plays import episode, plan, seeds

pytestmark = pytest.mark.xdist_group("experts")  # they share plans

HELD = {"PegInsertionSide-v1": "peg", "PlugCharger-v1": "charger"}


def test_the_triangle_is_drawn_in_one_go():
    """From the first dot on every step leaves one: the stick is not lifted in between."""
    actors = episode("DrawTriangle-v1", 0).states["actors"]
    count = len(plan("DrawTriangle-v1", 0))
    drawn = [actors[f"dot_{i}"][-1, 2] > 0 for i in range(count)]
    assert sum(drawn) > 30
    assert all(drawn[drawn.index(True) :])


@pytest.mark.parametrize(("name", "seed"), [(name, s) for name in HELD for s in seeds(name)])
def test_what_is_put_in_is_held_to_the_end(name, seed):
    env = tasks.make(name)
    play(env, seed, plan(name, seed))
    assert bool(env.simulation.read().is_grasping("arm", HELD[name])[0])


@pytest.mark.parametrize("seed", [0, 1])
def test_the_peg_goes_in_straight(seed):
    actors = episode("PegInsertionSide-v1", seed).states["actors"]
    axes = [
        rotate(actors[body][-1, 3:7].astype(float), np.array([1.0, 0.0, 0.0]))
        for body in ("peg", "box_with_hole")
    ]
    assert axes[0] @ axes[1] > np.cos(0.06)  # 6 mm of play over 10 cm


@pytest.mark.parametrize("seed", seeds("PushT-v1"))
def test_the_t_is_pushed_over_the_table(seed):
    """The stick's friction lifts its near side a little, never off the table."""
    rows = episode("PushT-v1", seed).states["actors"]["Tee"]
    up = [rotate(row[3:7].astype(float), np.array([0.0, 0.0, 1.0]))[2] for row in rows]
    assert min(up) > np.cos(np.radians(3))
    assert rows[:, 2].max() < 0.02 + 0.005


@pytest.mark.parametrize("name", HELD)
def test_a_hand_without_camera_does_it_as_well(name):
    env = tasks.make(name, robots={"arm": "panda"})
    assert play(env, 0, find_expert(name)(env, 0)).solved


def test_a_stick_too_far_away_is_an_error(monkeypatch):
    monkeypatch.setattr(push_t_module, "ATTEMPTS", 1)
    away = Layout({"arm": Placement("panda_stick", position=(-3.0, 0.0, 0.0))})
    env = tasks.make("PushT-v1", layout=away)
    with pytest.raises(TaskError, match="^no plan: the T is out of reach"):
        find_expert("PushT-v1")(env, 0)

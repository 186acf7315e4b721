"""Jaws that swing as they close take what their role is to hold between them."""

from typing import Any

import numpy as np
import pytest

import tasks
from robot_layouts.experts import find_expert
from robot_layouts.experts.framed import FramedScene
from robot_layouts.experts.grips import role_grip
from robot_layouts.experts.hands import Hand
from robot_layouts.experts.script import Scene
from robot_layouts.experts.tips import pose_solver
from tasks.episode import play

PLACES = ("first", "second", "third")
SORT = "CellSortCubes-v1"


@pytest.fixture(scope="module")
def small():
    env = tasks.make(SORT, robots=dict.fromkeys(PLACES, "so101"), obs_mode="none")
    env.reset(seed=0)
    yield env
    env.close()


def held_at(env: Any, arm: str, qpos: np.ndarray) -> np.ndarray:
    """Return where a cube would be that the jaws are about to take, (3,) (m, world)."""
    grip = role_grip(env, arm)
    assert grip is not None
    return (Hand(env, arm).link(qpos[None])[0] @ grip.pose)[:3, 3]


def test_what_swings_is_seen_to_hold_a_cube_as_large_as_the_roles(small):
    grip = role_grip(small, "first")
    assert grip is not None
    motion = Hand(small, "first").motion
    assert motion.share(0.04 * small.task.fit.scale) < grip.share < 1.0


def test_other_grippers_and_roles_that_hold_nothing_have_no_such_grip(small):
    own = tasks.make(SORT, obs_mode="none")
    assert role_grip(own, "first") is None
    drawers = tasks.make("CellCloseDrawers-v1", robots={"first": "so101"}, obs_mode="none")
    assert role_grip(drawers, "first") is None


def test_scripts_bring_the_middle_of_what_is_held_to_places(small):
    scene, fit = Scene(small), small.task.fit
    qpos = scene.qpos("first")
    at = held_at(small, "first", qpos)
    assert scene.tcp("first")[0] == pytest.approx(at, abs=1e-5)
    framed = FramedScene(scene, fit)
    assert framed.in_world(framed.tcp("first"))[0] == pytest.approx(at, abs=1e-5)
    place, down = scene.body("first_red")[0], np.array([0.0, 1.0, 0.0, 0.0])
    found = pose_solver(small, "first").solve(place, down, qpos)
    assert found is not None
    qpos[Hand(small, "first").columns] = found
    assert held_at(small, "first", qpos) == pytest.approx(place, abs=3e-3)


@pytest.mark.long
@pytest.mark.parametrize("cell", [SORT, "CellSortByWord-v1"])
def test_cubes_are_sorted_by_arms_with_one_jaw_that_swings(cell: str):
    robots = dict.fromkeys(tasks.get_task_class(cell).layout, "so101")
    env = tasks.make(cell, robots=robots, obs_mode="none")
    plan = find_expert(cell)(env, 0)
    assert play(env, 0, plan).solved, plan.reason

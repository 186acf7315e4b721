"""TwoRobotLiftBar: what counts as lifted, level and held; one arm alone does not do."""

from dataclasses import replace
from math import cos, pi, radians, sin

import numpy as np
import pytest

import tasks
from robot_layouts.experts import find_expert
from robot_layouts.experts.originals.two_robot_lift_bar import STYLES, _script
from robot_layouts.experts.rehearsal import Rehearsal
from robot_layouts.simulation import State
from tasks.episode import play
from tests.tasks.own import look, make, put

TASK = "TwoRobotLiftBar-v1"


def tilted(degrees: float) -> tuple[float, ...]:
    """A bar in the air, along x, its +x end lower by an angle."""
    half = radians(degrees) / 2
    return (0.0, 0.0, 0.25, cos(half), 0.0, sin(half), 0.0)


@pytest.mark.parametrize(("degrees", "level"), [(0, True), (4.5, True), (-4.5, True), (5.5, False)])
def test_level_is_within_five_degrees(degrees: float, level: bool):
    told = put(make(TASK), bar=tilted(degrees))
    assert told["is_bar_lifted"].all()
    assert bool(told["is_bar_level"].all()) is level
    assert not told["success"].any()


@pytest.mark.parametrize(("height", "lifted"), [(0.199, False), (0.201, True)])
def test_lifted_is_from_a_fifth_of_a_metre(height: float, lifted: bool):
    told = put(make(TASK), bar=(0.0, 0.0, height, cos(pi / 4), 0.0, 0.0, sin(pi / 4)))
    assert bool(told["is_bar_lifted"].all()) is lifted


def test_success_needs_both_grippers_and_rest():
    env = tasks.make(TASK)
    env.reset(0, options={"reconfigure": True})
    rewards = []
    for action in find_expert(TASK)(env, 0):
        _, reward, terminated, _, info = env.step(action[None])
        rewards.append(float(reward[0]))
    assert terminated.all()
    assert rewards[-1] == 1.0
    assert rewards[-1] > rewards[len(rewards) // 2] > rewards[0]
    assert info["is_left_grasping"].all()
    assert info["is_right_grasping"].all()


@pytest.mark.long
@pytest.mark.parametrize("robot", ["left", "right"])
@pytest.mark.parametrize("what", ["is_grasping", "is_static"])
def test_neither_arm_may_let_go_or_move(monkeypatch, robot: str, what: str):
    env = tasks.make(TASK)
    assert play(env, 0, find_expert(TASK)(env, 0)).solved
    assert look(env)["success"].all()
    told = getattr(State, what)

    def all_but_one(state: State, name: str, *arguments: object) -> np.ndarray:
        return told(state, name, *arguments) & (name != robot)

    monkeypatch.setattr(State, what, all_but_one)
    assert not look(env)["success"].any()


def test_one_arm_alone_does_not_keep_it_level():
    rehearsal = Rehearsal(tasks.make(TASK))
    script = _script(STYLES[0], rehearsal.begin(0))
    alone = [replace(waypoint, after=()) for waypoint in script["left"]]
    assert not rehearsal.play({"left": alone}).success
    told = look(rehearsal.task)
    assert told["is_left_grasping"].all()
    assert not (told["is_bar_lifted"] & told["is_bar_level"]).any()

"""The experts solve their tasks, here and in native, and say what they cannot do."""

import numpy as np
import pytest

import tasks
from layouts import face_to_face
from robot_layouts.experts import find_expert, list_experts, register_expert
from robot_layouts.experts.registry import EXPERTS
from robots import TaskError, UnknownNameError
from tasks.episode import play
from tests.data.hand_overs import TASK, plan

pytestmark = pytest.mark.xdist_group("experts")  # they share plans


@pytest.mark.long
@pytest.mark.parametrize("mode", ["sparse", "dense"])
def test_the_plan_does_not_depend_on_modes(mode):
    env = tasks.make(TASK, num_envs=3, reward_mode=mode, obs_mode="none")
    np.testing.assert_array_equal(find_expert(TASK)(env, 2), plan(2))


@pytest.mark.long
@pytest.mark.parametrize("spacing", [1.4, 1.6])
def test_other_layouts_are_planned_for(spacing):
    layout = face_to_face({"left": "panda", "right": "panda_wristcam"}, spacing=spacing)
    env = tasks.make(TASK, layout=layout)
    assert play(env, 0, find_expert(TASK)(env, 0)).solved


@pytest.mark.long
def test_arms_too_far_apart_are_an_error():
    env = tasks.make(
        TASK, layout=face_to_face(dict.fromkeys(("left", "right"), "panda"), spacing=4)
    )
    with pytest.raises(TaskError, match=r"^no plan: \w+\.\w+ is out of"):
        find_expert(TASK)(env, 0)


def test_every_listed_expert_is_found():
    assert TASK in list_experts()
    assert all(callable(find_expert(name)) for name in list_experts())
    assert find_expert("maniskill.two_robot_pick_cube_native") is find_expert(TASK)


def test_an_unknown_task_is_named_with_the_closest():
    with pytest.raises(UnknownNameError, match=r"unknown task 'TwoRobotPickCub'. Did you mean"):
        find_expert("TwoRobotPickCub")


def test_a_task_without_an_expert_says_which_have_one(monkeypatch):
    monkeypatch.setattr(EXPERTS, "lines", {TASK: EXPERTS.lines[TASK]})
    monkeypatch.setattr(EXPERTS, "registered", {})
    with pytest.raises(TaskError, match=f"PushT-v1 has no expert yet; tasks with one: {TASK}"):
        find_expert("PushT-v1")


def test_an_expert_can_be_registered(monkeypatch):
    monkeypatch.setattr(EXPERTS, "registered", {})
    expert = register_expert("pusht-v1", lambda task, seed: np.zeros((1, 7), np.float32))
    assert find_expert("PushT-v1") is expert
    assert "PushT-v1" in list_experts()

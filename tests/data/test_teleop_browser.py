"""Tasks solved on the page of ``teleop`` by mouse and keyboard, in a real browser."""

import os
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

import tasks
from benchmarks.teleop import served
from robot_layouts.data.playing.replay import replay
from robot_layouts.data.reading.recorded_task import task_for
from robot_layouts.data.reading.recording import FILE, Recording
from robot_layouts.data.teleop.session import Session
from tests.data.steering_hands import Hands, yaw_between
from tests.pages import browser_page

pytestmark = [pytest.mark.browser, pytest.mark.long]

HIGH, LOW = 0.14, 0.02  # m, of a TCP above the table


def pose_of(session, body):
    return session.task.simulation.read().pose(body)[0].astype(float)


def grasp(hands, arm, place):
    hands.bring(arm, place + [0, 0, HIGH - place[2]])
    hands.bring(arm, place)
    hands.press("g")
    hands.wait(0.7)


@contextmanager
def hands_on(task_id, folder):
    """Yield hands on the page of the command, and a session that stands as the one there."""
    words = ("teleop", task_id, "--port", "0", "--out", str(folder))
    model = Session(tasks.make(task_id))
    with served("robot_layouts", *words) as command, browser_page() as (page, _):
        hands = Hands(page, command.url, model)
        hands.press("p")
        yield hands, model
        page.screenshot(path=folder / "solved.png")
        hands.keep()
        print(hands.measured())
        status, said = command.interrupt()
        assert (status, said) == (0, f"{folder / FILE}: 1 episode, 1 of them new\n")
    model.task.close()


def expect_replay(folder, task_id):
    with Recording(folder / FILE) as file:
        trajectory = file[0]
        assert trajectory.source == {"kind": "person", "name": "browser"}
        task = task_for(file)
        assert task.task_id == task_id
        replayed = replay(task, trajectory)
        assert replayed.exact
        assert replayed.success
        assert replayed.difference is None
        task.close()


def test_two_robot_pick_cube_is_solved_by_hand(tmp_path):
    with hands_on("TwoRobotPickCube-v1", tmp_path) as (hands, model):
        cube, goal = pose_of(model, "cube"), pose_of(model, "goal_site")
        hands.turn("left", yaw_between(hands.turns["left"], cube[3:]))
        grasp(hands, "left", cube[:3])
        middle = np.array([0.0, 0.02, LOW])
        hands.bring("left", middle + [0, 0, 0.04])
        hands.bring("left", middle)
        hands.press("g")
        hands.bring("left", middle + [0, 0, HIGH])
        hands.bring("left", np.array([0.0, -0.2, HIGH]))
        hands.turn("right", yaw_between(hands.turns["right"], hands.turns["left"]))
        grasp(hands, "right", middle)
        hands.bring("right", goal[:3])
    expect_replay(tmp_path, "TwoRobotPickCube-v1")


def test_a_task_from_outside_is_solved_by_hand(tmp_path, monkeypatch):
    tutorials = Path(__file__).parents[2] / "docs/tutorials"
    monkeypatch.setenv("PYTHONPATH", str(tutorials), prepend=os.pathsep)
    monkeypatch.syspath_prepend(str(tutorials))
    with hands_on("tray:TwoArmTray-v1", tmp_path) as (hands, model):
        tray = pose_of(model, "tray")[:3]
        for arm, side in (("left", -1), ("right", 1)):
            grasp(hands, arm, tray + [0, side * 0.25, 0])
        for _ in range(21):
            for number in "12":
                hands.press(number)
                hands.press("u")
    expect_replay(tmp_path, "TwoArmTray-v1")

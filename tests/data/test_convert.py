"""Recordings in other control modes: converted, replayed, recorded by experts."""

from __future__ import annotations

import json
import re
import shutil
from contextlib import closing

import numpy as np
import pytest

import tasks
from layouts import Layout, Placement
from robot_layouts.__main__ import main
from robot_layouts.data.playing.mode_conversion import why_lost
from robot_layouts.data.playing.replay import open_recording, replay
from robot_layouts.data.reading.recorded_task import task_for
from robot_layouts.data.recording.record import record
from tests.data.recordings import edited

TASK = "PickCube-v1"
SEEDS = (0, 1)
MODE = "pd_ee_target_delta_pose"


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    folder = tmp_path_factory.mktemp("recording")
    record(TASK, SEEDS, folder, workers=0)
    return folder


def replays(folder):
    with open_recording(folder, None) as file:
        task = task_for(file)
        return [replay(task, episode) for episode in file]


@pytest.mark.long
def test_there_and_back(recording, tmp_path, capsys):
    assert main(["convert", str(recording), "--to", MODE, "--out", str(tmp_path / "poses")]) == 0
    assert "2 of 2 successful episodes succeed" in capsys.readouterr().out
    found = replays(tmp_path / "poses")
    assert [episode.seed for episode in found] == list(SEEDS)
    assert all(episode.success and episode.difference is None for episode in found)
    with open_recording(tmp_path / "poses", None) as file:
        assert file.control_mode == MODE
        assert file[0].states["controller"]["arm/target_pose"].shape[1] == 7
    words = ["convert", str(tmp_path / "poses"), "--to", "pd_joint_delta_pos"]
    assert main([*words, "--out", str(tmp_path / "deltas")]) == 0
    assert all(episode.success for episode in replays(tmp_path / "deltas"))


@pytest.mark.long
def test_what_pressed_presses_as_much(tmp_path):
    record("PegInsertionSide-v1", [0], tmp_path / "deltas", workers=0)
    for mode in ("pd_joint_vel", "pd_joint_delta_pos_vel"):
        words = ["convert", str(tmp_path / "deltas"), "--to", mode, "--out", str(tmp_path / mode)]
        assert main(words) == 0
    with (
        open_recording(tmp_path / "deltas", None) as before,
        open_recording(tmp_path / "pd_joint_vel", None) as speeds,
        open_recording(tmp_path / "pd_joint_delta_pos_vel", None) as same,
    ):
        assert len(speeds[0].actions) == len(before[0].actions)
        for name, rows in before[0].states["articulations"].items():
            np.testing.assert_array_equal(same[0].states["articulations"][name], rows)


@pytest.mark.long
def test_a_conversion_goes_on_where_it_stopped(recording, tmp_path, capsys):
    words = ["convert", str(recording), "--to", "pd_joint_vel", "--out", str(tmp_path)]
    assert main([*words, "--episodes", "1"]) == 0
    first = (tmp_path / "trajectory.h5").read_bytes()
    assert main(words) == 0
    capsys.readouterr()
    written = json.loads((tmp_path / "trajectory.json").read_text())
    assert [episode["episode_seed"] for episode in written["episodes"]] == list(SEEDS)
    assert len((tmp_path / "trajectory.h5").read_bytes()) > len(first)


def test_episodes_that_failed_are_left_out(recording, tmp_path, capsys):
    shutil.copytree(recording, tmp_path / "failed")
    with edited(tmp_path / "failed" / "trajectory.h5") as file:
        file["traj_0/success"][-1] = False
    words = ["convert", str(tmp_path / "failed"), "--to", "pd_ee_pose"]
    assert main([*words, "--out", str(tmp_path / "out")]) == 0
    printed = capsys.readouterr().out
    assert "1 of 1 successful episodes succeed" in printed
    assert "no seed or no success: the episodes 0" in printed
    assert [episode.seed for episode in replays(tmp_path / "out")] == [SEEDS[1]]


def test_the_layout_that_is_given_is_used(recording, tmp_path, capsys):
    placement = Placement("panda", position=(-0.7, 0.0, 0.0))
    cell = str(Layout({"arm": placement}).save(tmp_path / "cell.yaml"))
    words = ["convert", str(recording), "--to", MODE, "--out", str(tmp_path / "x")]
    assert main([*words, "--layout", cell]) == 1
    assert "arm.position: recorded [-0.615, 0.0, 0.0], here [-0.7" in capsys.readouterr().err
    assert not (tmp_path / "x").exists()


@pytest.mark.parametrize(
    ("mode", "complaint"),
    [
        ("pd_ee_dance", "control_mode 'pd_ee_dance' is not offered"),
        ("leg=pd_ee_pose", "unknown robot of this layout 'leg'"),
    ],
)
def test_what_is_no_mode(recording, tmp_path, capsys, mode, complaint):
    assert main(["convert", str(recording), "--to", mode, "--out", str(tmp_path / "x")]) == 1
    assert complaint in capsys.readouterr().err
    assert not (tmp_path / "x").exists()


@pytest.mark.long
def test_experts_record_with_a_mode_for_each_arm(tmp_path):
    mode = {"left": "pd_ee_delta_pose", "right": "pd_joint_pos"}
    summary = record("TwoRobotPickCube-v1", [0], tmp_path, workers=0, control_mode=mode)
    assert summary.played[0].success
    with open_recording(tmp_path, None) as file:
        assert file.control_mode == mode
    found = replays(tmp_path)
    assert [(episode.success, episode.difference) for episode in found] == [(True, None)]
    about = json.loads((tmp_path / "trajectory.json").read_text())
    assert about["episodes"][0]["control_mode"] == {
        "panda_wristcam-0": "pd_ee_delta_pose",
        "panda_wristcam-1": "pd_joint_pos",
    }


def test_a_layout_that_was_put_into_a_mode_is_recorded_in_it(recording, tmp_path):
    layout = tasks.get_task_class(TASK).layout.in_control_mode(MODE)
    assert record(TASK, [0], tmp_path / "poses", workers=0, layout=layout).played[0].success
    with open_recording(tmp_path / "poses", None) as file:
        assert file.control_mode == MODE
    assert [(e.success, e.difference) for e in replays(tmp_path / "poses")] == [(True, None)]


@pytest.mark.parametrize(
    ("mode", "share", "reason"),
    [
        (
            "pd_ee_delta_pos",
            1.0,
            r"place of the TCP only; the recording turns it by \d+°$",
        ),
        ("pd_ee_delta_pose", 1.0, r"none of \d+ tries solves the task"),
        ("pd_ee_delta_pos", 0.0, "in its own mode the task is not solved, either"),
    ],
)
def test_why_one_is_not_kept(recording, mode, share, reason):
    with open_recording(recording, None) as file, closing(task_for(file)) as source:
        episode = file[0]
        with closing(tasks.make(TASK, obs_mode="none", control_mode=mode)) as task:
            why = why_lost(source, episode.seed, share * episode.actions, task)
    assert re.search(reason, why)


@pytest.mark.long
def test_what_rolls_on_by_itself_is_tried_beside_what_was_learnt(tmp_path):
    record("RollBall-v1", [2], tmp_path / "deltas", workers=0)
    words = ["convert", str(tmp_path / "deltas"), "--to", "pd_ee_pose"]
    assert main([*words, "--out", str(tmp_path / "poses")]) == 0
    assert main([*words, "--out", str(tmp_path / "again")]) == 0
    with (
        open_recording(tmp_path / "poses", None) as first,
        open_recording(tmp_path / "again", None) as second,
    ):
        np.testing.assert_array_equal(first[0].actions, second[0].actions)

"""Where a placement's joints start: at a keyframe's positions, or at its own."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

import tasks
from layouts import Layout, Placement
from robot_layouts.data.reading.recorded_task import layout_again, task_for
from robot_layouts.data.reading.recording import Recording
from robot_layouts.data.recording.recorder import Recorder
from robots import LayoutError
from tasks.episode import play
from tests.data.plays import at_random

QPOS = (0.1, 0.4, 0.0, -2.0, 0.0, 2.4, 0.8, 0.03, 0.03)
BENT = Placement("panda", (-0.6, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), qpos=QPOS)


def test_it_starts_from_its_own_positions():
    assert BENT.start_qpos == QPOS
    assert BENT.start_keyframe is None
    assert replace(BENT, qpos=None).start_keyframe == "rest"


def test_limbs_start_from_their_own_share_of_them():
    body = Placement("mobile_panda_dual", qpos=range(22))
    assert body.parts["left"].start_qpos == tuple(range(9))
    assert body.parts["right"].start_qpos == tuple(range(9, 18))
    assert body.parts["body"].start_qpos[0] == 18


def test_another_robot_of_the_same_joints_starts_there_too():
    assert BENT.with_robot("panda_wristcam").start_qpos == QPOS
    assert BENT.with_robot("so100").qpos is None


def test_what_is_no_start_is_refused():
    with pytest.raises(LayoutError, match=r"qpos of panda, which has 9 joints, .* takes 9 "):
        Placement("panda", qpos=QPOS[1:])
    with pytest.raises(LayoutError, match="qpos and keyframe 'rest' are given"):
        Placement("panda", keyframe="rest", qpos=QPOS)


def test_a_file_keeps_it():
    layout = Layout({"arm": BENT})
    text = layout.to_yaml()
    assert "    qpos: [0.1, 0.4, " in text
    assert Layout.from_yaml(text) == layout
    with pytest.raises(LayoutError, match=r"line 8: qpos of panda"):
        Layout.from_yaml(text.replace("qpos: [0.1, ", "qpos: ["))


def test_checks_look_at_it():
    beyond = replace(BENT, qpos=(4.0, *QPOS[1:]))
    (finding,) = Layout({"arm": beyond}).validate(samples=0, workspaces=False).findings
    assert "qpos of arm puts panda_joint1 at 4 rad" in str(finding)
    assert "or start from other joint positions than qpos" in str(finding)


def test_a_recording_begins_there_again(tmp_path: Path):
    env = tasks.make("PickCube-v1", layout=Layout({"arm": BENT}))
    path = tmp_path / "trajectory.h5"
    with Recorder(path, env) as recorder:
        recorder.add(play(env, 3, at_random(env, 3)))
    with Recording(path) as recording:
        assert layout_again(recording.layout, {}, env.task_class.layout, {}, path)["arm"] == BENT
        assert task_for(recording).layout["arm"].start_qpos == QPOS

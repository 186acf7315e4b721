"""`python -m robot_layouts replay`: what is played again is the same, and what is not is named."""

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest

import tasks
from layouts import Frame, Layout
from robot_layouts.__main__ import main
from robot_layouts.data.playing.mode_conversion import as_positions
from robot_layouts.data.playing.replay import find_official, open_recording, replay
from robot_layouts.data.reading.json_files import TrajectoryError
from robot_layouts.data.reading.provenance import describe_layout
from robot_layouts.data.reading.recorded_task import layout_again, same_places, task_for
from robot_layouts.data.reading.recording import Recording
from robot_layouts.data.recording.recorder import Recorder
from tasks.episode import play
from tests.data.plays import at_random
from tests.data.recordings import edited

TASK = "PushT-v1"
SEEDS = (3, 5)


@pytest.fixture(scope="module", params=["pd_joint_delta_pos", "pd_joint_pos"])
def recording(request, tmp_path_factory):
    env = deltas = tasks.make(TASK, control_mode=request.param)
    if request.param == "pd_joint_pos":
        deltas = tasks.make(TASK)
    path = tmp_path_factory.mktemp(request.param) / "trajectory.h5"
    with Recorder(path, env) as recorder:
        for seed in SEEDS:
            actions = at_random(deltas, seed)
            if env is not deltas:
                actions = as_positions(deltas, seed, actions)
            recorder.add(play(env, seed, actions))
    return path


@pytest.fixture
def path(recording, tmp_path):
    """A copy that may be changed."""
    return shutil.copytree(recording.parent, tmp_path / "copy") / recording.name


def run(capsys, *words):
    code = main(["replay", *map(str, words)])
    captured = capsys.readouterr()
    return code, " ".join(captured.out.split()), captured.err


def change(path, entry, edit):
    with edited(path) as file:
        values = file[entry][()]
        edit(values)
        file[entry][...] = values


def test_the_same_again(capsys, recording):
    for where in (recording, recording.parent):
        code, printed, _ = run(capsys, where)
        assert code == 0
        assert f"{recording}: PushT-v1, {recording.parent.name[:-1]}" in printed
        assert "0 3 23 failure failure equal 1 5 20 failure failure equal" in printed
        assert "2 of 2 episodes end as recorded; in 2 all states are equal to the last b" in printed


def test_the_body_with_the_largest_difference_is_named(capsys, path):
    def push(amount):
        def edit(rows):
            rows[7, 2] += np.float32(amount)

        return edit

    change(path, "traj_0/env_states/actors/Tee", push(0.001))
    change(path, "traj_0/env_states/actors/goal_Tee", push(0.25))
    _, printed, _ = run(capsys, path)
    assert "from step 7 in Tee, max |Δ| 2.5e-01 in goal_Tee" in printed


def test_states_that_differ_are_found(capsys, path):
    def nudge(rows):
        rows[7, 2] = np.nextafter(rows[7, 2], np.float32(1))

    change(path, "traj_1/env_states/actors/Tee", nudge)
    code, printed, _ = run(capsys, path)
    assert code == 1
    assert "5 20 failure failure differ from step 7 in Tee, max |Δ|" in printed
    assert "in 1 all states are equal" in printed


def test_another_outcome_is_found(capsys, path):
    def succeed(flags):
        flags[-1] = True

    change(path, "traj_0/success", succeed)
    code, printed, _ = run(capsys, path)
    assert code == 1
    assert "0 3 23 success failure equal" in printed
    assert "1 of 2 episodes end as recorded" in printed


def test_from_a_state(capsys, path):
    code, printed, _ = run(capsys, path, "--from", "state")
    assert code == 0
    assert "From a state no replay is exact" in printed
    summary = json.loads(path.with_suffix(".json").read_text())
    for episode in summary["episodes"]:
        episode["reset_kwargs"] = {}  # as native writes it for many environments at once
    path.with_suffix(".json").write_text(json.dumps(summary))
    code, printed, _ = run(capsys, path, "--from", "state")
    assert code == 0
    assert "0 – 23" in printed
    code, _, said = run(capsys, path)
    assert code == 1
    assert "traj_0 has no reset seed; start from its state" in said


def test_a_file_without_states(capsys, path):
    with edited(path) as file:
        del file["traj_0/env_states"]
    code, printed, _ = run(capsys, path)
    assert code == 0
    assert "0 3 23 failure failure not recorded" in printed
    code, _, said = run(capsys, path, "--from", "state")
    assert code == 1
    assert "traj_0 holds no states; start from its seed" in said


def test_a_replay_from_the_wrong_state_is_seen(recording):
    with Recording(recording) as file:
        first, second = file
        env = task_for(file)
        swapped = replace(first, states=second.states, seed=first.seed, actions=second.actions)
        assert replay(env, second).difference is None
        assert replay(env, swapped).difference.step == 0


def test_another_world_is_refused(capsys, path):
    with edited(path) as file:
        layout = json.loads(file.attrs["layout"])
        layout["arm"]["joint_groups"]["arm"]["stiffness"] = 999.0
        file.attrs["layout"] = json.dumps(layout)
    code, _, said = run(capsys, path)
    assert code == 1
    assert "arm.joint_groups.arm.stiffness: recorded 999.0, here 1000.0" in said


def test_a_robot_that_stood_elsewhere_stands_there_again(capsys, path):
    with edited(path) as file:
        layout = json.loads(file.attrs["layout"])
        layout["arm"]["position"][2] = 0.1  # where it was not: another episode is played
        file.attrs["layout"] = json.dumps(layout)
    code, printed, _ = run(capsys, path)
    assert code == 1
    assert "differ at the start in panda_stick" in printed


def test_the_layout_of_a_recording_says_where_the_task_lay():
    own = tasks.get_task_class("CellPutAndClose-v1").layout
    moved = Layout(own, {"task": Frame((0.05, 0.0, 0.0), rpy=(0.0, 0.0, 0.1))})
    again = layout_again(describe_layout(moved), {}, own, {}, "a file")
    assert again.frame_poses == moved.frame_poses
    assert same_places(again, moved)
    assert not same_places(again, own)
    assert layout_again(describe_layout(own), {}, own, {}, "a file").frames == {}


@pytest.mark.parametrize(
    ("edit", "words", "code", "complaint"),
    [
        ({"env_id": "PushX-v1"}, [], 2, "unknown task 'PushX-v1'. Did you mean 'PushT-v1'?"),
        ({}, ["--task", "pick_cube"], 1, "was recorded in PushT-v1, not in PickCube-v1"),
        ({"env_id": "PickCube-v1"}, [], 1, "differ at the start in Tee"),
    ],
)
def test_a_file_of_something_else(capsys, path, edit, words, code, complaint):
    summary = json.loads(path.with_suffix(".json").read_text())
    summary["env_info"].update(edit)
    path.with_suffix(".json").write_text(json.dumps(summary))
    found, printed, said = run(capsys, path, *words)
    assert found == code
    assert complaint in said + printed


class TestOfficialFiles:
    @pytest.fixture
    def demos(self, tmp_path, monkeypatch):
        monkeypatch.setenv("MS_ASSET_DIR", str(tmp_path))
        return tmp_path / "demos" / TASK

    def put(self, recording, folder, **env_kwargs):
        shutil.copytree(recording.parent, folder)
        beside = folder / "trajectory.json"
        summary = json.loads(beside.read_text())
        summary["env_info"]["env_kwargs"].update(env_kwargs)
        if mode := env_kwargs.get("control_mode"):
            del summary["layout"]  # as in a file of ManiSkill's
            for episode in summary["episodes"]:
                episode["control_mode"] = mode
        beside.write_text(json.dumps(summary))
        return folder / recording.name

    def test_one_of_the_task_is_found(self, capsys, recording, demos):
        self.put(recording, demos / "a", control_mode="pd_ee_dance")
        self.put(recording, demos / "b", sim_backend="physx_cuda")
        chosen = self.put(recording, demos / "c")
        assert find_official(TASK) == chosen
        code, printed, _ = run(capsys, "--task", "push_t")
        assert code == 0
        assert str(chosen) in printed

    def test_none(self, capsys, recording, demos):
        code, _, said = run(capsys, "--task", TASK)
        assert code == 1
        assert f"there is no recording of PushT-v1 in {demos} that can be played" in said
        assert "robot-layouts record" in said
        self.put(recording, demos / "a", control_mode="pd_ee_dance")
        with pytest.raises(TrajectoryError, match=r"\n  .*was recorded in pd_ee_dance"):
            open_recording(None, TASK)

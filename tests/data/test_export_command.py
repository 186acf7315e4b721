"""`robot-layouts export`: what it says, what it refuses, that it leaves nothing half-done."""

import dataclasses
import json
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import duckdb
import numpy as np
import pytest

import robot_layouts.core.progress as progress
import tasks
from layouts import Layout, Placement
from robot_layouts.__main__ import main
from robot_layouts.data.export import dataset
from robot_layouts.data.export.columns import ColumnReader
from robot_layouts.data.export.dataset import Export, export
from robot_layouts.data.reading.recording import Trajectory
from robot_layouts.data.recording.recorder import Recorder
from robots import RobotRegistry, TaskError
from robots.descriptor import ActionSplit
from tasks.episode import play
from tests.data.recordings import edited, record, succeed

TASK = "PushT-v1"


@pytest.fixture
def recording(tmp_path) -> Path:
    return record(tmp_path / "recording.h5", TASK, [3, 2, 4])


def run(recording: Path, *words: object) -> int:
    """Export all episodes: those of random actions are failures."""
    return main(["export", str(recording), "--include-failures", *map(str, words)])


def episodes(dataset: Path) -> list[int]:
    """Return the length of each episode of a LeRobot dataset."""
    text = f"select length from '{dataset}/meta/episodes/*/*.parquet' order by episode_index"
    return [row[0] for row in duckdb.execute(text).fetchall()]


def test_the_command_writes_a_dataset_and_says_so(recording, tmp_path, capsys):
    out = tmp_path / "new" / "dataset"
    assert run(recording, "--format", "lerobot", "--out", out) == 0
    assert capsys.readouterr().out == f"{out}: 3 episodes, 9 steps\n"
    assert episodes(out) == [3, 2, 4]
    assert [path.name for path in out.parent.iterdir()] == ["dataset"]


@pytest.mark.parametrize("more", [(), ("--only-successes",)])  # which says what happens anyway
def test_failures_are_left_out(recording, tmp_path, capsys, more):
    succeed(recording, 0, 2)
    words = ("--format", "lerobot", "--out", str(tmp_path / "out"))
    assert main(["export", str(recording), *words, *more]) == 0
    expected = (
        "2 episodes, 7 steps; left out: 1 episode without success (--include-failures exports"
    )
    assert expected in capsys.readouterr().out
    assert episodes(tmp_path / "out") == [3, 4]
    origin = json.loads((tmp_path / "out/meta/recording.json").read_text())
    assert [episode["episode_id"] for episode in origin["episodes"]] == [0, 2]


def test_a_recording_without_a_layout_is_of_the_tasks_own_robots(recording, tmp_path):
    with edited(recording) as file:
        del file.attrs["layout"]  # as in native's files
    assert run(recording, "--format", "lerobot", "--out", tmp_path / "out") == 0
    info = json.loads((tmp_path / "out/meta/info.json").read_text())
    assert info["robot_type"] == "panda_stick"


def test_a_rate_of_the_task_is_the_datasets(tmp_path):
    task = tasks.make(TASK, obs_mode="none", control_frequency=10)
    with Recorder(tmp_path / "slow.h5", task) as recorder:
        recorder.add(play(task, 0, np.zeros((2, 7), np.float32)))
    assert run(tmp_path / "slow.h5", "--format", "lerobot", "--out", tmp_path / "out") == 0
    assert json.loads((tmp_path / "out/meta/info.json").read_text())["fps"] == 10


def test_a_recording_of_other_robots_is_refused(recording, tmp_path, capsys):
    with edited(recording) as file:
        layout = json.loads(file.attrs["layout"])
        layout["arm"]["joint_groups"]["arm"]["stiffness"] = 1.0
        file.attrs["layout"] = json.dumps(layout)
    assert run(recording, "--format", "lerobot", "--out", tmp_path / "out") == 1
    assert "arm.joint_groups.arm.stiffness: recorded 1.0, here 1000.0" in capsys.readouterr().err
    assert nothing_was_left(tmp_path)


def test_joint_positions_as_actions_are_exported_too(tmp_path):
    task = tasks.make(TASK, obs_mode="none", control_mode="pd_joint_pos")
    actions = np.tile(task.simulation.read().qpos("arm")[0], (2, 1))
    with Recorder(tmp_path / "positions.h5", task) as recorder:
        recorder.add(play(task, 0, actions))
    assert run(tmp_path / "positions.h5", "--format", "lerobot", "--out", tmp_path / "out") == 0
    rows = duckdb.execute(f"select action from '{tmp_path}/out/data/*/*.parquet'").fetchall()
    np.testing.assert_array_equal(np.array(rows, np.float32)[:, 0], actions)
    origin = json.loads((tmp_path / "out/meta/recording.json").read_text())
    assert origin["control_mode"] == "pd_joint_pos"


def test_what_was_not_recorded_is_left_out(recording, tmp_path):
    with edited(recording) as file:
        for episode in file.values():
            del episode["rewards"], episode["success"]
    assert run(recording, "--format", "lerobot", "--out", tmp_path / "out") == 0
    assert run(recording, "--format", "robomimic", "--out", tmp_path / "other") == 0
    features = json.loads((tmp_path / "out/meta/info.json").read_text())["features"]
    assert "next.done" in features
    assert not {"next.reward", "next.success"} & set(features)


def test_a_long_export_shows_how_far_it_is(recording, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(progress, "PATIENCE", 0.0)
    assert run(recording, "--format", "lerobot", "--out", tmp_path / "out") == 0
    assert "exporting recording.h5: 1 of 3 episodes" in capsys.readouterr().err


def test_a_wrong_format_is_told_the_right_ones(recording, tmp_path, capsys):
    assert run(recording, "--format", "lerobt", "--out", tmp_path / "out") == 2
    assert capsys.readouterr().err == (
        "error: unknown export format 'lerobt'. Did you mean 'lerobot'?"
        " Choices: lerobot, robomimic.\n"
    )


@pytest.mark.parametrize("form", ["lerobot", "robomimic"])
def test_a_used_folder_is_left_alone(recording, tmp_path, capsys, form):
    (tmp_path / "out").mkdir()
    (tmp_path / "out/mine").write_text("keep")
    assert run(recording, "--format", form, "--out", tmp_path / "out") == 1
    assert "out is not empty; choose another folder" in capsys.readouterr().err
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["mine"]


def test_an_empty_recording_is_refused(tmp_path, capsys):
    recording = record(tmp_path / "empty.h5", TASK, [])
    assert run(recording, "--format", "lerobot", "--out", tmp_path / "out") == 1
    assert "empty.h5 holds no episodes; there is nothing to export" in capsys.readouterr().err


def test_a_recording_without_successes_is_refused(recording, tmp_path, capsys):
    words = ("--format", "robomimic", "--out", str(tmp_path / "out"))
    assert main(["export", str(recording), *words]) == 1
    said = capsys.readouterr().err
    assert "none of the 3 episodes" in said
    assert "to export them all the same, take include_failures (--include-failures)" in said
    assert nothing_was_left(tmp_path)


def nothing_was_left(folder: Path) -> bool:
    return {path.name for path in folder.iterdir()} == {"recording.h5", "recording.json"}


@pytest.mark.parametrize("form", ["lerobot", "robomimic"])
@pytest.mark.parametrize(
    ("entry", "complaint"),
    [
        ("env_states", "episode 1 was recorded without states"),
        ("env_states/actors/Tee", "episode 1: actors/Tee is missing in its states; PushT-v1 with"),
        ("rewards", "episode 1 and those before it do not both have rewards"),
    ],
)
def test_an_episode_that_lacks_something_ends_the_export(
    recording, tmp_path, capsys, form, entry, complaint
):
    with edited(recording) as file:
        del file[f"traj_1/{entry}"]
    assert run(recording, "--format", form, "--out", tmp_path / "out") == 1
    assert complaint in capsys.readouterr().err
    assert nothing_was_left(tmp_path)


def test_whatever_ends_an_export_it_leaves_nothing(recording, tmp_path):
    def interrupt(done: float, total: int) -> None:
        if done == 2:
            raise KeyboardInterrupt

    for form in ("lerobot", "robomimic"):
        with pytest.raises(KeyboardInterrupt):
            export(Export(recording, form, tmp_path / "out", include_failures=True), interrupt)
        assert nothing_was_left(tmp_path)


def test_without_pyarrow_the_extra_is_named(recording, tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    assert run(recording, "--format", "lerobot", "--out", tmp_path / "out") == 1
    assert "need pyarrow: pip install 'robot-layouts[export]'" in capsys.readouterr().err
    assert run(recording, "--format", "robomimic", "--out", tmp_path / "out") == 0


@pytest.mark.parametrize("words", [("--video",), ("--images",), ("--fps", "20")])
def test_options_of_another_format_are_refused(recording, tmp_path, capsys, words):
    assert run(recording, "--format", "robomimic", "--out", tmp_path / "out", *words) == 1
    expected = f"a robomimic dataset has no {words[0][2:]} here; leave it out, or choose"
    assert expected in capsys.readouterr().err


def test_without_a_vulkan_driver_a_video_is_refused(recording, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(
        dataset, "drawing_problem", lambda simulator: "no usable Vulkan driver (none)"
    )
    assert run(recording, "--format", "lerobot", "--out", tmp_path / "out", "--video") == 1
    assert "no usable Vulkan driver (none); export without video" in capsys.readouterr().err
    assert nothing_was_left(tmp_path)


UNFINISHED = """
import sys, time
from robot_layouts.core.commands import start
from robot_layouts.data.export.dataset import Export, export
from robot_layouts.data.export.shots import choose_shots
def main():
    def wait(done, total):
        print("writing", flush=True)
        time.sleep(600)
    export(Export(sys.argv[1], "robomimic", sys.argv[2], include_failures=True), wait)
start(main)
"""


def partials(folder: Path) -> list[str]:
    return [path.name for path in folder.iterdir() if path.name.endswith(".partial")]


@pytest.mark.long
def test_what_a_killed_export_leaves_is_removed_by_the_next(recording, tmp_path):
    out = tmp_path / "out"
    words = [sys.executable, "-c", UNFINISHED, str(recording), str(out)]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as killed:
        assert killed.stdout is not None
        assert killed.stdout.readline() == "writing\n"
        with pytest.raises(TaskError):  # refused before anything is removed
            export(Export(recording, "robomimic", out, fps=3, include_failures=True))
        export(Export(recording, "robomimic", tmp_path / "other", include_failures=True))
        assert len(partials(tmp_path)) == 1
        export(Export(recording, "robomimic", out, include_failures=True))
        assert len(partials(tmp_path)) == 1  # of one that lives
        killed.kill()
    shutil.rmtree(out)
    (tmp_path / ".out.mine.partial").mkdir()  # whoever it is of
    export(Export(recording, "robomimic", out, include_failures=True))
    assert partials(tmp_path) == [".out.mine.partial"]


@pytest.mark.long
def test_ctrl_c_ends_an_export_without_a_traceback(recording, tmp_path):
    words = [sys.executable, "-c", UNFINISHED, str(recording), str(tmp_path / "out")]
    with subprocess.Popen(
        words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as export_:
        assert export_.stdout is not None
        assert export_.stdout.readline() == "writing\n"
        export_.send_signal(signal.SIGINT)
        _, said = export_.communicate(timeout=60)
    assert (export_.returncode, said) == (130, "interrupted\n")
    assert partials(tmp_path) == []


def test_joints_are_in_the_order_of_their_names():
    so100 = RobotRegistry.load("so100")
    groups = so100.action_split.groups
    turned = dataclasses.replace(
        so100,
        action_split=ActionSplit(gripper=groups["gripper"], arm=groups["arm"]),
        keyframes={name: (qpos[-1], *qpos[:-1]) for name, qpos in so100.keyframes.items()},
    )
    layout = Layout({"arm": Placement(turned)})
    task = tasks.make("PickCubeSO100-v1", layout=layout, obs_mode="none")
    episode = play(task, 0, np.full((2, 6), 0.5, np.float32))
    reader = ColumnReader(task)
    columns = reader.read(Trajectory(0, 0, "pd_joint_delta_pos", episode.actions, episode.states))
    assert reader.joint_names[:2] == ["arm.gripper", "arm.shoulder_pan"]
    assert reader.action_names[:2] == ["arm.gripper", "arm.shoulder_pan"]
    rows = episode.states["articulations"]["so100"]  # SAPIEN's order: the gripper last
    np.testing.assert_array_equal(columns.qpos["arm"][:, 0], rows[:, 18])
    np.testing.assert_array_equal(columns.qpos["arm"][:, 1:], rows[:, 13:18])
    np.testing.assert_array_equal(columns.qvel["arm"], np.roll(rows[:, 19:25], 1, axis=1))

"""Observations of recordings: `record` and `replay --obs-mode` write what a task observes."""

from contextlib import closing
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

import robot_layouts as rl
import tasks
from robot_layouts.__main__ import main
from robot_layouts.data.reading.json_files import TrajectoryError
from robot_layouts.data.reading.recording import Recording
from robot_layouts.data.recording import episode_files
from robot_layouts.data.recording.recorder import Recorder
from robots import RecordingError
from tests.data.recordings import TWO_ROBOTS, edited, record

LENGTHS = [3, 2]  # of the episodes of seeds 10 and 11


def observed_again(source: Path, folder: Path, mode: str, *words: str) -> Path:
    assert main(["replay", str(source), "--obs-mode", mode, "--out", str(folder), *words]) == 0
    return folder / "trajectory.h5"


def by_name(tree: Any, name: str = "obs") -> dict[str, np.ndarray]:
    if not isinstance(tree, dict | h5py.Group):
        return {name: np.asarray(tree)}
    return {k: x for key, own in tree.items() for k, x in by_name(own, f"{name}/{key}").items()}


def differences(expected: dict[str, np.ndarray], found: dict[str, np.ndarray]) -> list[str]:
    return sorted(expected.keys() ^ found.keys()) + [
        name
        for name in expected.keys() & found.keys()
        if expected[name].dtype != found[name].dtype
        or not np.array_equal(expected[name], found[name])
    ]


@pytest.fixture(scope="module")
def pushed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record(tmp_path_factory.mktemp("pushed") / "trajectory.h5", "PushCube-v1", LENGTHS)


@pytest.mark.parametrize("mode", ["state", "state_dict"])
def test_a_row_is_what_the_task_observes_after_a_step(tmp_path: Path, mode: str):
    source = record(tmp_path / "two" / "trajectory.h5", TWO_ROBOTS, LENGTHS)
    path = observed_again(source.parent, tmp_path / "seen", mode)
    with Recording(path) as file, closing(tasks.make(TWO_ROBOTS, obs_mode=mode)) as task:
        assert [episode.seed for episode in file] == [10, 11]
        for number, episode in enumerate(file):
            seen = [task.reset(episode.seed, {"reconfigure": True})[0]]
            seen += [task.step(action[None])[0] for action in episode.actions]
            found = by_name(file.observations(number))
            for row, expected in enumerate(seen):
                now = {name: rows[row] for name, rows in found.items()}
                before = {name: x[0] for name, x in by_name(expected).items()}
                assert differences(before, now) == []
    with Recording(source) as file:
        assert file.observations(0) is None


def test_the_same_command_goes_on_and_another_mode_is_refused(pushed: Path, tmp_path: Path, capsys):
    folder = tmp_path / "seen"
    observed_again(pushed, folder, "state", "--episodes", "1")
    path = observed_again(pushed, folder, "state")
    whole = observed_again(pushed, tmp_path / "at once", "state")
    assert path.read_bytes() == whole.read_bytes()
    words = ["replay", str(pushed), "--obs-mode", "state_dict", "--out", str(folder)]
    assert main(words) == 1
    assert 'obs_mode: recorded "state", here "state_dict"' in capsys.readouterr().err


@pytest.mark.parametrize(
    "words", [["--out", "x"], ["--obs-mode", "rgb"], ["--obs-mode=rgb", "--out=x", "--from=state"]]
)
def test_options_that_need_each_other(pushed: Path, words: list[str], capsys):
    assert main(["replay", str(pushed), *words]) == 1
    assert "--obs-mode and --out go together" in capsys.readouterr().err


def test_cameras_are_refused_where_nothing_is_drawn(pushed: Path, capsys):
    assert main(["replay", str(pushed), "--visuals", "light"]) == 1
    assert "nothing is drawn without --obs-mode and --out" in capsys.readouterr().err


def test_what_is_damaged_is_noticed_and_recorded_again(pushed: Path, tmp_path: Path):
    path = observed_again(pushed, tmp_path / "seen", "state_dict")
    before = path.read_bytes()
    with h5py.File(path, "r+") as file:
        file["traj_1/obs/extra/obj_pose"][1, 0] += 1
    with Recording(path) as file:
        assert file[1].seed == 11  # the episode itself is as it was
        assert file.observations(0) is not None
        with pytest.raises(TrajectoryError, match="traj_1 of .* its observations are damaged"):
            file.observations(1)
    task = tasks.make("PushCube-v1", obs_mode="state_dict")
    with Recorder(path, task, resume=True, observed=True) as recorder:
        assert recorder.seeds == {10}
        assert recorder.damaged == [f"traj_1 of {path}"]
    observed_again(pushed, path.parent, "state_dict")
    assert path.read_bytes() == before


def test_an_episode_that_is_played_otherwise_is_not_recorded(tmp_path: Path):
    source = record(tmp_path / "there" / "trajectory.h5", "PushCube-v1", LENGTHS)
    with edited(source) as file:
        file["traj_0/actions"][1] = 0.5
    folder = tmp_path / "seen"
    assert main(["replay", str(source), "--obs-mode=state", f"--out={folder}"]) == 1
    with Recording(folder) as file:
        assert [episode.seed for episode in file] == [11]


def test_an_observation_of_another_length_is_refused(pushed: Path, tmp_path: Path):
    path = observed_again(pushed, tmp_path / "seen", "state")
    with edited(path) as file:
        rows = file["traj_0/obs"][:-1]
        del file["traj_0/obs"], file["traj_0"].attrs["obs_checksum"]
        file["traj_0/obs"] = rows
    with Recording(path) as file, pytest.raises(TrajectoryError, match=r"not \(4, …\)"):
        file.observations(0)


def recorded(folder: Path, mode: str, *words: str) -> Path:
    asked = ["--task=PushCube-v1", "--episodes=2", "--workers=0", f"--obs-mode={mode}", *words]
    assert main(["record", *asked, f"--out={folder}"]) == 0
    return folder / "trajectory.h5"


def test_recorded_at_once_or_again_it_is_the_same(tmp_path: Path):
    path = recorded(tmp_path / "at once", "state_dict")
    plain = recorded(tmp_path / "plain", "state_dict", "--no-observations")
    again = observed_again(plain, tmp_path / "again", "state_dict")
    together = recorded(tmp_path / "together", "state_dict", "--num-envs=2")
    assert together.read_bytes() == path.read_bytes()
    with Recording(path) as file, Recording(plain) as silent, Recording(again) as replayed:
        for number, episode in enumerate(file):
            assert silent.observations(number) is None
            found = by_name(file.observations(number))
            assert len(found["obs/agent/qpos"]) == len(episode.actions) + 1
            expected = by_name(replayed.observations(number))
            assert list(found) == list(expected)
            assert differences(expected, found) == []


def test_the_order_of_parts_outlives_a_file_that_is_written_anew(tmp_path: Path):
    path = recorded(tmp_path / "seen", "state_dict")
    task = tasks.make("PushCube-v1", obs_mode="state_dict")
    with Recording(path) as file:
        assert list(file.observations(0)) == list(task.reset(seed=0)[0]) == ["agent", "extra"]
        assert list(file.observations(0)["extra"]) == ["tcp_pose", "goal_pos", "obj_pose"]
    before = path.read_bytes()
    with h5py.File(path, "r+") as file:
        del file["traj_0"]  # what is left moves up when it is recorded again
    recorded(path.parent, "state_dict")
    assert path.read_bytes() == before


def test_an_environment_is_recorded_with_what_it_observes_if_asked(tmp_path: Path):
    env = tasks.make("PushCube-v1", obs_mode="state")
    rl.record(env, [3], tmp_path / "silent", workers=0)
    rl.record(env, [3], tmp_path / "seen", workers=0, observations=True)
    with Recording(tmp_path / "silent") as silent, Recording(tmp_path / "seen") as seen:
        assert silent.observations(0) is None
        assert seen.observations(0).shape == (len(seen[0].actions) + 1, 35)
        assert seen.env_kwargs["obs_mode"] == "state"


def test_an_episode_too_large_to_be_read_is_refused(tmp_path: Path, monkeypatch):
    monkeypatch.setattr(episode_files, "MAX_BYTES", 1000)
    with pytest.raises(RecordingError, match="of which 1,000 can be stored; let cameras observe"):
        record(tmp_path / "trajectory.h5", "PushCube-v1", LENGTHS)

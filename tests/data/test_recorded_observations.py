"""Observations of recordings: `replay --obs-mode` writes what a task observes."""

from contextlib import closing
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

import tasks
from robot_layouts.__main__ import main
from robot_layouts.data.reading.json_files import TrajectoryError
from robot_layouts.data.reading.recording import Recording
from robot_layouts.data.recording.recorder import Recorder
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

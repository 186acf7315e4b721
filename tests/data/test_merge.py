"""`merge` writes the episodes of several recordings into one, or says why they do not fit."""

import json
from pathlib import Path

import h5py
import pytest

import tasks
from parity.native import quiet
from robot_layouts.__main__ import main
from robot_layouts.data.playing.replay import replay
from robot_layouts.data.reading.recorded_task import task_for
from robot_layouts.data.reading.recording import Recording
from robot_layouts.data.recording import merge as merging
from robot_layouts.data.recording.merge import merge
from robot_layouts.data.recording.recorder import Recorder
from robots import RecordingError
from tasks.episode import play
from tests.data.plays import at_random
from tests.data.test_recorded_observations import by_name, differences
from tests.data.test_recorder import same_files
from tests.native import NATIVE

FILE = "trajectory.h5"
TASK = "PushCube-v1"


def record(folder: Path, seeds: range, **how) -> Path:
    """Record short episodes of random actions."""
    size = {"file_size": how.pop("file_size", 200.0), "source_desc": how.pop("by", "chance")}
    task = tasks.make(how.pop("task", TASK), obs_mode="state", **how)
    with Recorder(folder / FILE, task, observed=True, **size) as recorder:
        for seed in seeds:
            recorder.add(play(task, seed, at_random(task, seed)[:3], observed=True))
    return folder


@pytest.fixture(scope="module")
def low(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record(tmp_path_factory.mktemp("low"), range(3))


@pytest.fixture(scope="module")
def high(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record(tmp_path_factory.mktemp("high"), range(5, 8), file_size=0.012, by="luck")


def listed(path: Path) -> list:
    return json.loads(path.with_suffix(".json").read_text())["episodes"]


def test_it_is_what_one_recording_of_all_is(low: Path, tmp_path: Path, capsys):
    other, whole = record(tmp_path / "other", range(3, 6)), record(tmp_path / "all", range(6))
    out = tmp_path / "merged"
    assert main(["merge", str(other / FILE), str(low), f"--out={out}"]) == 0
    assert capsys.readouterr().out == f"{out / FILE}: 6 episodes of 2 recordings\n"
    assert same_files(out / FILE, whole / FILE)
    assert [episode["episode_id"] for episode in listed(out / FILE)] == list(range(6))
    with Recording(out) as file:
        assert all(replay(task_for(file), episode, everything=True).agrees for episode in file)
        assert file.observations(5).shape == (4, 35)


def test_sources_are_combined_and_full_files_begin_others(low: Path, high: Path, tmp_path: Path):
    with Recording(high) as file:
        assert file.manifest is not None
    assert merge([high, low], tmp_path / "merged", file_size=0.02) == 6
    with Recording(tmp_path / "merged") as file:
        assert file.seeds == (0, 1, 2, 5, 6, 7)
        assert file.manifest is not None
        assert len(file.manifest.files) > 1
        assert [episode.seed for episode in file] == list(file.seeds)
    about = json.loads((tmp_path / "merged" / "trajectory.json").read_text())
    assert about["source_desc"] == "chance"  # the first file holds the first seeds alone
    task = tasks.make(TASK, obs_mode="state")
    with Recorder(tmp_path / "merged" / FILE, task, resume=True, observed=True) as recorder:
        assert recorder.damaged == []  # it can be gone on with
        assert len(recorder) == 6


def test_what_differs_is_said(low: Path, tmp_path: Path, capsys):
    out = tmp_path / "never"
    others = {
        'env_info.env_id: {} has "PushCube-v1", {} has "PullCube-v1"': {"task": "PullCube-v1"},
        'control_mode: {} has "pd_joint_delta_pos", {} has "pd_joint_pos"': {
            "control_mode": "pd_joint_pos"
        },
        'layout.arm.robot: {} has "panda", {} has "panda_wristcam"': {
            "robots": {"arm": "panda_wristcam"}
        },
    }
    for number, (difference, how) in enumerate(others.items()):
        other = record(tmp_path / str(number), range(3, 4), **how)
        assert main(["merge", str(low), str(other), f"--out={out}"]) == 1
        said = " ".join(capsys.readouterr().err.split())
        assert f"{other / FILE} was not recorded with the same as {low / FILE}: " in said
        assert difference.format(low / FILE, other / FILE) in said
        assert not out.exists()


def test_what_cannot_be_merged(low: Path, high: Path, tmp_path: Path):
    with pytest.raises(RecordingError, match="one recording is not merged"):
        merge([low], tmp_path / "out")
    with pytest.raises(RecordingError, match="both hold an episode of seed 0 and of 2 others"):
        merge([low, high, low / FILE], tmp_path / "out")
    with pytest.raises(RecordingError, match="is there already; choose another folder"):
        merge([low, high], low)
    damaged = record(tmp_path / "damaged", range(20, 22))
    with h5py.File(damaged / FILE, "r+") as file:
        file["traj_1/actions"][0, 0] += 1
    with pytest.raises(RecordingError, match="traj_1 of .* is damaged"):
        merge([low, damaged], tmp_path / "out")
    assert [path.name for path in tmp_path.iterdir()] == ["damaged"]


def test_nothing_is_left_of_what_is_interrupted(low: Path, high: Path, tmp_path: Path):
    def interrupt(done: int, episodes: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        merge([low, high], tmp_path / "out", file_size=0.01, watch=interrupt)
    assert list(tmp_path.iterdir()) == []


def test_one_episode_that_is_larger_than_a_file_gets_one(low: Path, high: Path, tmp_path: Path):
    assert merge([low, high], tmp_path / "out", file_size=1e-6) == 6
    assert len(list((tmp_path / "out").glob("*.h5"))) == 6
    assert merging.read_joined(tmp_path / "out" / "trajectory_0005.h5")[1].keys() == {7}


class TestNative:
    pytestmark = NATIVE

    def test_natives_own_merger_makes_the_same(self, low: Path, high: Path, tmp_path: Path):
        with quiet():
            from mani_skill.trajectory.dataset import ManiSkillTrajectoryDataset
            from mani_skill.trajectory.merge_trajectory import merge_trajectories
        merge([low, high], tmp_path / "ours")
        parts = [low / FILE, *sorted(high.glob("*.h5"))]
        with quiet():
            merge_trajectories(str(tmp_path / "native.h5"), parts)
        ours, native = tmp_path / "ours" / FILE, tmp_path / "native.h5"
        with h5py.File(ours) as mine, h5py.File(native) as theirs:
            assert list(mine) == list(theirs) == [f"traj_{i}" for i in range(6)]
            for name in theirs:
                assert differences(by_name(theirs[name]), by_name(mine[name])) == []
                assert dict(mine[name].attrs) == dict(theirs[name].attrs)
        assert listed(ours) == listed(native)
        assert len(ManiSkillTrajectoryDataset(str(ours))) == 18

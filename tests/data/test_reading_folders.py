"""A recording of several files is read, replayed and exported as one."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

import tasks
from robot_layouts.__main__ import main
from robot_layouts.data.export.dataset import Export, export
from robot_layouts.data.playing.replay import open_recording
from robot_layouts.data.reading.json_files import TrajectoryError, manifest_path
from robot_layouts.data.reading.recorded_task import task_for
from robot_layouts.data.reading.recording import Recording, all_files
from robot_layouts.data.recording.recorder import Recorder
from tests.data.test_recorder import short_episode

COUNT = 8


@pytest.fixture(scope="module")
def played():
    env = tasks.make("PushT-v1")
    return env, [short_episode(env, seed) for seed in range(COUNT)]


def write(path: Path, played, size: float) -> Path:
    env, episodes = played
    with Recorder(path, env, file_size=size) as recorder:
        for episode in episodes:
            recorder.add(episode)
    return path


@pytest.fixture(scope="module")
def several(played, tmp_path_factory) -> Path:
    return write(tmp_path_factory.mktemp("several") / "trajectory.h5", played, 0.02).parent


@pytest.fixture
def copy(several, tmp_path) -> Path:
    return Path(shutil.copytree(several, tmp_path / "copy"))


def test_a_folder_is_one_sequence(several, played):
    with Recording(several) as file:
        assert file.manifest is not None
        assert file.seeds == tuple(range(COUNT))
        assert len(file) == COUNT
        for number, (trajectory, episode) in enumerate(zip(file, played[1], strict=True)):
            assert (trajectory.episode_id, trajectory.seed) == (number, episode.seed)
            np.testing.assert_array_equal(trajectory.actions, episode.actions)
        assert [t.seed for t in file[5:1:-2]] == [5, 3]
        assert file[-1].seed == COUNT - 1
        with pytest.raises(IndexError):
            file[COUNT]


def test_one_file_of_it_is_a_recording_too(several):
    files = all_files(several)
    assert len(files) == len(list(several.glob("*.h5"))) >= 3
    assert all_files(files[1]) == [files[1]]
    with Recording(files[1]) as file:
        assert type(file) is Recording
        assert file[0].episode_id == 0
        assert file[0].seed == file.seeds[0] > 0


def test_its_manifest_opens_it_as_well(several):
    with Recording(manifest_path(several / "trajectory.h5")) as file:
        assert len(file) == COUNT


def test_it_is_played_in_the_task_of_all(several):
    with open_recording(several, "PushT-v1") as file:
        task_for(file).close()
        assert file[COUNT - 1].seed == COUNT - 1


def test_replay_and_export_take_the_folder(several, tmp_path, capsys):
    assert main(["replay", str(several)]) == 0
    assert f"in {COUNT} all states are equal" in capsys.readouterr().out
    done = export(Export(several, "robomimic", tmp_path / "out", include_failures=True))
    assert done.episodes == COUNT


def test_a_file_of_another_recording_is_refused(copy, played, tmp_path):
    env = tasks.make("PushT-v1", control_mode="pd_joint_pos")
    episodes = [short_episode(env, seed) for seed in range(COUNT)]
    other = write(tmp_path / "other" / "trajectory.h5", (env, episodes), 0.02)
    for suffix in (".h5", ".json"):
        shutil.copy(other.with_name(f"trajectory_0001{suffix}"), copy)
    with (
        Recording(copy) as file,
        pytest.raises(
            TrajectoryError, match=r"0001\.h5 does not belong.*control_mode and layout are"
        ),
    ):
        file[COUNT - 1 - len(played[1]) // 2]


def test_a_manifest_of_other_episodes_is_refused(copy):
    manifest = manifest_path(copy / "trajectory.h5")
    text = manifest.read_text()
    first = text.index('"seeds"')
    manifest.write_text(text[:first] + text[first:].replace("0,", "4294967290,", 1))
    with pytest.raises(TrajectoryError, match=r"seeds are not ascending ranges"):
        Recording(copy)
    manifest.write_text(text.replace("trajectory_0001.h5", "../other.h5"))
    with pytest.raises(TrajectoryError, match=r"must be 'trajectory_0001\.h5'"):
        Recording(copy)


def test_a_manifest_of_very_many_episodes_takes_no_memory(copy):
    manifest = manifest_path(copy / "trajectory.h5")
    about = json.loads(manifest.read_text())
    about["files"][1] |= {"episodes": 2**32 - 9, "seeds": [[9, 2**32 - 1]]}
    manifest.write_text(json.dumps(about))
    with pytest.raises(TrajectoryError, match=r"lists 4,294,967,\d+ episodes; 10,000,000 are"):
        Recording(copy)


def test_a_file_that_is_not_as_listed(copy):
    for suffix in (".h5", ".json"):
        shutil.copy(copy / f"trajectory_0002{suffix}", copy / f"trajectory_0001{suffix}")
    with (
        Recording(copy) as file,
        pytest.raises(TrajectoryError, match="does not hold the episodes that .* lists; if"),
    ):
        list(file)

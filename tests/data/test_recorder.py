"""A recording holds what happened, in native's format, and survives what ends it."""

import json
import os
import subprocess
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

import tasks
from robot_layouts.data.reading.recording import Recording
from robot_layouts.data.recording.episode_files import read_part
from robot_layouts.data.recording.recorder import Recorder
from robots import ActionError, RecordingError, TaskError
from tasks.episode import PlayedEpisode, play
from tests.data.hand_overs import TASK, plan, task
from tests.data.kills import Kill, Killed
from tests.data.recordings import edited

SEEDS = (0, 3)
FIRST_ROBOT, SECOND_ROBOT = "panda_wristcam-agent-0", "panda_wristcam-agent-1"


@pytest.fixture(scope="module")
def recorded(tmp_path_factory) -> tuple[Recorder, list[PlayedEpisode]]:
    folder = tmp_path_factory.mktemp("recording")
    episodes = [play(task(), seed, plan(seed)) for seed in SEEDS]
    with Recorder(folder / "new" / "trajectory.h5", task()) as recorder:
        for episode in episodes:
            recorder.add(episode)
    return recorder, episodes


def short_episode(env: tasks.MultiRobotTask, seed: int, steps: int = 3) -> PlayedEpisode:
    rng = np.random.default_rng(seed)
    return play(env, seed, rng.uniform(-1, 1, (steps, env.layout.action_dim)).astype(np.float32))


def test_the_h5_file_has_natives_layout(recorded):
    recorder, episodes = recorded
    with h5py.File(recorder.path) as file:
        assert list(file) == ["traj_0", "traj_1"]
        for group, episode in zip(file.values(), episodes, strict=True):
            steps = len(episode.actions)
            assert set(group) == {
                *("actions", "env_states", "rewards", "success", "terminated", "truncated")
            }
            assert group["actions"].shape == (steps, 16)
            assert group["actions"].dtype == np.float32
            assert set(group["env_states/actors"]) == {"table-workspace", "cube", "goal_site"}
            assert set(group["env_states/articulations"]) == {FIRST_ROBOT, SECOND_ROBOT}
            assert group["env_states/actors/cube"].shape == (steps + 1, 13)
            assert group[f"env_states/articulations/{FIRST_ROBOT}"].shape == (steps + 1, 31)
            for name, kind in (("rewards", "f"), *zip(("success", "truncated"), "bb", strict=True)):
                assert group[name].shape == (steps,)
                assert group[name].dtype.kind == kind
            assert group["success"][:].tolist() == [False] * (steps - 1) + [True]
            np.testing.assert_array_equal(group["terminated"], group["success"])


def test_the_actions_can_be_split_by_robot(recorded):
    recorder, episodes = recorded
    with h5py.File(recorder.path) as file:
        split = json.loads(file["traj_1"].attrs["action_split"])
        assert split == {"left": [0, 8], "right": [8, 16]}
        assert list(split) == ["left", "right"]
        right = file["traj_1/actions"][:, slice(*split["right"])]
        layout = json.loads(file.attrs["layout"])
    np.testing.assert_array_equal(right, episodes[1].actions[:, 8:])
    assert [robot["robot"] for robot in layout.values()] == ["panda_wristcam"] * 2
    assert layout["left"]["position"] == [0.0, -0.75, 0.0]
    assert layout["right"]["action"] == [8, 16]


def test_the_json_file_tells_how_to_play_it(recorded):
    recorder, episodes = recorded
    summary = json.loads(recorder.json_path.read_text())
    assert summary["env_info"]["env_id"] == TASK
    assert summary["env_info"]["max_episode_steps"] == 100
    assert summary["env_info"]["env_kwargs"]["control_mode"] == "pd_joint_delta_pos"
    mode = {"panda_wristcam-0": "pd_joint_delta_pos", "panda_wristcam-1": "pd_joint_delta_pos"}
    assert summary["episodes"] == [
        {
            "episode_id": i,
            "episode_seed": seed,
            "control_mode": mode,
            "elapsed_steps": len(episodes[i].actions),
            "reset_kwargs": {"seed": seed, "options": {"reconfigure": True}},
            "success": True,
        }
        for i, seed in enumerate(SEEDS)
    ]


def test_a_replay_from_the_file_is_the_same_to_the_last_bit(recorded):
    recorder, _ = recorded
    summary = json.loads(recorder.json_path.read_text())
    env = tasks.make(summary["env_info"]["env_id"])
    with h5py.File(recorder.path) as file:
        for entry in summary["episodes"]:
            group = file[f"traj_{entry['episode_id']}"]
            again = play(env, entry["episode_seed"], group["actions"][:])
            for kind, entries in again.states.items():
                for name, rows in entries.items():
                    np.testing.assert_array_equal(group[f"env_states/{kind}/{name}"], rows)
            np.testing.assert_array_equal(group["rewards"], again.rewards)


def same_files(one: Path, other: Path) -> bool:
    return all(
        one.with_suffix(kind).read_bytes() == other.with_suffix(kind).read_bytes()
        for kind in (".h5", ".json")
    )


@pytest.fixture(scope="module")
def push_t():
    env = tasks.make("PushT-v1")
    return env, [short_episode(env, seed) for seed in range(12)]


def write(path: Path, env: tasks.MultiRobotTask, episodes, **how) -> Path:
    with Recorder(path, env, **how) as recorder:
        for episode in episodes:
            recorder.add(episode)
    return path


def test_a_part_says_what_it_is(tmp_path, push_t):
    env, episodes = push_t
    with Recorder(tmp_path / "open.h5", env) as recorder:
        recorder.add(episodes[3])
        (part,) = recorder.parts.iterdir()
        header, stored = read_part(part)
        assert header["layout"]["arm"]["robot"] == "panda_stick"
        assert stored.about["episode_seed"] == 3
        np.testing.assert_array_equal(stored.arrays["actions"], episodes[3].actions)
        tee = stored.arrays["env_states/actors/Tee"]
        np.testing.assert_array_equal(tee, episodes[3].states["actors"]["Tee"])
        assert len(recorder) == 1


def test_the_order_in_which_episodes_come_makes_no_difference(tmp_path, push_t):
    env, episodes = push_t
    straight = write(tmp_path / "one.h5", env, episodes)
    for number, half in enumerate((episodes[1::2][::-1], episodes[::2])):
        crooked = write(tmp_path / "two.h5", env, half, resume=number > 0)
    assert same_files(straight, crooked)


def test_a_recording_goes_on_whatever_moment_it_was_killed_at(tmp_path, push_t, monkeypatch):
    """Stop at every change of the disk that closing makes, as a kill would, and go on."""
    env, episodes = push_t
    whole = write(tmp_path / "whole.h5", env, episodes)
    calls = [
        (os, "replace"),
        (Path, "write_text"),
        (Path, "unlink"),
        (Path, "rmdir"),
        (os, "fsync"),
    ]

    stops = 0
    while True:
        path = write(tmp_path / f"{stops}" / "killed.h5", env, episodes[:5])
        kill = Kill(stops)
        with monkeypatch.context() as patch, suppress(Killed):
            recorder = Recorder(path, env, resume=True)
            for episode in episodes[5:]:
                recorder.add(episode)
            kill.watch(patch, calls)
            recorder.close()
        with Recorder(path, env, resume=True) as again:
            assert again.seeds == set(range(12)), f"after {stops} calls"
        assert same_files(path, whole), f"after {stops} calls"
        assert not again.parts.exists()
        if kill.remaining > 0:
            break
        stops += 1
    assert stops >= 5


def test_what_a_kill_leaves_half_done_is_tidied(tmp_path, push_t):
    env, episodes = push_t
    path = write(tmp_path / "tidy.h5", env, episodes[:2])
    parts = path.with_suffix(".parts")
    parts.mkdir()
    (parts / "seed-0000000007.part.123.partial").write_bytes(b"half")
    (parts / "seed-0000000008.part").write_bytes(b"damaged")
    path.with_name("tidy.h5.partial").write_bytes(b"half")
    path.with_name("tidy.json.partial").write_text("{")
    path.with_name("untidy.h5.partial").write_text("another's")
    with Recorder(path, env, resume=True) as recorder:
        assert recorder.seeds == {0, 1}
    names = sorted(p.name for p in tmp_path.iterdir())
    assert names == ["tidy.h5", "tidy.json", "untidy.h5.partial"]


def test_a_folder_of_parts_with_something_else_in_it_stays(tmp_path, push_t):
    env, episodes = push_t
    path = tmp_path / "recording.h5"
    with Recorder(path, env) as recorder:
        recorder.add(episodes[0])
        (recorder.parts / "notes").write_text("mine")
    assert [p.name for p in recorder.parts.iterdir()] == ["notes"]


def test_a_recording_of_an_earlier_version_gets_its_checksums(tmp_path, push_t):
    env, episodes = push_t
    whole = write(tmp_path / "whole.h5", env, episodes[:3])
    path = write(tmp_path / "earlier.h5", env, episodes[:2])
    with edited(path):
        pass
    with Recorder(path, env, resume=True) as again:
        assert again.damaged == []
        again.add(episodes[2])
    assert same_files(path, whole)


def test_one_episode_per_seed(tmp_path, push_t):
    env, episodes = push_t
    path = write(tmp_path / "once.h5", env, episodes[:1])
    with Recorder(path, env, resume=True) as recorder:
        recorder.add(episodes[1])
        for again in episodes[:2]:
            with pytest.raises(RecordingError, match=f"an episode of seed {again.seed} already"):
                recorder.add(again)
    assert json.loads(path.with_suffix(".json").read_text())["episodes"][1]["episode_seed"] == 1


def test_two_recorders_do_not_write_the_same_recording(tmp_path, push_t):
    env, episodes = push_t
    with Recorder(tmp_path / "one.h5", env):
        with pytest.raises(RecordingError, match=r"another process is recording into .*one.parts"):
            Recorder(tmp_path / "one.h5", env, overwrite=True)
        write(tmp_path / "two.h5", env, episodes[:1])  # another one may be
    Recorder(tmp_path / "one.h5", env, overwrite=True).close()


class TestResuming:
    def refusal(self, path, env):
        with pytest.raises(RecordingError) as caught:
            Recorder(path, env, resume=True)
        return str(caught.value)

    @pytest.mark.parametrize("joined", [True, False])
    def test_another_task_or_robot(self, tmp_path, push_t, joined):
        env, episodes = push_t
        path = tmp_path / "other.h5"
        if joined:
            write(path, env, episodes[:1])
        else:
            Recorder(path, env).add(episodes[0])
        said = self.refusal(path, tasks.make("PullCube-v1"))
        assert 'env_info.env_id: recorded "PushT-v1", here "PullCube-v1"' in said
        other = replace(env.layout["arm"].robot, name="other_stick")
        said = self.refusal(path, tasks.make("PushT-v1", robots=other))
        assert 'layout.arm.robot: recorded "panda_stick", here "other_stick"' in said
        assert "choose another folder" in said

    def test_another_reward_or_control_mode(self, tmp_path, push_t):
        env, episodes = push_t
        path = write(tmp_path / "other.h5", env, episodes[:1])
        said = self.refusal(path, tasks.make("PushT-v1", reward_mode="sparse"))
        assert 'reward_mode: recorded "normalized_dense", here "sparse"' in said
        said = self.refusal(path, tasks.make("PushT-v1", control_mode="pd_joint_pos"))
        assert 'control_mode: recorded "pd_joint_delta_pos", here "pd_joint_pos"' in said

    def test_a_refused_recording_leaves_nothing_behind(self, tmp_path, push_t):
        env, episodes = push_t
        path = write(tmp_path / "other.h5", env, episodes[:1])
        before = path.read_bytes()
        self.refusal(path, tasks.make("PullCube-v1"))
        assert path.read_bytes() == before
        assert sorted(p.name for p in tmp_path.iterdir()) == ["other.h5", "other.json"]


def test_a_disk_that_fills_up_while_episodes_are_joined(small_disk, push_t):
    env, episodes = push_t
    path = small_disk / "trajectory.h5"
    recorder = Recorder(path, env)
    for episode in episodes[:5]:
        recorder.add(episode)
    with suppress(OSError), (small_disk / "full").open("wb", buffering=0) as stream:
        while stream.write(bytes(1024)):
            pass
    with pytest.raises(RecordingError, match=r"cannot write .*trajectory.h5: .*[Nn]o space left"):
        recorder.close()
    (small_disk / "full").unlink()
    with Recorder(path, env, resume=True) as again:
        assert again.seeds == set(range(5))
    assert [p.name for p in sorted(small_disk.iterdir())] == ["trajectory.h5", "trajectory.json"]


@pytest.mark.long
def test_a_read_only_folder(tmp_path, push_t):
    env, episodes = push_t
    path = write(tmp_path / "recorded" / "trajectory.h5", env, episodes[:2])
    place = path.parent
    if subprocess.run(["mount", "--bind", place, place], capture_output=True).returncode:
        pytest.skip("folders cannot be mounted here")
    try:
        subprocess.run(["mount", "-o", "remount,ro,bind", place], check=True)
        with pytest.raises(RecordingError, match=r"cannot write .*: Read-only file system"):
            Recorder(path, env, resume=True)
        with pytest.raises(RecordingError, match=r"cannot write .*: Read-only file system"):
            Recorder(place / "new.h5", env)
        with Recording(path) as file:
            assert [episode.seed for episode in file] == [0, 1]
    finally:
        subprocess.run(["umount", place], check=True)


def test_an_existing_recording_is_not_overwritten_unasked(tmp_path):
    env = tasks.make("PushT-v1")
    path = tmp_path / "twice.h5"
    with Recorder(path, env) as recorder:
        recorder.add(short_episode(env, 0))
    with pytest.raises(RecordingError, match=r"twice\.h5 is there already.*overwrite=True"):
        Recorder(path, env)
    with h5py.File(path) as file:
        assert list(file) == ["traj_0"]
    with Recorder(path, env, overwrite=True) as recorder:
        assert len(recorder) == 0


def test_writing_after_the_end_is_an_error(tmp_path):
    env = tasks.make("PushT-v1")
    recorder = Recorder(tmp_path / "ended.h5", env)
    recorder.close()
    recorder.close()
    with pytest.raises(RecordingError, match=r"cannot write .*ended\.h5"):
        recorder.add(short_episode(env, 0))


def test_episodes_are_played_one_at_a_time():
    with pytest.raises(TaskError, match="1 environment; the task has 2"):
        play(tasks.make("PushT-v1", num_envs=2), 0, np.zeros((1, 7), np.float32))
    with pytest.raises(TaskError, match="at least one action"):
        play(tasks.make("PushT-v1"), 0, np.zeros((0, 7), np.float32))
    with pytest.raises(ActionError, match=r"shape \(6,\)|shape \(1, 6\)"):
        play(tasks.make("PushT-v1"), 0, np.zeros((1, 6), np.float32))

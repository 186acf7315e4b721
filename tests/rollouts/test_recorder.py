"""A recording holds what happened, in native's format, and survives what ends it."""

import json
import os
import signal
import subprocess
import sys
import time

import h5py
import numpy as np
import pytest

import tasks
from robots import ActionError, RecordingError, TaskError
from rollouts.episode import Episode, play
from rollouts.recorder import Recorder
from tests.rollouts.hand_overs import TASK, plan, task

SEEDS = (0, 3)
FIRST_ROBOT, SECOND_ROBOT = "panda_wristcam-agent-0", "panda_wristcam-agent-1"


@pytest.fixture(scope="module")
def recorded(tmp_path_factory) -> tuple[Recorder, list[Episode]]:
    folder = tmp_path_factory.mktemp("recording")
    episodes = [play(task(), seed, plan(seed)) for seed in SEEDS]
    with Recorder(folder / "new" / "trajectory.h5", task()) as recorder:
        for episode in episodes:
            recorder.add(episode)
    return recorder, episodes


def short_episode(env: tasks.MultiRobotTask, seed: int, steps: int = 3) -> Episode:
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


def test_one_robot_has_a_plain_control_mode(tmp_path):
    env = tasks.make("PushT-v1")
    with Recorder(tmp_path / "one.h5", env) as recorder:
        recorder.add(short_episode(env, 0))
    episode = json.loads(recorder.json_path.read_text())["episodes"][0]
    assert episode["control_mode"] == "pd_joint_delta_pos"
    assert episode["success"] is False


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


def test_the_first_state_is_the_one_after_the_reset(recorded):
    recorder, _ = recorded
    env = tasks.make(TASK)
    env.reset(SEEDS[1])
    with h5py.File(recorder.path) as file:
        first = file["traj_1/env_states/actors/cube"][0]
    np.testing.assert_array_equal(first, env.get_state_dict()["actors"]["cube"].numpy()[0])


KILLED = """
import sys, numpy as np, tasks
from rollouts.episode import play
from rollouts.recorder import Recorder
env = tasks.make("PushT-v1")
recorder = Recorder(sys.argv[1], env)
for seed in range(10**6):
    recorder.add(play(env, seed, np.zeros((3, 7), np.float32)))
    print(seed, flush=True)
"""


def test_a_killed_recording_keeps_its_finished_episodes(tmp_path):
    path = tmp_path / "killed.h5"
    with subprocess.Popen(
        [sys.executable, "-c", KILLED, str(path)], stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        finished = [int(process.stdout.readline()) for _ in range(5)]
        time.sleep(0.02)
        os.kill(process.pid, signal.SIGKILL)
        finished += [int(line) for line in process.stdout.read().split("\n")[:-1]]
    summary = json.loads(path.with_suffix(".json").read_text())
    assert [entry["episode_seed"] for entry in summary["episodes"]][: len(finished)] == finished
    with h5py.File(path) as file:
        assert len(finished) <= len(summary["episodes"]) <= len(file)
        for i in range(len(file)):
            assert file[f"traj_{i}/env_states/actors/Tee"].shape == (4, 13)


def test_an_episode_is_readable_before_the_recording_ends(tmp_path):
    env = tasks.make("PushT-v1")
    path = tmp_path / "open.h5"
    with Recorder(path, env) as recorder:
        recorder.add(short_episode(env, 0))
        copy = tmp_path / "copy.h5"
        copy.write_bytes(path.read_bytes())
        with h5py.File(copy) as file:
            assert file["traj_0/actions"].shape == (3, 7)
        assert len(json.loads(recorder.json_path.read_text())["episodes"]) == len(recorder) == 1


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


def test_a_place_that_cannot_be_written_is_named(tmp_path):
    (tmp_path / "file").write_text("not a folder")
    with pytest.raises(RecordingError, match=r"cannot write .*file/trajectory\.h5"):
        Recorder(tmp_path / "file" / "trajectory.h5", tasks.make("PushT-v1"))


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

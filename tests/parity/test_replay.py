"""Recordings cross the border: ours are played by native's own tool, native's are played here."""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import tasks
from layouts import Layout
from parity.__main__ import main
from parity.compare.lockstep import EpisodeResult, FirstDifference
from parity.compare.native_env import quiet
from parity.compare.runs import Run, RunResult
from parity.replay.command import sentences, table
from rollouts.playing.plan_conversion import as_positions
from rollouts.playing.replay import replay, task_for
from rollouts.reading.recording import Recording
from rollouts.recording.recorder import Recorder
from tasks.episode import play
from tests.motions import touching_episode
from tests.native import NATIVE

MODES = ("pd_joint_delta_pos", "pd_joint_pos")
SEEDS = (0, 1)


def actions_of(task_id: str, seed: int, mode: str) -> np.ndarray:
    actions = touching_episode(task_id, seed).actions
    return actions if mode == MODES[0] else as_positions(tasks.make(task_id), seed, actions)


def recorded_here(folder: Path, task_id: str, mode: str) -> Path:
    env = tasks.make(task_id, control_mode=mode)
    with Recorder(folder / "trajectory.h5", env) as recorder:
        for seed in SEEDS:
            episode = play(env, seed, actions_of(task_id, seed, mode))
            recorder.add(replace(episode, reason="" if episode.solved else "it moves at random"))
    return recorder.path


def recorded_by_native(folder: Path, task_id: str, mode: str, options: dict | None) -> Path:
    import gymnasium
    import mani_skill.envs  # noqa: F401
    from mani_skill.utils.wrappers import RecordEpisode

    with quiet():
        env = RecordEpisode(
            gymnasium.make(
                task_id,
                obs_mode="none",
                control_mode=mode,
                sim_backend="physx_cpu",
                render_backend="cpu",
            ),
            str(folder),
            save_video=False,
            record_reward=True,
            trajectory_name="trajectory",
        )
        for seed in SEEDS:
            env.reset(seed=seed, options=options)
            for action in actions_of(task_id, seed, mode):
                env.step(action)
        env.close()
    return folder / "trajectory.h5"


def replayed_by_native(path: Path, *words: str) -> tuple[Path, str]:
    """Run native's own command; return the file it makes and what it says."""
    command = [sys.executable, "-m", "mani_skill.trajectory.replay_trajectory"]
    done = subprocess.run(
        [*command, "--traj-path", str(path), "--save-traj", "--allow-failure", *words],
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    (made,) = path.parent.glob("trajectory.none.*.h5")
    return made, done.stdout


def expect_same_states(one: Path, other: Path) -> None:
    with Recording(one) as first, Recording(other) as second:
        assert len(first) == len(second) == len(SEEDS)
        for ours, natives in zip(first, second, strict=True):
            np.testing.assert_array_equal(ours.actions, natives.actions)
            np.testing.assert_array_equal(ours.success, natives.success)
            assert set(ours.states) == set(natives.states)
            for kind, entries in ours.states.items():
                assert set(entries) == set(natives.states[kind])
                for name, rows in entries.items():
                    np.testing.assert_array_equal(rows, natives.states[kind][name])


@pytest.mark.long
class TestNative:
    pytestmark = NATIVE

    @pytest.mark.long
    @pytest.mark.parametrize("mode", [MODES[0], pytest.param(MODES[1], marks=pytest.mark.long)])
    def test_natives_own_tool_plays_our_files(self, tmp_path, mode):
        path = recorded_here(tmp_path, "PickCube-v1", mode)
        made, said = replayed_by_native(path)
        assert "2/2=100.00% demos saved" in said
        expect_same_states(path, made)

    @pytest.mark.long
    @pytest.mark.parametrize("task_id", ["StackCube-v1", "PushT-v1", "PickCubeSO100-v1"])
    def test_natives_own_tool_plays_our_files_of_other_robots(self, tmp_path, task_id):
        path = recorded_here(tmp_path, task_id, MODES[0])
        expect_same_states(path, replayed_by_native(path)[0])

    @pytest.mark.long
    @pytest.mark.parametrize(
        "words", [["--use-env-states"], ["-c", "pd_joint_delta_pos"], ["--use-first-env-state"]]
    )
    def test_natives_own_tool_in_its_other_ways(self, tmp_path, words):
        path = recorded_here(tmp_path, "PickCube-v1", MODES[0])
        made, said = replayed_by_native(path, *words)
        assert "2/2=100.00% demos saved" in said
        with Recording(path) as ours, Recording(made) as natives:
            for one, other in zip(ours, natives, strict=True):
                np.testing.assert_array_equal(one.actions, other.actions)

    @pytest.mark.parametrize(
        ("task_id", "mode"), [("PickCube-v1", MODES[0]), ("PushT-v1", MODES[1])]
    )
    def test_what_native_records_is_played_here(self, tmp_path, task_id, mode):
        path = recorded_by_native(tmp_path, task_id, mode, {"reconfigure": True})
        with Recording(path) as file:
            assert (file.task_id, file.control_mode) == (task_id, mode)
            assert file.layout is None
            env = task_for(file)
            found = [replay(env, episode) for episode in file]
            assert all(episode.exact and episode.compared for episode in found)
            assert [episode.difference for episode in found] == [None, None]
            assert all(episode.agrees for episode in found)
            from_state = replay(env, file[0], "state")
            assert not from_state.exact

    def test_worlds_that_native_reused(self, tmp_path):
        path = recorded_by_native(tmp_path, "PickCube-v1", MODES[0], None)
        with Recording(path) as file:
            first, second = (replay(task_for(file), episode) for episode in file)
        assert first.difference is None
        assert [first.exact, second.exact] == [False, False]

    def test_the_command(self, tmp_path, capsys):
        path = recorded_here(tmp_path, "PushT-v1", MODES[1])
        assert main(["replay", "--task", "push_t", "--demo", str(path)]) == 0
        printed = " ".join(capsys.readouterr().out.split())
        assert f"PushT-v1, pd_joint_pos, {path}" in printed
        assert "yes none" in printed
        assert "Agreement 2 of 2 episodes (100%)" in printed
        assert "Equal to the last bit: 2 of 2 episodes" in printed

    @pytest.mark.long
    def test_without_a_file_the_expert_is_recorded_first(self, tmp_path, capsys, monkeypatch):
        monkeypatch.setenv("MS_ASSET_DIR", str(tmp_path / "nothing"))
        words = ["--task", "two_robot_pick_cube", "--episodes", "2", "--out", str(tmp_path)]
        assert main(["replay", *words]) == 0
        printed = capsys.readouterr().out
        assert "Agreement 2 of 2 episodes (100%); success in native 2, here 2, both 2." in printed
        assert (tmp_path / "TwoRobotPickCube-v1" / "recorded" / "trajectory.h5").is_file()

    def test_an_official_file_is_found(self, tmp_path, capsys, monkeypatch):
        monkeypatch.setenv("MS_ASSET_DIR", str(tmp_path))
        path = recorded_here(tmp_path / "demos" / "PushT-v1" / "rl", "PushT-v1", MODES[0])
        assert main(["replay", "--task", "PushT-v1", "--episodes", "1"]) == 0
        printed = " ".join(capsys.readouterr().out.split())
        assert str(path) in printed
        assert "Agreement 1 of 1 episodes" in printed


def result(seed: int, native: bool, ours: bool, step: int | None) -> EpisodeResult:
    first = None if step is None else FirstDifference(step, "object pose", "cube")
    return EpisodeResult(seed, 40, 7, native, ours, {}, first)


def test_disagreement_is_told(capsys):
    from rich.console import Console

    run = Run("PickCube-v1", "file", (), "fresh", "sparse")
    episodes = (result(4, True, True, None), result(5, True, True, 31), result(6, True, False, 9))
    found = RunResult(run, episodes)
    Console(width=120).print(table(found))
    rows = [" ".join(line.split()) for line in capsys.readouterr().out.splitlines()]
    assert "0 4 40 7 success success yes none" in rows
    assert "1 5 40 7 success success yes from step 31 in object pose of cube" in rows
    assert "2 6 40 7 success failure NO from step 9 in object pose of cube" in rows
    first, second = sentences(found)
    assert first == "Agreement 2 of 3 episodes (67%); success in native 3, here 2, both 2."
    assert second.startswith("Equal to the last bit: 1 of 3 episodes")


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["--task", "pik_cube"], "unknown task 'pik_cube'. Did you mean"),
        (["--task", "pick_cube", "--demo", "nothing.h5"], "there is no file or folder nothing.h5"),
        (["--task", "pick_cube", "--episodes", "0"], "--episodes is 0; it must be 1 or more"),
    ],
)
def test_bad_usage(words, complaint, capsys):
    assert main(["replay", *words]) == 2
    assert complaint in capsys.readouterr().err


def test_a_file_of_another_layout(tmp_path, capsys):
    placement = replace(tasks.get_task_class("PushT-v1").layout["arm"], position=(-0.6, 0.0, 0.0))
    env = tasks.make("PushT-v1", layout=Layout({"arm": placement}))
    with Recorder(tmp_path / "trajectory.h5", env) as recorder:
        recorder.add(play(env, 0, np.zeros((2, 7), np.float32)))
    assert main(["replay", "--task", "push_t", "--demo", str(recorder.path)]) == 2
    assert "arm.position: recorded [-0.6, 0.0, 0.0], here [-0.615," in capsys.readouterr().err


def test_a_file_of_another_task(tmp_path, capsys):
    path = recorded_here(tmp_path, "PushT-v1", MODES[0])
    assert main(["replay", "--task", "pick_cube", "--demo", str(path)]) == 2
    assert "was recorded in PushT-v1, not in PickCube-v1" in capsys.readouterr().err
    path.with_suffix(".json").write_text(json.dumps({"episodes": []}))
    assert main(["replay", "--task", "push_t", "--demo", str(path)]) == 2
    assert "has no env_info" in capsys.readouterr().err

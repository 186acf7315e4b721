"""``python -m parity sweep``: what it plays, what it writes, failures, and going on."""

import argparse
import json
import multiprocessing
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import tasks
from parity.__main__ import main
from parity.compare.lockstep import EpisodeResult, FirstDifference
from parity.compare.results import ResultsError
from parity.compare.runs import Run
from parity.replay.rollout import load
from parity.sweep.entries import SUMMARY, blank, is_done, read_summary, write_summary
from parity.sweep.plan import Plan, plan
from parity.sweep.processes import LOG, sweep
from parity.sweep.stages import (
    NO_DEMONSTRATION,
    NO_VIDEO,
    _episodes,
    _shortest_success,
    agreement,
)
from robots import TaskError, UnknownNameError
from rollouts.recording.recorder import Recorder
from tasks.episode import Episode, play
from tests.native import NATIVE
from tests.process_trees import workers_of
from tests.rollouts.clusters import running_cluster

ROOT = Path(__file__).parents[2]
TASK, OTHER = "PickCube-v1", "PushCube-v1"


def record(folder: Path, task_id: str, lengths: tuple[int, ...] = (3, 2)) -> Path:
    """Record episodes of random actions, of seeds 0, 1 and so on; return the file."""
    env = tasks.make(task_id)
    path = folder / task_id / "trajectory.h5"
    rng = np.random.default_rng(0)
    with Recorder(path, env) as recorder:
        for seed, length in enumerate(lengths):
            actions = rng.uniform(-1, 1, (length, env.layout.action_dim)).astype(np.float32)
            recorder.add(play(env, seed, actions))
    env.close()
    return path


def planned(tmp_path, **changes) -> list[Plan]:
    options = {"tasks": None, "demos": None, "episodes": 3, "workers": 1, "no_video": False}
    options["experts"] = False
    return plan(argparse.Namespace(out=tmp_path, **{**options, **changes}))


class TestPlan:
    def test_every_task(self, tmp_path):
        plans = planned(tmp_path, no_video=True)
        assert [p.task_id for p in plans] == list(tasks.list_clones())
        assert {(p.demos, p.episodes, p.video) for p in plans} == {((), 3, False)}
        assert plans[0].folder == tmp_path / plans[0].task_id

    def test_demonstrations_and_what_is_none(self, tmp_path, capsys):
        path = record(tmp_path / "demos", TASK)
        foreign = tmp_path / "demos" / "foreign.h5"
        foreign.touch()
        (one,) = planned(tmp_path, tasks=["maniskill.pick_cube_native"], demos=tmp_path / "demos")
        assert (one.task_id, one.demos) == (TASK, (str(path),))
        assert f"{foreign} is left out" in capsys.readouterr().err

    def test_the_expert_comes_first_if_asked_for(self, tmp_path, monkeypatch):
        path = record(tmp_path, TASK)
        monkeypatch.setattr("parity.sweep.plan.list_experts", lambda: (TASK,))
        options = {"tasks": [TASK], "demos": tmp_path}
        assert planned(tmp_path, **options)[0].demos == (str(path),)
        assert planned(tmp_path, **options, experts=True)[0].demos == ()

    def test_twice_the_same_is_once(self, tmp_path):
        assert len(planned(tmp_path, tasks=[TASK, TASK.lower()])) == 1

    @pytest.mark.parametrize("name", ["episodes", "workers"])
    def test_numbers_that_make_no_sense(self, name, tmp_path):
        with pytest.raises(TaskError, match=f"--{name} is 0; it must be 1 or more"):
            planned(tmp_path, **{name: 0})

    def test_an_unknown_task(self, tmp_path):
        with pytest.raises(UnknownNameError, match="PickCube-v1"):
            planned(tmp_path, tasks=["PickCub-v1"])


class TestEpisodes:
    def test_so_many_of_the_demonstrations(self, tmp_path):
        first, second = (str(record(tmp_path / n, TASK)) for n in ("one", "two"))
        runs, source = _episodes(Plan(TASK, (first, second), 3, tmp_path, False))
        assert source == "demonstrations"
        assert [(run.source, len(run.episodes)) for run in runs] == [(first, 2), (second, 1)]
        assert {(run.history, run.control_mode) for run in runs} == {
            ("fresh", "pd_joint_delta_pos")
        }

    def test_the_expert(self, tmp_path, monkeypatch):
        monkeypatch.setattr("parity.sweep.stages.list_experts", lambda: [TASK])
        monkeypatch.setattr(
            "parity.replay.rollout.find_expert",
            lambda task_id: lambda task, seed: np.full((2 + seed, 8), seed, np.float32),
        )
        (run,), source = _episodes(Plan(TASK, (), 2, tmp_path, False))
        assert (source, run.source) == ("expert", "expert")
        assert [(e.seed, e.actions.shape) for e in run.episodes] == [(0, (2, 8)), (1, (3, 8))]

    def test_chance(self, tmp_path, monkeypatch):
        monkeypatch.setattr("parity.sweep.stages.list_experts", list)
        (run,), source = _episodes(Plan(TASK, (), 2, tmp_path, False))
        assert source == "random"
        assert [e.actions.shape for e in run.episodes] == [(50, 8), (50, 8)]


def a_result(seed=0, steps=5, native=True, ours=True, first=None) -> EpisodeResult:
    largest = {"qpos": 0.5 if first else 0.0, "reward": 0.0}
    return EpisodeResult(seed, steps, 2, native, ours, largest, first)


def test_the_shortest_episode_that_succeeds_on_both_sides_is_shown():
    episodes = tuple(Episode(seed, np.zeros((1, 8), np.float32)) for seed in range(4))
    runs = [
        Run(TASK, "one", episodes[:2], "fresh", "none"),
        Run(TASK, "two", episodes[2:], "fresh", "none"),
    ]
    results = [a_result(0, 9), a_result(1, 3, ours=False), a_result(2, 7), a_result(3, 8)]
    chosen = _shortest_success(runs, results)
    assert (chosen.name, chosen.episode.seed) == ("two", 2)
    nothing = [a_result(n, 9 - n, native=False) for n in range(4)]
    assert _shortest_success(runs, nothing).episode.seed == 3


def test_agreement():
    where = FirstDifference(4, "qpos", "panda")
    results = [a_result(), a_result(7, 6, ours=False, first=where)]
    assert agreement(results) == {
        "episodes": 2,
        "equal": 1,
        "steps": 11,
        "contact_steps": 4,
        "same_success": 1,
        "native_success": 2,
        "our_success": 1,
        "max_difference": 0.5,
        "differing": [{"seed": 7, "where": "from step 4 in qpos of panda"}],
    }


class TestSummary:
    def test_round_trip(self, tmp_path):
        path = tmp_path / "new" / SUMMARY
        entry = blank(TASK, {"episodes": 1})
        write_summary(path, {TASK: entry})
        found = read_summary(path)
        assert found["tasks"] == {TASK: entry}
        assert found["versions"]["sapien"]
        assert [p.name for p in path.parent.iterdir()] == [SUMMARY]

    def test_none_yet(self, tmp_path):
        assert read_summary(tmp_path / SUMMARY)["tasks"] == {}

    @pytest.mark.parametrize("text", ["", "[]", "{}", '{"tasks": 3}', '{"tasks": {"A": {}}}'])
    def test_something_else(self, text, tmp_path, capsys):
        path = tmp_path / SUMMARY
        path.write_text(text)
        with pytest.raises(ResultsError, match=r"summary\.json"):
            read_summary(path)
        assert main(["sweep", "--tasks", TASK, "--out", str(tmp_path)]) == 2
        assert capsys.readouterr().err.startswith("error: ")
        assert path.read_text() == text

    def test_a_plan_is_done_if_it_is_this_very_one_and_nothing_failed(self, tmp_path):
        one = Plan(TASK, ("a.h5",), 2, tmp_path, True)
        entry = blank(TASK, one.options)
        assert is_done(entry, one)
        assert not is_done(None, one)
        assert not is_done({**entry, "error": "it broke"}, one)
        assert not is_done(entry, Plan(TASK, ("a.h5",), 3, tmp_path, True))
        assert not is_done(entry, Plan(TASK, ("b.h5",), 2, tmp_path, True))
        assert not is_done(entry, Plan(TASK, ("a.h5",), 2, tmp_path, False))


def is_running(process: int) -> bool:
    stat = Path(f"/proc/{process}/stat")
    try:
        return stat.read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


class TestSweeping:
    pytestmark = NATIVE

    @pytest.mark.long
    def test_a_failure_stops_nothing_and_the_rest_is_not_done_again(self, tmp_path, capsys):
        demos, out = tmp_path / "demos", tmp_path / "runs"
        record(demos, TASK)
        broken = record(demos, OTHER)
        whole = broken.read_bytes()
        broken.write_bytes(whole[: len(whole) // 2])
        words = ["sweep", "--tasks", OTHER, TASK, "--demos", str(demos), "--out", str(out)]
        words.append("--no-video")
        assert main(words) == 1
        said = capsys.readouterr().out
        assert "2/2 episodes equal (demonstrations)" in said
        assert "1 of 2 tasks swept and equal" in said
        found = json.loads((out / SUMMARY).read_text())["tasks"]
        assert str(broken) in found[OTHER]["error"]
        assert found[OTHER]["agreement"] is None
        good = found[TASK]
        assert (good["error"], good["equal"], good["source"]) == (None, True, "demonstrations")
        assert good["agreement"]["equal"] == good["agreement"]["episodes"] == 2
        assert good["agreement"]["steps"] == 5
        assert (good["rollout"]["seed"], good["rollout"]["steps"]) == (1, 2)
        assert (good["clip"], good["no_clip"]) == (None, NO_VIDEO)
        arrays, about = load(out / TASK / "maniskill.npz")
        assert arrays["arm.qpos"].shape == (3, 9)
        assert about["seed"] == 1

        broken.write_bytes(whole)
        first = (out / TASK / "maniskill.npz").stat().st_mtime_ns
        assert main(words) == 0
        said = capsys.readouterr().out
        (line,) = (line for line in said.splitlines() if "done before" in line)
        assert line.startswith(TASK)
        assert "2 of 2 tasks swept and equal" in said
        assert (out / TASK / "maniskill.npz").stat().st_mtime_ns == first
        assert json.loads((out / SUMMARY).read_text())["tasks"][OTHER]["equal"] is True

    @pytest.mark.long
    def test_a_process_that_is_killed(self, tmp_path):
        one = Plan(TASK, (str(record(tmp_path, TASK, (50,))),), 1, tmp_path / "runs", False)
        stages: list[str] = []

        def kill(task_id: str, stage: str, share: float) -> None:
            stages.append(stage)
            for child in multiprocessing.active_children():
                child.kill()

        (entry,) = sweep([one], progressed=kill)
        assert stages
        assert re.fullmatch(
            rf"worker process \d+ died by SIGKILL; {tmp_path}/runs/{LOG} holds its output",
            entry["error"],
        )
        assert entry["equal"] is False

    @pytest.mark.long
    @pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
    def test_a_sweep_that_is_stopped_leaves_no_process_behind(self, number, tmp_path):
        words = ("--tasks", TASK, "--episodes", "500", "--no-video", "--out", str(tmp_path))
        command = [sys.executable, "-m", "parity", "sweep", *words]
        with subprocess.Popen(command, cwd=ROOT, stderr=subprocess.PIPE, text=True) as parent:
            deadline = time.monotonic() + 120
            while not (children := workers_of(parent.pid)) and time.monotonic() < deadline:
                time.sleep(0.1)
            while not (tmp_path / TASK / LOG).exists() and time.monotonic() < deadline:
                time.sleep(0.1)
            time.sleep(10)  # it plays by now
            parent.send_signal(number)
            said = parent.communicate(timeout=60)[1]
        assert children
        if number == signal.SIGINT:
            assert parent.returncode == 130
            assert "the same command goes on from here" in said
            assert "Traceback" not in said
        while any(map(is_running, children)) and time.monotonic() < deadline:
            time.sleep(0.1)
        assert not any(map(is_running, children))

    @pytest.mark.long
    def test_a_cluster(self, tmp_path, monkeypatch, capsys):
        monkeypatch.chdir(tmp_path)
        with running_cluster() as cluster:
            cluster.grow(1)
            words = ["--tasks", TASK, "--episodes", "1", "--no-video", "--out", "runs"]
            assert main(["sweep", *words, "--ray", cluster.address]) == 0
        assert "1 of 1 tasks swept and equal" in capsys.readouterr().out
        assert (tmp_path / "runs" / TASK / LOG).is_file()
        assert main(["sweep", *words]) == 0
        assert "(done before)" in capsys.readouterr().out

    @pytest.mark.long
    def test_a_clip(self, tmp_path, monkeypatch):
        demos = tmp_path / "demos"
        record(demos, TASK)
        words = ["sweep", "--tasks", TASK, "PushT-v1", "--demos", str(demos), "--workers", "2"]
        assert main([*words, "--episodes", "1", "--out", str(tmp_path)]) == 0
        found = read_summary(tmp_path / SUMMARY)["tasks"]
        clip = found[TASK]["clip"]
        assert (clip["frames"], clip["differing_frames"], clip["mean_pixel_difference"]) == (
            4,
            0,
            0,
        )
        for name in (clip["clip"], clip["sheet"], "maniskill.mp4", LOG):
            assert (tmp_path / TASK / name).is_file()
        if found["PushT-v1"]["source"] == "random":
            assert found["PushT-v1"]["no_clip"] == NO_DEMONSTRATION

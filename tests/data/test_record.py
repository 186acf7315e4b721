"""`python -m robot_layouts record`: the same files whatever happens on the way."""

import json
import os
import random
import signal
import subprocess
import sys
import time
from collections import Counter
from functools import wraps
from pathlib import Path

import numpy as np
import pytest

import tasks
from robot_layouts.__main__ import main
from robot_layouts.data.reading.recording import Recording
from robot_layouts.data.recording.record import record
from robot_layouts.data.recording.recorder import Recorder
from robot_layouts.experts import registry
from robot_layouts.experts.maniskill.pick_cube import pick_cube
from robot_layouts.experts.rehearsal import Plan
from robots import TaskError
from tasks import TaskEnv
from tasks.episode import play
from tests.data.plays import NO_PLAN, TASK, at_random
from tests.data.test_recorder import same_files
from tests.process_trees import workers_of

ROOT = Path(__file__).parents[2]
FILE = "trajectory.h5"
PATIENCE = 900.0  # s; busy machines are slow


@pytest.fixture(autouse=True)
def _cheap_expert(monkeypatch):
    monkeypatch.setitem(registry.EXPERTS.registered, TASK, at_random)


def arguments(out: Path, episodes: int, workers: int = 1, **more: object) -> list[str]:
    chosen = {"task": TASK, "episodes": episodes, "workers": workers, "out": out, **more}
    return ["record", *(f"--{k.replace('_', '-')}={value}" for k, value in chosen.items())]


def start(*words: str) -> subprocess.Popen[str]:
    """Start a recording in a process group of its own."""
    return subprocess.Popen(
        [sys.executable, "-m", "tests.data.recording_process", *words],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def wait_for_parts(out: Path, count: int) -> None:
    deadline = time.monotonic() + PATIENCE
    while len(list(out.glob("trajectory.parts/*.part"))) < count:
        assert time.monotonic() < deadline, "nothing is recorded"
        time.sleep(0.005)


def wait_until_nobody_is_left(process: subprocess.Popen[str]) -> None:
    deadline = time.monotonic() + 60
    while True:
        try:
            os.killpg(process.pid, 0)
        except ProcessLookupError:
            return
        assert time.monotonic() < deadline, "a process is left"
        time.sleep(0.05)


def recorded_directly(path: Path, seeds: range) -> Path:
    """The same recording without any process or part of the command."""
    env = tasks.make(TASK)
    description = f"{at_random.__module__}:{at_random.__qualname__}"
    with Recorder(path, env, source_desc=description) as recorder:
        for seed in seeds:
            recorder.add(play(env, seed, at_random(env, seed)))
    return path


def test_workers_make_no_difference(tmp_path, capsys):
    direct = recorded_directly(tmp_path / FILE, range(4, 11))
    for workers in (0, 2):
        assert main(arguments(tmp_path / str(workers), 7, workers, seed=4)) == 0
        printed = capsys.readouterr().out
        assert f"{FILE}: 7 episodes" in printed
        assert "7 new episodes, 0 with success, 22.0 steps on average" in printed
        assert same_files(tmp_path / str(workers) / FILE, direct)
    with Recording(direct) as file:
        assert file.seeds == tuple(range(4, 11))
        file.expect_world(tasks.make(TASK))


@pytest.mark.long
def test_the_same_command_goes_on(tmp_path, capsys):
    assert main(arguments(tmp_path, 2, seed=2)) == 0
    assert main(arguments(tmp_path, 5)) == 0
    captured = capsys.readouterr()
    assert "2 of 5 episodes were recorded before" in captured.err
    assert "3 new episodes," in captured.out
    before = (tmp_path / FILE).stat()
    assert main(arguments(tmp_path, 5, workers=2)) == 0
    assert "5 of 5 episodes were recorded before" in capsys.readouterr().err
    assert (tmp_path / FILE).stat().st_mtime_ns == before.st_mtime_ns
    assert same_files(tmp_path / FILE, recorded_directly(tmp_path / "direct" / FILE, range(5)))


@pytest.mark.long
def test_joint_positions_are_recorded_from_an_expert_that_speaks_deltas(tmp_path):
    assert main(arguments(tmp_path / "deltas", 2)) == 0
    assert main(arguments(tmp_path / "positions", 2, control_mode="pd_joint_pos")) == 0
    with (
        Recording(tmp_path / "deltas" / FILE) as deltas,
        Recording(tmp_path / "positions" / FILE) as positions,
    ):
        assert positions.control_mode == "pd_joint_pos"
        for one, other in zip(deltas, positions, strict=True):
            assert not np.array_equal(one.actions, other.actions)
            for kind, entries in one.states.items():
                for name, rows in entries.items():
                    np.testing.assert_array_equal(rows, other.states[kind][name])


def gives_up(task, seed):
    """An expert that goes the first two steps of its way, and says so."""
    plan = pick_cube(task, seed)[:2].view(Plan)
    plan.reason, plan.episode = "the episode ended at arm.grasp cube", None
    return plan


@pytest.mark.parametrize("mode", ["pd_joint_delta_pos", "pd_joint_pos"])
def test_failures_are_named_with_their_reasons(tmp_path, capsys, monkeypatch, mode):
    monkeypatch.setitem(registry.EXPERTS.registered, "PickCube-v1", gives_up)
    words = arguments(tmp_path, 2, 0, task="PickCube-v1", seed=4, control_mode=mode)
    assert main(words) == 0
    reason = "the episode ended at arm.grasp cube"
    assert capsys.readouterr().out.splitlines()[1:] == [
        "2 new episodes, 0 with success, 2.0 steps on average",
        "no success: seeds 4, 5",
        f"seed 4: {reason}",
        f"seed 5: {reason}",
    ]
    listed = json.loads((tmp_path / "trajectory.json").read_text())["episodes"]
    assert [episode["reason"] for episode in listed] == [reason] * 2
    with Recording(tmp_path / FILE) as file:
        assert [episode.reason for episode in file] == [reason] * 2


@wraps(pick_cube)  # a recording names its expert
def planned(task, seed):
    """The expert's plan, without anything of its rehearsal."""
    return np.array(pick_cube(task, seed))


@pytest.mark.parametrize("num_envs", [1, 2])
def test_a_plan_that_was_rehearsed_is_recorded_without_being_played_again(
    tmp_path, monkeypatch, num_envs
):
    """It is the same recording, with one control step of the task for each recorded one."""
    steps = Counter[str]()
    advance = TaskEnv.advance

    def counted(self, action, env_ids=None):
        steps[name] += 1
        return advance(self, action, env_ids)

    monkeypatch.setattr(TaskEnv, "advance", counted)
    for name, expert in (("again", planned), ("once", pick_cube)):
        monkeypatch.setitem(registry.EXPERTS.registered, "PickCube-v1", expert)
        summary = record("PickCube-v1", range(3), tmp_path / name, workers=0, num_envs=num_envs)
        assert [score.success for score in summary.played.values()] == [True] * 3
    recorded = sum(score.steps for score in summary.played.values())
    assert steps["once"] == recorded < steps["again"]
    assert same_files(tmp_path / "once" / FILE, tmp_path / "again" / FILE)


@pytest.mark.long
def test_a_seed_without_a_plan_is_told_and_tried_again(tmp_path, capsys):
    for _ in range(2):
        assert main(arguments(tmp_path, 3, seed=NO_PLAN - 1)) == 1
        captured = capsys.readouterr()
        assert f"seed {NO_PLAN} is not recorded: no plan for seed {NO_PLAN}" in captured.err
        assert f"not recorded: seed {NO_PLAN}\nseed {NO_PLAN}: no plan for" in captured.out
        with Recording(tmp_path / FILE) as file:
            assert file.seeds == (NO_PLAN - 1, NO_PLAN + 1)


@pytest.mark.parametrize(
    ("words", "code", "complaint"),
    [
        (["--task=PushX-v1"], 2, "unknown task 'PushX-v1'. Did you mean 'PushT-v1'?"),
        (["--episode-timeout=0"], 2, "0 is no limit; it must be seconds, more than 0, or none"),
        (["--workers=0", "--episode-timeout=5"], 1, "with workers=0 this process plays"),
        (["--ray="], 1, "'' is no address of a Ray cluster; it must be"),
        (["--control-mode=pd_ee_dance"], 1, "control_mode 'pd_ee_dance' is not offered"),
    ],
)
def test_bad_usage(tmp_path, capsys, words, code, complaint):
    try:
        found = main([*arguments(tmp_path / "never", 1), *words])
    except SystemExit as stop:
        found = stop.code
    assert found == code
    assert complaint in capsys.readouterr().err
    assert not (tmp_path / "never").exists()


@pytest.mark.long
def test_a_worker_that_is_killed(tmp_path):
    process = start(*arguments(tmp_path, 60, 2))
    wait_for_parts(tmp_path, 2)
    workers = workers_of(process.pid)
    os.kill(workers[0], signal.SIGKILL)
    printed, said = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, said
    assert f"worker process {workers[0]} died by SIGKILL " in said
    assert "; another takes its place" in said
    assert f"replaced: worker process {workers[0]} died" in printed
    assert same_files(tmp_path / FILE, recorded_directly(tmp_path / "direct" / FILE, range(60)))


@pytest.mark.long
@pytest.mark.parametrize(
    "how", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.long)]
)
def test_a_recording_that_is_interrupted(tmp_path, how):
    process = start(*arguments(tmp_path, 10**6, 1 if how is signal.SIGINT else 2))
    wait_for_parts(tmp_path, 3)
    if how is signal.SIGINT:
        os.killpg(process.pid, how)  # as a terminal does
    else:
        process.send_signal(how)
    printed, said = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130
    assert printed == ""
    assert "Traceback" not in said
    wait_until_nobody_is_left(process)
    with Recording(tmp_path / FILE) as file:
        assert len(file) >= 3
        last = said.splitlines()[-1]
        assert last == f"stopped; {len(file)} episodes are recorded; the same command goes on" + (
            " from there"
        )
        assert sum(len(episode.actions) for episode in file) > 60
    assert not (tmp_path / "trajectory.parts").exists()


def expect_killed_and_resumed(
    tmp_path: Path, episodes: int, kills: list[float], workers: int
) -> None:
    """Kill a recording some time after it has begun to write, and go on until it is whole."""
    out, undisturbed = tmp_path / "killed", tmp_path / "undisturbed" / FILE
    for patience in kills:
        before = len(list(out.glob("trajectory.parts/*.part")))
        process = start(*arguments(out, episodes, workers))
        wait_for_parts(out, before + 1)
        time.sleep(patience)
        process.kill()
        process.communicate()
        wait_until_nobody_is_left(process)
    left = len(list(out.glob("trajectory.parts/*.part")))
    assert 0 < left < episodes, "it was killed too late"
    last = start(*arguments(out, episodes, workers))
    printed, said = last.communicate(timeout=PATIENCE)
    assert last.returncode == 0, said
    assert f"{left} of {episodes} episodes were recorded before" in said
    assert f"{episodes - left} new episodes," in printed
    assert same_files(out / FILE, recorded_directly(undisturbed, range(episodes)))
    assert sorted(path.name for path in out.iterdir()) == [FILE, "trajectory.json"]


@pytest.mark.long
def test_a_recording_that_is_killed_again_and_again(tmp_path):
    kills = [random.uniform(0, 1.5) for _ in range(8)]
    print("seconds after the first part:", kills)
    expect_killed_and_resumed(tmp_path, 1000, kills, 2)


@pytest.mark.long
def test_a_recording_of_many_files_that_is_killed_again_and_again(tmp_path):
    """Its files are those of one that nobody disturbed, with another number of workers."""
    out, undisturbed = tmp_path / "killed", tmp_path / "undisturbed"
    episodes, size = 300, {"file_size": 0.5}
    for patience in (random.uniform(0, 1.5) for _ in range(6)):
        before = set(out.glob("*/*.part"))
        process = start(*arguments(out, episodes, 2, **size))
        deadline = time.monotonic() + PATIENCE
        while not set(out.glob("*/*.part")) - before:
            assert time.monotonic() < deadline, "nothing is recorded"
        time.sleep(patience)
        process.kill()
        process.communicate()
        wait_until_nobody_is_left(process)
    for folder, workers in ((out, 2), (undisturbed, 0)):
        assert main(arguments(folder, episodes, workers, **size)) == 0
    names = sorted(path.name for path in undisturbed.iterdir())
    assert len(names) > 7
    assert sorted(path.name for path in out.iterdir()) == names
    for name in names:
        assert (out / name).read_bytes() == (undisturbed / name).read_bytes(), name


@pytest.mark.long
def test_a_full_disk_ends_it_with_what_is_finished(small_disk):
    process = start(*arguments(small_disk, 1000, 2))
    _, said = process.communicate(timeout=PATIENCE)
    assert process.returncode == 1
    assert "Traceback" not in said
    kept, error = said.splitlines()[-2:]
    assert error.startswith(f"error: cannot write {small_disk}/trajectory.parts/seed-")
    assert error.endswith("No space left on device")
    parts = len(list(small_disk.glob("trajectory.parts/*.part")))
    assert parts > 3
    assert kept == f"stopped; {parts} episodes are recorded"
    wait_until_nobody_is_left(process)


class TestAnEnvironment:
    def test_its_episodes_are_made_as_it_was(self, tmp_path, monkeypatch):
        monkeypatch.chdir(tmp_path)
        env = tasks.make(TASK, num_envs=3, control_mode="pd_joint_pos", max_episode_steps=7)
        summary = record(env, episodes=2, workers=0)
        assert summary.folder == Path("runs/recordings") / TASK
        assert "2 new episodes" in str(summary)
        with Recording(summary) as file:
            assert (len(file), file.seeds, file.control_mode) == (2, (0, 1), "pd_joint_pos")
            assert file.max_episode_steps == 7

    def test_it_takes_no_arguments_of_make(self, tmp_path):
        with pytest.raises(TaskError, match=f"robots given beside an environment of {TASK}"):
            record(tasks.make(TASK), [0], tmp_path, robots="panda")
        assert [*tmp_path.iterdir()] == []


@pytest.mark.parametrize("which", [{}, {"seeds": [0], "episodes": 1}])
def test_seeds_or_episodes(which, tmp_path):
    with pytest.raises(TaskError, match="give either seeds or episodes"):
        record(TASK, folder=tmp_path, **which)

"""Recordings of worlds that vary: the same whoever plays, and brought back by seed and header."""

import json
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path

import pytest

from robot_layouts.__main__ import main
from robot_layouts.data import evaluate, record
from robot_layouts.data.playing.ray_executor import RayExecutor
from robot_layouts.data.playing.replay import replay
from robot_layouts.data.reading.json_files import TrajectoryError
from robot_layouts.data.reading.recorded_task import task_for
from robot_layouts.data.reading.recording import FILE, Recording
from robots import RecordingError
from tasks.randomization.declaration import AXES
from tests.data.clusters import running_cluster
from tests.data.policies import Leans
from tests.data.test_recorder import same_files
from tests.tasks.randomization.declarations import EVERY_AXIS, TASK, VARIED

SOLVED = 0, 3  # seeds of worlds that vary in which the expert finds a way


def recorded(folder: Path, seeds: Sequence[int], **arguments: object) -> Path:
    arguments = {"randomization": VARIED, **arguments}
    summary = record(TASK, seeds, folder, **arguments)  # type: ignore[arg-type]
    assert not summary.failed
    return folder / FILE


def test_a_recording_brings_its_worlds_back(tmp_path: Path) -> None:
    path = recorded(tmp_path, SOLVED, workers=0)
    with Recording(path) as file, closing(task_for(file)) as env:
        assert env.scenario.randomization == VARIED
        for episode in file:
            assert episode.solved
            replayed = replay(env, episode)
            assert replayed.agrees
            assert replayed.difference is None
            assert episode.drawn == env.drawn()
            assert episode.drawn is not None
            assert {*episode.drawn} == {*VARIED.to_json().keys() - {"action_noise", "sensor_noise"}}


def test_what_was_drawn_is_compared(tmp_path: Path) -> None:
    path = recorded(tmp_path, range(1), workers=0)
    summary = json.loads(path.with_suffix(".json").read_text())
    summary["episodes"][0]["drawn"]["mass"]["cube"] += 1e-9
    path.with_suffix(".json").write_text(json.dumps(summary))
    with Recording(path) as file, closing(task_for(file)) as env:
        replayed = replay(env, file[0])
        assert replayed.difference is None
        assert not replayed.agrees


def test_a_recording_does_not_go_on_in_other_worlds(tmp_path: Path) -> None:
    recorded(tmp_path, range(1), workers=0)
    with pytest.raises(RecordingError, match="randomization"):
        record(TASK, range(2), tmp_path, workers=0)


def test_a_header_that_makes_no_sense_is_refused(tmp_path: Path) -> None:
    path = recorded(tmp_path, range(1), workers=0)
    from tests.data.recordings import edited

    with edited(path) as file:
        about = json.loads(str(file.attrs["simulation"]))
        about["randomization"]["mass"]["cube"] = {"uniform": [2, 1]}
        file.attrs["simulation"] = json.dumps(about)
    with Recording(path) as file, pytest.raises(TrajectoryError, match="wrong way round"):
        task_for(file)


@pytest.mark.long
def test_commands_take_a_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    VARIED.save(tmp_path / "varied.yaml")
    words = ["--task", TASK, "--episodes", "1", "--workers", "0", "--randomization"]
    out = tmp_path / "out"
    assert main(["record", *words, str(tmp_path / "varied.yaml"), "--out", str(out)]) == 0
    assert same_files(out / FILE, recorded(tmp_path / "here", range(1), workers=0))
    assert main(["replay", str(out)]) == 0
    assert "in 1 all states are equal" in capsys.readouterr().out
    assert main(["evaluate", *words, str(tmp_path / "varied.yaml")]) == 0
    (tmp_path / "wrong.yaml").write_text("mas: {}")
    assert main(["evaluate", *words, str(tmp_path / "wrong.yaml")]) == 1
    assert "Did you mean 'mass'" in capsys.readouterr().err


@pytest.mark.long
def test_policies_are_judged_in_worlds_that_vary() -> None:
    alone = evaluate("expert", TASK, SOLVED, workers=0, randomization=VARIED)
    plain = evaluate("expert", TASK, SOLVED, workers=0)
    assert alone.success_rate == 1.0
    assert alone.scores != plain.scores


@pytest.mark.long
def test_experts_do_the_same_in_workers(tmp_path: Path) -> None:
    here, there = (recorded(tmp_path / str(w), SOLVED, workers=w) for w in (0, 2))
    assert same_files(here, there)


@pytest.mark.long
def test_worlds_are_the_same_whoever_plays(tmp_path: Path) -> None:
    """Every axis, in this process, in 1, 2 and 8 workers, and on a Ray cluster.

    A policy acts by what it observes, noise and delays included.
    """
    assert {*EVERY_AXIS.declared} == {*AXES}
    seeds, policy = range(8), Leans(actions=16, strength=0.1)
    worlds = {"randomization": EVERY_AXIS, "policy": policy}
    expected = recorded(tmp_path / "here", seeds, workers=0, **worlds)
    for workers in (1, 2, 8):
        path = recorded(tmp_path / str(workers), seeds, workers=workers, **worlds)
        assert same_files(path, expected)
    with running_cluster() as nodes:
        nodes.grow(2)
        executor = RayExecutor(str(nodes.address))
        assert same_files(recorded(tmp_path / "ray", seeds, executor=executor, **worlds), expected)
    with Recording(expected) as file, closing(task_for(file)) as env:
        replays = [replay(env, episode) for episode in file]
    assert all(played.agrees and played.difference is None for played in replays)

"""``python -m parity bench``: native and ours in turns, in the same motion; and its record."""

import json
from pathlib import Path

import numpy as np
import pytest

import tasks
from measurements.bench import native as bench
from measurements.bench import tables as bench_table
from measurements.bench.native import benchmarks
from measurements.bench.report import read
from measurements.bench.settings import Settings
from measurements.bench.steps import Played
from measurements.bench.vectors import vectors
from parity.__main__ import main
from parity.compare.native_env import make_native
from tests.native import NATIVE

TINY = Settings(
    rounds=1,
    steps=3,
    batch_steps=3,
    worker_envs=2,
    tasks=("PickCube-v1",),
    vector_tasks=("PickCube-v1", "FourRobotStack-v1"),
)


class TestBesideNative:
    pytestmark = NATIVE

    @pytest.mark.long
    def test_steps_and_resets(self, tmp_path, capsys):
        words = ("--only", "step", "reset", "--task", "PickCube-v1", "--rounds", "1")
        assert main(["bench", *words, "--out", str(tmp_path)]) == 0
        assert "native / here" in capsys.readouterr().out
        report = read(tmp_path / "bench.json")
        for name in ("step", "reset"):
            found = report.find(name)
            assert found.values == ("PickCube-v1",)
            native, here = (found.median(side, "PickCube-v1") for side in ("native", "here"))
            assert found.ratio("native", "here", "PickCube-v1") == pytest.approx(native / here)
        assert report.find("step").floors == ("physics alone",)

    def test_both_play_the_same_motion(self):
        native, ours = make_native("PickCube-v1"), tasks.make("PickCube-v1")
        played = Played(ours, TINY)
        bench._native_steps(native, played, 0, TINY)  # the same past: PhysX remembers it
        for number in (5, 6):
            bench._native_steps(native, played, number, TINY)
            played.step(number)
            here = ours.simulation.read().qpos("arm")
            assert np.array_equal(native.agent.robot.get_qpos().numpy(), here)

    @pytest.mark.long
    def test_vectors(self):
        found = vectors(TINY, bench._native_vector)
        assert found.median("native", "PickCube-v1") > 0
        assert found.median("native", "FourRobotStack-v1") is None
        for value in (x for t in TINY.vector_tasks for x in (t, f"{t}, one core disturbed")):
            assert found.ratio("here", "physics alone", value) > 0
            assert found.ratio("asynchronous", "physics alone", value) > 0


def test_it_has_every_benchmark_of_rollouts():
    from measurements.bench.catalogue import BENCHMARKS

    assert {*BENCHMARKS} == {*benchmarks(("PickCube-v1",))}


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--only", "vectors"), "unknown benchmark 'vectors'. Did you mean 'vector'?"),
        (("--task", "Relay-v1"), "Relay-v1 clones no native task"),
        (("--record", "--only", "step"), "leave out --only and --task"),
    ],
)
def test_what_makes_no_sense_is_refused(options, message, capsys):
    assert main(["bench", *options]) == 2
    assert message in capsys.readouterr().err


def test_the_record_is_whole_and_of_no_one():
    record = read(bench_table.RECORD)
    assert not record.left_out
    assert {one.name for one in record.measurements} == {*benchmarks(())}
    assert {*record.find("step").values} <= {*tasks.list_clones()}
    text = bench_table.RECORD.read_text(encoding="utf-8")
    assert str(Path.home()) not in text
    assert {*json.loads(text)["machine"]} == {"cpu", "cores", "system", "versions"}

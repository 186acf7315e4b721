"""Benchmarks: what their figures mean, and that each really runs. No test asks how fast it was."""

import json
import multiprocessing
import socket
from dataclasses import replace

import numpy as np
import pytest

import tasks
from benchmarks.__main__ import main
from benchmarks.bench.environments import Played
from benchmarks.bench.measurement import BenchmarkError, Clock, Measurement, Settings
from benchmarks.bench.report import RECORD, Report, machine, read_report, summary
from benchmarks.bench.run import BENCHMARKS
from tests.quick import quick_cases

TINY = Settings(
    rounds=2,
    task=("PickCube-v1",),
    steps=2,
    batch_steps=2,
    environments=(1, 2),
    workers=(0, 1),
    worker_envs=2,
    robots=(1, 2),
    cubes=(0, 8),
    started=(1,),
    vector_task=("PickCube-v1",),
    episodes=1,
    checked=(1, 2),
)
NUMBERS = Measurement(
    name="numbers",
    title="Something with numbers",
    unit="µs per step",
    variable="robots",
    values=(1, 2),
    samples={"step": [[3.0, 2.0, 10.0], [4.0]], "physics": [[1.0, 2.0, 4.0], [2.0]]},
    floors=("physics",),
    ratios=(("step", "physics"),),
)
NAMES = Measurement(
    name="names",
    title="Something with names",
    unit="ms per reset",
    variable="task",
    values=("A-v1", "B-v1"),
    samples={"here": [[1.0, 1.5, 2.0], [2.0]], "native": [[3.0, 4.0, 5.0], []]},
    ratios=(("native", "here"),),
)


def report_of(*measurements):
    return Report(measurements, machine(), str(Clock()), (0.5, 1.25))


class TestWhatIsTimed:
    def test_a_step_and_the_physics_alone_are_the_same_motion(self):
        played = Played(tasks.make("PickCube-v1", num_envs=2), replace(TINY, steps=10))
        ends = []
        for play in (played.step, played.physics):
            assert play(3) > 0
            ends.append(played.env.simulation.read().joint_positions.copy())
        assert np.array_equal(*ends)
        played.step(4)
        assert not np.array_equal(played.env.simulation.read().joint_positions, ends[0])


QUICK = ("reset", "step", "validation")  # the others start processes, draw, or take longer


@pytest.mark.parametrize("name", quick_cases(BENCHMARKS, QUICK))
def test_every_benchmark_measures(name, request):
    if name in ("looks", "pictures", "cameras", "camera_rate"):
        request.getfixturevalue("renderer")  # the one with which native draws later, too
    shares = []
    found = BENCHMARKS[name](replace(TINY, tick=shares.append))
    assert found.name == name
    assert sum(shares) == pytest.approx(1)
    assert len(found.values) >= 1
    for series in found.samples:
        for value in found.values:
            assert np.isfinite(found.median(series, value))
    assert all({*pair} <= {*found.samples} for pair in found.ratios)
    assert {*found.floors} <= {*found.samples}
    assert not multiprocessing.active_children()


class TestCommand:
    def run(self, tmp_path, *options):
        return main(["bench", "--rounds", "1", "--out", str(tmp_path), *options])

    def test_it_leaves_json_tables_and_a_plot(self, tmp_path, capsys):
        only = ("--only", "step", "reset", "--task", "pick_cube", "PushT-v1", "--processor-time")
        assert self.run(tmp_path, *only) == 0
        printed = capsys.readouterr().out
        page = (tmp_path / "bench.md").read_text(encoding="utf-8")
        for text in (printed, page):
            assert "PickCube-v1" in text
            assert "expert's" in text  # of headings that a terminal wraps
            assert "physics" in text
            assert "processor time of all processes" in " ".join(text.split())
        assert (tmp_path / "bench.png").read_bytes().startswith(b"\x89PNG")
        record = (tmp_path / "bench.json").read_text(encoding="utf-8")
        found = json.loads(record)
        assert socket.gethostname() not in json.dumps(found["machine"])
        assert str(tmp_path) not in record
        assert [one["name"] for one in found["measurements"]] == ["step", "reset"]
        assert found["measurements"][0]["values"] == ["PickCube-v1", "PushT-v1"]
        assert read_report(tmp_path / "bench.json").page() == page

    @pytest.mark.parametrize(
        ("options", "message"),
        [
            (("--only", "stepp"), "unknown benchmark 'stepp'. Did you mean 'step'?"),
            (("--task", "PickCub-v1"), "Did you mean 'PickCube-v1'?"),
            (("--kinds", "pandaa"), "Did you mean 'panda'?"),
            (("--robots", "1", "9"), "--robots is 9; it must be from 1 to 8"),
            (("--environments", "0"), "--environments is 0; it must be 1 or more"),
            (("--record", "--only", "step"), "beside native: give --native, no --task"),
            (("--record", "--native", "--task", "PushT-v1"), "give --native, no --task"),
        ],
    )
    def test_what_there_is_not_is_refused(self, tmp_path, capsys, options, message):
        assert self.run(tmp_path, *options) == 2
        assert message in capsys.readouterr().err
        assert not [*tmp_path.iterdir()]


def test_a_report_is_read_as_it_was_written(tmp_path):
    report = report_of(NUMBERS, NAMES)
    report.write(tmp_path)
    assert read_report(tmp_path / "bench.json") == report
    numbers = json.loads((tmp_path / "bench.json").read_text(encoding="utf-8"))["measurements"][0]
    assert numbers["medians"] == {"step": [3.0, 4.0], "physics": [2.0, 2.0]}
    assert numbers["median_ratios"] == {"step / physics": [2.5, 2.0]}
    with pytest.raises(BenchmarkError, match="nothing was measured of 'step'"):
        summary(report)


def test_the_record_is_whole():
    record = read_report()
    assert not record.left_out
    assert {one.name for one in record.measurements} == {*BENCHMARKS}
    assert {*record.find("step").values} <= {*tasks.list_clones()}
    assert {*json.loads(RECORD.read_text())["machine"]} == {"cpu", "cores", "system", "versions"}

"""Benchmarks: what their figures mean, and that each really runs. No test asks how fast it was."""

import json
import multiprocessing
import os
import socket
import sys
import time
from dataclasses import replace

import numpy as np
import pytest

import tasks
from measurements.bench import command, processes
from measurements.bench.catalogue import BENCHMARKS, measure
from measurements.bench.measurement import BenchmarkError, Measurement, interleave
from measurements.bench.plot import draw
from measurements.bench.processes import PhysicsProcesses, TimedVector
from measurements.bench.report import Report, machine, read
from measurements.bench.settings import Benchmark, Clock, Settings
from measurements.bench.steps import Played
from measurements.bench.worlds import crowd, make_pile
from robot_layouts.__main__ import main
from robots import MissingPackageError, SimulationError
from rollouts.progress import LiveLine
from simulation.sapien3.backend import worlds_below
from tests.quick import quick_cases

TINY = Settings(
    rounds=2,
    tasks=("PickCube-v1",),
    steps=2,
    batch_steps=2,
    environments=(1, 2),
    workers=(0, 1),
    worker_envs=2,
    robots=(1, 2),
    cubes=(0, 8),
    started=(1,),
    vector_tasks=("PickCube-v1",),
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


class TestFigures:
    def test_medians_and_medians_of_ratios(self):
        assert NUMBERS.median("step", 1) == 3.0
        assert NUMBERS.median("physics", 1) == 2.0
        assert NUMBERS.ratio("step", "physics", 1) == 2.5  # of 3, 1, 2.5; not 3 / 2
        assert NUMBERS.ratio("step", "physics", 2) == 2.0
        assert NUMBERS.quartiles("step", 1) == (2.5, 6.5)
        assert NUMBERS.quartiles("step", 2) is None

    def test_what_was_not_measured_is_a_dash(self):
        assert NAMES.median("native", "B-v1") is None
        assert NAMES.ratio("native", "here", "B-v1") is None
        assert NAMES.headings() == ["task", "here", "native", "native / here"]
        assert list(NAMES.rows()) == [["A-v1", "1.50", "4.00", "2.67"], ["B-v1", "2.00", "–", "–"]]

    def test_samples_are_taken_in_turns_after_a_warm_up(self):
        said, ticks = [], []

        def variant(name):
            def sample(number):
                said.append((name, number))
                return 10.0 * number

            return sample

        found = interleave({"a": variant("a"), "b": variant("b")}, 2, ticks.append)
        assert said == [(name, number) for number in (0, 1, 2) for name in ("a", "b")]
        assert found == {"a": [10.0, 20.0], "b": [10.0, 20.0]}
        assert sum(ticks) == pytest.approx(1)
        said.clear()
        interleave({"a": variant("a")}, 2, warm_up=False)
        assert said == [("a", 1), ("a", 2)]


class TestClock:
    def test_processor_time_is_that_of_processes(self):
        before = time.process_time()
        told = Clock(processor=True).now([os.getpid()]) - time.process_time()
        assert before <= told <= time.process_time()

    def test_time_that_goes_by(self):
        before = time.perf_counter()
        assert before <= Clock().now([os.getpid()]) <= time.perf_counter()

    def test_rates_of_processes_add_up_unless_processors_are_shared(self):
        work = [(10, 2.0), (30, 3.0)]
        assert Clock().rate(work) == 15
        assert Clock(processor=True).rate(work) == 8


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

    @pytest.mark.parametrize(("cubes", "pairs"), [(0, 1), (8, 25), (64, 400)])
    def test_cubes_of_a_pile_touch_and_stay_awake(self, cubes, pairs):
        env = make_pile(cubes)
        for _ in range(40):
            env.step(np.zeros((1, 8), np.float32))
        world = worlds_below(env.simulation)[0]
        bodies = [world.bodies[name] for name in ("cube", *(f"pile{i}" for i in range(cubes)))]
        assert not any(body.component.is_sleeping for body in bodies)
        assert env.touching() >= pairs

    def test_kinds_of_a_crowd_take_turns(self):
        layout = crowd(3, ("panda", "so100"))
        assert [place.robot.name for place in layout.values()] == ["panda", "so100", "panda"]

    @pytest.mark.long
    def test_physics_processes_end_with_their_block_and_say_when_one_died(self):
        with (
            processes.vector("PickCube-v1", 2, 0) as env,
            PhysicsProcesses("PickCube-v1", 1, 2) as floor,
        ):
            timed = TimedVector(env, Clock(), 2)
            assert floor.rate(timed, 0) > 0
            (child,) = multiprocessing.active_children()
            child.kill()
            with pytest.raises(BenchmarkError, match="only does physics died by SIGKILL"):
                floor.rate(timed, 1)
        assert not multiprocessing.active_children()


QUICK = ("reset", "step", "validation")  # the others start processes, draw, or take longer


@pytest.mark.parametrize("name", quick_cases(BENCHMARKS, QUICK))
def test_every_benchmark_measures(name):
    shares = []
    found = BENCHMARKS[name].measure(replace(TINY, tick=shares.append))
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
        words = ["bench", "--rounds", "1", "--out", str(tmp_path), *options]
        return main(words)

    def test_it_leaves_json_tables_and_a_plot(self, tmp_path, capsys):
        only = ("--only", "step", "reset", "--task", "pick_cube", "PushT-v1")
        assert self.run(tmp_path, *only) == 0
        printed = capsys.readouterr().out
        page = (tmp_path / "bench.md").read_text(encoding="utf-8")
        for text in (printed, page):
            assert "PickCube-v1" in text
            assert "step / physics alone" in text
        assert (tmp_path / "bench.png").read_bytes().startswith(b"\x89PNG")
        record = (tmp_path / "bench.json").read_text(encoding="utf-8")
        assert socket.gethostname() not in json.dumps(json.loads(record)["machine"])
        assert str(tmp_path) not in record
        found = json.loads(record)
        assert {"cpu", "cores", "system", "versions"} == {*found["machine"]}
        assert [one["name"] for one in found["measurements"]] == ["step", "reset"]
        assert found["measurements"][0]["values"] == ["PickCube-v1", "PushT-v1"]
        again = read(tmp_path / "bench.json")
        assert [*again.markdown()] == page.splitlines()

    def test_processor_time_is_told(self, tmp_path):
        words = ("--only", "environments", "--environments", "2", "--processor-time")
        assert self.run(tmp_path, *words) == 0
        told = json.loads((tmp_path / "bench.json").read_text(encoding="utf-8"))
        assert told["clock"] == "processor time of all processes"
        assert told["measurements"][0]["values"] == [2]

    def test_without_matplotlib_there_is_no_plot(self, tmp_path, monkeypatch, capsys):
        monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
        assert self.run(tmp_path, "--only", "step", "--task", "PushT-v1") == 0
        assert "pip install 'robot-layouts[preview]'" in capsys.readouterr().out
        assert {path.name for path in tmp_path.iterdir()} == {"bench.json", "bench.md"}

    @pytest.mark.parametrize(
        ("options", "code", "message"),
        [
            (("--only", "stepp"), 2, "unknown benchmark 'stepp'. Did you mean 'step'?"),
            (("--task", "PickCub-v1"), 2, "Did you mean 'PickCube-v1'?"),
            (("--kinds", "pandaa"), 2, "Did you mean 'panda'?"),
            (("--robots", "0"), 1, "--robots 0: it takes numbers of 1 or more"),
            (("--robots", "1", "9"), 1, "--robots 9: it takes numbers from 1 to 8"),
            (("--environments", "0"), 1, "--environments 0: it takes numbers of 1 or more"),
        ],
    )
    def test_what_there_is_not_is_refused(self, tmp_path, capsys, options, code, message):
        assert self.run(tmp_path, *options) == code
        assert message in capsys.readouterr().err
        assert not [*tmp_path.iterdir()]

    def test_its_help_names_every_benchmark(self):
        assert command.EPILOG.startswith(f"Benchmarks: {', '.join(BENCHMARKS)}.")


@pytest.mark.parametrize("error", [MissingPackageError, SimulationError, BenchmarkError])
def test_what_cannot_be_measured_is_left_out(error, capsys):
    def fail(settings):
        raise error("pip install something")

    catalogue = {"broken": Benchmark("nothing", fail), "names": Benchmark("", lambda _: NAMES)}
    with LiveLine(2) as line:
        report = measure(["broken", "names"], catalogue, TINY, line)
    assert report.measurements == (NAMES,)
    assert report.left_out == {"broken": "pip install something"}
    assert "broken is left out: pip install something" in capsys.readouterr().err


class TestReport:
    def test_it_is_read_as_it_was_written(self, tmp_path):
        report = report_of(NUMBERS, NAMES)
        report.write(tmp_path)
        assert read(tmp_path / "bench.json") == report
        found = json.loads((tmp_path / "bench.json").read_text(encoding="utf-8"))
        numbers = found["measurements"][0]
        assert numbers["medians"] == {"step": [3.0, 4.0], "physics": [2.0, 2.0]}
        assert numbers["median_ratios"] == {"step / physics": [2.5, 2.0]}

    @pytest.mark.parametrize("text", ["", "{}", "[]", '{"measurements": [3]}'])
    def test_something_else_is_refused(self, tmp_path, text):
        (tmp_path / "bench.json").write_text(text)
        with pytest.raises(BenchmarkError, match=r"cannot read .*bench\.json"):
            read(tmp_path / "bench.json")

    def test_nothing_of_that_name(self):
        with pytest.raises(BenchmarkError, match="nothing was measured of 'memory'"):
            report_of(NUMBERS).find("memory")


class TestPlot:
    def test_lines_over_numbers(self):
        (axes,) = draw([NUMBERS], "told").axes
        assert (axes.get_xlabel(), axes.get_ylabel()) == ("robots", "µs per step")
        step, physics = axes.lines
        assert list(step.get_ydata()) == [3.0, 4.0]
        assert physics.get_linestyle() == "--"
        assert axes.get_ylim()[0] == 0
        shown = [text.get_text() for text in axes.get_legend().get_texts()]
        assert shown == ["step", "physics"]

    def test_bars_over_names(self):
        (axes,) = draw([NAMES], "told").axes
        assert axes.get_xlabel() == "ms per reset"
        assert [label.get_text() for label in axes.get_yticklabels()] == ["A-v1", "B-v1"]
        assert [bar.get_width() for bar in axes.patches] == [1.5, 4.0, 2.0]
        assert [text.get_text() for text in axes.texts] == ["1.50", "4.00", "2.00"]

    def test_it_says_on_what_it_was_measured(self):
        figure = draw([NUMBERS, NAMES], "Medians on a machine.")
        assert figure.get_supxlabel() == "Medians on a machine."
        assert len(figure.axes) == 2

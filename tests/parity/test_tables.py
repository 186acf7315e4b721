"""``robot-layouts parity tables``: the table, and every way in which it can be stale."""

import copy
import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from measurements.bench.measurement import Measurement
from measurements.bench.report import Report
from measurements.tables import BENCH_TABLES, PARITY_TABLE, begin, end, with_lines
from parity.__main__ import main
from parity.compare.results import ResultsError, read
from parity.compare.snapshot import QUANTITIES
from tasks.registry import CATALOGUE

ROOT = Path(__file__).parents[2]
BEGIN, END = begin(PARITY_TABLE), end(PARITY_TABLE)
BENCHES = f"{begin(BENCH_TABLES)}\n{end(BENCH_TABLES)}\n"
MARKERS = f"# Title\n\n{BEGIN}\n{END}\n\n{BENCHES}\nThe end.\n"

ENTRY = {
    "robots": "2 × panda",
    "observation_size": 66,
    "action_size": 16,
    "equal": True,
    "episodes": 12,
    "steps": 3456,
    "contact_steps": 789,
    "success": {"native": 5, "ours": 4, "both": 4},
    "histories": ["fresh", "reused"],
    "actions": {"random": {"episodes": 12, "steps": 3456, "contact_steps": 789}},
    "max_difference": {quantity: 0.0 for quantity in QUANTITIES if quantity != "reward"},
    "reward": {"normalized_dense": 0.0, "dense": 2.5e-7, "sparse": 0.0},
}


def a_record(*task_ids: str) -> dict:
    return {
        "equal": False,
        "versions": {"python": "3.11.7", "mani_skill": "3.0.1"},
        "machine": "x86_64",
        "tasks": {task_id: copy.deepcopy(ENTRY) for task_id in task_ids},
    }


def some_benchmarks(*task_ids: str) -> Report:
    """What is in the page's tables: native three times as slow, ours twice the physics."""

    def on(values, name, unit, ratios=(), **series) -> Measurement:
        samples = {key.replace("_", " "): [[x]] * len(values) for key, x in series.items()}
        floors = tuple(key for key in samples if key == "physics alone")
        return Measurement(
            name, f"About {name}", unit, "task", tuple(values), samples, floors, ratios
        )

    beside, floor = ("native", "here"), ("here", "physics alone")
    times = {"here": 2.0, "native": 6.0}
    return Report(
        (
            on(task_ids, "step", "µs per step", (beside, floor), **times, physics_alone=1.0),
            on(task_ids, "reset", "ms per reset", (beside,), **times),
            on(["A-v1"], "vector", "steps per second", (("here", "native"),), here=70.0, native=10),
            on([1, 64], "start", "s", start=4.5),
            on(["A-v1"], "memory", "MB", memory=1.5),
            on(["A-v1"], "recording", "ms", (("recorded", "stepped"),), stepped=10.0, recorded=11),
            on([4], "validation", "ms", check=66.5),
        ),
        {"cpu": "A processor", "cores": 2, "system": "Linux", "versions": {"python": "3.11.7"}},
        "time that went by",
        (0.5, 1.5),
    )


class Files:
    """A page and two records in a folder of their own."""

    def __init__(self, folder: Path, record: dict) -> None:
        self.page, self.results = folder / "parity.md", folder / "results.json"
        self.bench, self.benchmarks = folder / "bench.json", folder / "benchmarks.md"
        self.page.write_text(MARKERS, encoding="utf-8")
        self.write(record)
        self.write_bench(some_benchmarks(*CATALOGUE))

    def write_bench(self, report: Report) -> None:
        self.bench.write_text(report.as_json(), encoding="utf-8")

    def write(self, record: dict) -> None:
        self.results.write_text(json.dumps(record))

    def run(self, *options: str) -> int:
        paths = ("--page", str(self.page), "--results", str(self.results))
        paths += ("--bench", str(self.bench), "--benchmarks", str(self.benchmarks))
        return main(["tables", *paths, *options])


@pytest.fixture
def files(tmp_path, monkeypatch):
    monkeypatch.setattr("measurements.tables.list_clones", lambda: tuple(CATALOGUE))
    return Files(tmp_path, a_record(*CATALOGUE))


def test_a_row_says_everything(files):
    assert files.run() == 0
    text = files.page.read_text(encoding="utf-8")
    assert text.startswith("# Title\n\n")
    assert text.endswith("\n\nThe end.\n")
    shown, _, _ = text.partition(END)
    heading, rule, *rows = (line for line in shown.splitlines() if line.startswith("|"))
    assert heading.count("|") == rule.count("|") == rows[0].count("|")
    names, cells = ([c.strip() for c in line.strip("|").split("|")] for line in (heading, rows[0]))
    assert dict(zip(names, cells, strict=True)) == {
        "task": f"`{next(iter(CATALOGUE))}`",
        "robots": "2 × panda",
        "obs": "66",
        "actions": "16",
        "episodes": "12",
        "steps": "3456",
        "contact steps": "789",
        "object pose": "0",
        "qpos": "0",
        "observation": "0",
        "reward, normalized_dense": "0",
        "reward, dense": "2.5e-07",
        "reward, sparse": "0",
        "reward, none": "–",
        "success and info": "0",
        "succeeded native / here": "5 / 4",
    }
    assert len(rows) == len(CATALOGUE)
    assert "Measured on x86_64 with python 3.11.7, mani_skill 3.0.1." in text


def test_benchmarks_are_shown(files):
    files.run()
    text = files.page.read_text(encoding="utf-8")
    _, _, shown = text.partition(begin(BENCH_TABLES))
    lines = shown.splitlines()
    heading = "| task | step, here (µs) | step, native (µs) | step, physics alone (µs) |"
    heading += " native / here | here / physics alone |"
    assert f"{heading} reset, here (ms) | reset, native (ms) | native / here |" in lines
    row = "`PushT-v1` | 2.00 | 6.00 | 1.00 | 3.00 | 2.00 | 2.00 | 6.00 | 3.00"
    assert f"| {row} |" in lines
    assert "| A-v1 | 70.0 | 10.0 | 7.00 |" in lines
    assert "| About start (s) | 1 task: 4.50; 64 task: 4.50 |" in lines
    assert "| About recording (ms) | `A-v1`: 11.0 (recorded / stepped 1.10) |" in lines
    assert "A processor (Linux), 2 cores, load average 0.5 to 1.5; time that went by" in shown


def test_all_benchmarks_are_on_a_page(files, capsys):
    files.run()
    page = files.benchmarks.read_text(encoding="utf-8")
    assert page.startswith("# Benchmarks\n\nWhat things cost")
    assert "](images/benchmarks.png)" in page
    assert "| PushT-v1 | 2.00 | 6.00 | 1.00 | 3.00 | 2.00 |" in page
    files.benchmarks.write_text(page.replace("6.00", "7.00"), encoding="utf-8")
    assert files.run("--check") == 1
    assert "benchmarks.md is stale; run `robot-layouts parity tables`" in capsys.readouterr().err


def test_a_fresh_table_passes_and_stays(files, capsys):
    files.run()
    text = files.page.read_text(encoding="utf-8")
    assert files.run("--check") == 0
    assert files.run() == 0
    assert files.page.read_text(encoding="utf-8") == text
    assert capsys.readouterr() == ("", "")


class TestStale:
    def expect(self, files, capsys, complaint):
        before = files.page.read_bytes()
        assert files.run("--check") == 1
        assert complaint in capsys.readouterr().err
        assert files.page.read_bytes() == before

    def test_no_table_yet(self, files, capsys):
        self.expect(files, capsys, "parity.md is stale; run `robot-layouts parity tables`")

    def test_an_edited_cell(self, files, capsys):
        files.run()
        text = files.page.read_text(encoding="utf-8")
        files.page.write_text(text.replace("2.5e-07", "0", 1), encoding="utf-8")
        self.expect(files, capsys, "parity.md is stale")

    @pytest.mark.parametrize(
        ("key", "value"),
        [("episodes", 13), ("contact_steps", 0), ("robots", "panda"), ("observation_size", 67)],
    )
    def test_a_newer_record(self, files, capsys, key, value):
        files.run()
        record = a_record(*CATALOGUE)
        record["tasks"]["PushT-v1"][key] = value
        files.write(record)
        self.expect(files, capsys, "parity.md is stale")

    @pytest.mark.parametrize("quantity", ["object pose", "qpos", "observation", "info"])
    def test_a_new_difference(self, files, capsys, quantity):
        files.run()
        record = a_record(*CATALOGUE)
        record["tasks"]["PushT-v1"]["max_difference"][quantity] = "inf"
        files.write(record)
        self.expect(files, capsys, "parity.md is stale")

    def test_another_version(self, files, capsys):
        files.run()
        files.write(a_record(*CATALOGUE) | {"versions": {"mani_skill": "3.1"}})
        self.expect(files, capsys, "parity.md is stale")

    def test_a_task_that_was_never_compared(self, files, capsys):
        files.write(a_record(*sorted(CATALOGUE)[1:]))
        assert files.run() == 0
        capsys.readouterr()
        missing = min(CATALOGUE)
        self.expect(files, capsys, f"the record lacks {missing}; run `make parity`")

    def test_newer_benchmarks(self, files, capsys):
        files.run()
        report = some_benchmarks(*CATALOGUE)
        step = report.find("step")
        faster = {**step.samples, "here": [[1.9]] * len(step.values)}
        others = tuple(one for one in report.measurements if one.name != "step")
        files.write_bench(replace(report, measurements=(replace(step, samples=faster), *others)))
        self.expect(files, capsys, "parity.md is stale")

    def test_a_task_that_is_gone(self, files, capsys):
        files.write(a_record(*CATALOGUE, "Gone-v1"))
        files.run()
        self.expect(files, capsys, "the record holds Gone-v1, which no task is called")


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("# Title\n", "begin; written by .* 0 times; it needs it once"),
        (f"{BEGIN}\n", r"parity table: end -->' 0 times"),
        (f"{BEGIN}\n{END}\n{END}\n", r"parity table: end -->' 2 times"),
        (f"{END}\n{BEGIN}\n", "end -->' before '<!-- parity table: begin"),
    ],
)
def test_markers_must_be_there_once_and_in_order(text, complaint, files, capsys):
    with pytest.raises(ResultsError, match=complaint):
        with_lines(text, PARITY_TABLE, [])
    text += BENCHES
    files.page.write_text(text)
    for options in ([], ["--check"]):
        assert files.run(*options) == 2
        assert capsys.readouterr().err.startswith("error: the page has the line")
    assert files.page.read_text() == text


@pytest.mark.parametrize("text", ["", "{}", "[]", "3", '{"tasks": {}}'])
def test_a_record_that_is_none(text, files, capsys):
    files.results.write_text(text)
    with pytest.raises(ResultsError, match="`make parity` writes it"):
        read(files.results)
    assert files.run("--check") == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_a_record_that_lacks_a_figure(files, capsys):
    record = a_record("PushT-v1")
    del record["tasks"]["PushT-v1"]["steps"]
    files.write(record)
    assert files.run("--check") == 2
    assert "the record is not complete: KeyError('steps')" in capsys.readouterr().err


def test_benchmarks_that_lack_something(files, capsys):
    report = some_benchmarks(*CATALOGUE)
    files.write_bench(replace(report, measurements=report.measurements[:-1]))
    assert files.run("--check") == 2
    assert "nothing was measured of 'validation'" in capsys.readouterr().err
    files.bench.unlink()
    assert files.run("--check") == 2
    told = capsys.readouterr().err
    assert f"cannot read {files.bench}" in told
    assert "`make bench ARGS=--record` writes it" in told


def test_missing_files_are_named(files, capsys):
    files.page.unlink()
    assert files.run() == 2
    assert f"cannot read {files.page}: No such file" in capsys.readouterr().err
    files.results.unlink()
    assert files.run() == 2
    assert f"cannot read {files.results}" in capsys.readouterr().err


@pytest.mark.long
def test_the_check_needs_no_native():
    code = (
        "import sys; sys.modules['mani_skill'] = None\n"
        "from parity.__main__ import main; sys.exit(main(['tables', '--check']) == 2)"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=False)
    assert done.returncode == 0

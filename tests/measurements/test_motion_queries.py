"""The benchmark of queries: the same cells again, a record that goes on, and its table."""

import json
from pathlib import Path

import numpy as np

from measurements.motion import queries
from measurements.motion.__main__ import main
from measurements.motion.cells import FLOOR, random_cell, random_postures
from motion.cell import Cell

PAGE = Path(__file__).parents[2] / "docs/planning.md"
LINE = {"cell": 0, "query": 0, "arms": 2, "robots": ["panda", "panda"], "goal": "joints"}
SOLVED = {"solved": True, "certified": True, "collisions": 0, "clearance": 0.0123}


def test_a_seed_gives_one_cell_with_one_row_of_postures():
    layout = random_cell(1, 2)
    assert layout == random_cell(1, 2)
    assert layout != random_cell(2, 2)
    cell = Cell(layout, table=FLOOR)
    first, second = (next(random_postures(cell, (1, 2, 3), 0.01)) for _ in range(2))
    assert np.array_equal(first, second)
    assert cell.checker(clearance=0.01).free(first[None])[0]


def test_a_record_goes_on_where_it_stopped(tmp_path, capsys):
    record = tmp_path / "queries.jsonl"
    record.write_text(json.dumps(LINE | SOLVED | {"seconds": 9.0}) + "\n")
    arguments = ["queries", "--cells", "1", "--queries", "2", "--arms", "2", "--seed", "1"]
    assert main([*arguments, "--out", str(record)]) == 0
    known, asked = queries.read(record)
    assert known["seconds"] == 9.0
    assert (asked["query"], asked["solved"], asked["certified"]) == (1, True, True)
    assert capsys.readouterr().out.splitlines()[2].startswith("| 2 | 2 | 100.0% | 50.0% |")


def test_the_table_counts_every_miss():
    record = [
        LINE | SOLVED | {"seconds": 0.1},
        LINE | {"solved": False, "seconds": 0.3, "reason": "not found", "message": queries.ALONE},
        LINE | {"solved": False, "seconds": 0.1, "reason": "unreachable", "message": ""},
    ]
    row = list(queries.markdown(record))[-1]
    assert row == (
        "| 2 | 3 | 33.3% | 33.3% | 0.10 | 0.26 | 0.30 | 0.30 | 100.0% | 0 | 12.3 | 1 | 1 |"
    )


def test_the_page_is_the_records():
    shown = json.loads(PAGE.with_suffix(".json").read_text())
    assert PAGE.read_text() == "\n".join(queries.page(shown)) + "\n"


def test_a_page_shows_the_record(tmp_path):
    record = tmp_path / "queries.jsonl"
    record.write_text(json.dumps(LINE | SOLVED | {"seconds": 0.1}) + "\n")
    page = tmp_path / "page.md"
    words = ["queries", "--cells", "1", "--queries", "1", "--out", str(record), "--page", str(page)]
    assert main(words) == 0
    assert "1 queries to `motion.plan` in 1 random" in page.read_text()
    assert page.read_text().splitlines()[-1] == list(queries.markdown(queries.read(record)))[-1]

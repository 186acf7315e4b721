"""The benchmark of queries: the same cells again, a record that goes on, and its table."""

import json

import numpy as np

from measurements.motion import queries
from measurements.motion.__main__ import main
from measurements.motion.cells import FLOOR, random_cell, random_postures
from motion.cell import Cell

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


def test_the_table_tells_what_cannot_be_from_what_was_not_found():
    record = [
        LINE | SOLVED | {"seconds": 0.1},
        LINE | {"solved": False, "seconds": 0.3, "reason": "not found", "message": queries.ALONE},
        LINE | {"solved": False, "seconds": 0.1, "reason": "unreachable", "message": ""},
    ]
    row = list(queries.markdown(record))[-1]
    assert row == (
        "| 2 | 2 | 50.0% | 50.0% | 0.20 | 0.28 | 0.30 | 0.30 | 100.0% | 0 | 12.3 | 1 | 1 |"
    )

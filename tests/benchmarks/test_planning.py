"""The benchmark of planning: the same cells again, a record that goes on, and its table."""

import json

import pytest

from benchmarks import planning
from benchmarks.__main__ import main
from benchmarks.planning import (
    ALONE,
    table_of,
)

LINE = {
    "cell": 0,
    "query": 0,
    "arms": 2,
    "robots": ["panda", "panda"],
    "sources": ["catalogue", "pybullet/franka_panda/panda.urdf"],
    "goal": "joints",
}
SOLVED = {"solved": True, "certified": True, "collisions": 0, "clearance": 0.0123}
EXECUTED = {"executed": True, "touching": [], "stray": 0.0021, "late": 0.0}
REFUSED = {"solved": False, "seconds": 0.1, "message": ""}


@pytest.mark.long
def test_a_record_goes_on_where_it_stopped(tmp_path, capsys):
    record = tmp_path / "queries.jsonl"
    record.write_text(json.dumps(LINE | SOLVED | {"seconds": 9.0}) + "\n")
    arguments = ["planning", "--cells", "1", "--queries", "2", "--arms", "2", "2", "--seed", "1"]
    assert main([*arguments, "--out", str(record)]) == 0
    known, *hopeless, asked = planning.read(record)
    assert known["seconds"] == 9.0
    assert [seen["reason"] for seen in hopeless] == ["unreachable", "goal in collision"]
    assert (asked["query"], asked["solved"], asked["certified"]) == (1, True, True)
    assert (asked["executed"], asked["touching"]) == (True, [])
    assert asked["sources"] == ["catalogue", "catalogue"]
    row = capsys.readouterr().out.splitlines()[2]
    assert row.startswith("| 2 | 2 | 100.0% | 100.0% | 50.0% |")
    assert row.endswith("| 2 of 2 |")


def test_the_table_counts_every_miss():
    record = [
        LINE | SOLVED | EXECUTED | {"seconds": 0.1},
        LINE | SOLVED | EXECUTED | {"seconds": 0.1, "touching": ["a/hand, b/hand"]},
        LINE | SOLVED | {"seconds": 0.1, "executed": False, "touching": []},
        LINE | REFUSED | {"seconds": 0.3, "reason": "not found", "message": ALONE},
        LINE | REFUSED | {"reason": "unreachable"},
        LINE | REFUSED | {"reason": "cut off"},
        LINE | REFUSED | {"reason": "unreachable", "goal": "out of reach"},
        LINE | REFUSED | {"reason": "not found", "goal": "in collision"},
    ]
    row = table_of(record).splitlines()[-1]
    assert row == (
        "| 2 | 5 | 60.0% | 75.0% | 60.0% | 0.10 | 0.22 | 0.29 | 0.30 | 100.0% | 0 | 12.3"
        " | 2 of 3 | 1 | 2.1 | 1 | 1 | 1 | 1 of 2 |"
    )

"""The benchmark of planning: the same cells again, a record that goes on, and its table."""

import json

import numpy as np
import pytest

from benchmarks import planning
from benchmarks.__main__ import main
from benchmarks.planning import (
    ALONE,
    Place,
    table_of,
)
from layouts import face_to_face
from robot_layouts.motion import Motion

LEANING = np.array([0, 0.9, 0, 0.6, 0, 0, 0, 0, 0])  # rad; of a Panda, from its start
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


def test_a_motion_on_which_robots_meet_is_seen_to_touch(monkeypatch):
    layout = face_to_face({"left": "panda", "right": "panda"}, spacing=1.35)
    monkeypatch.setattr(planning, "random_cell", lambda *_: layout)
    place = Place(0, 2, ())
    ahead = {name: p.start_qpos + LEANING for name, p in layout.items()}
    times, share = np.array([0.0, 1.0]), np.array([0.0, 1.0])[:, None]
    meeting = {n: p.start_qpos + share * (ahead[n] - p.start_qpos) for n, p in layout.items()}
    still = {n: np.zeros((2, p.robot.dof)) for n, p in layout.items()}
    seen = place.carry_out(Motion(layout, times, meeting, still))
    assert {"left", "right"} == {part.split(".")[0] for part in seen["touching"][0].split(", ")}
    begun = {n: np.tile(p.start_qpos, (2, 1)) for n, p in layout.items()}
    seen = place.carry_out(Motion(layout, times, begun, still))
    assert (seen["executed"], seen["touching"]) == (True, [])
    assert seen["stray"] < 0.01
    place.task.close()


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

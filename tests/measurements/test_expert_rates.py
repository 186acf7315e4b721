"""``python -m measurements.experts``: experts of several robots, and how often they succeed."""

from __future__ import annotations

import json
from pathlib import Path

from measurements.experts.__main__ import main
from measurements.experts.cells import TASKS
from measurements.experts.table import markdown

RECORD = Path(__file__).parents[2] / "docs/experts.json"


def test_the_page_is_the_records():
    seen = json.loads(RECORD.read_text())
    assert list(seen["tasks"]) == list(TASKS)
    assert RECORD.with_suffix(".md").read_text() == "\n".join(markdown(seen)) + "\n"


def test_what_the_page_promises():
    for task_id, seen in json.loads(RECORD.read_text())["tasks"].items():
        others = [other for other in seen["others"].values() if "layout" in other]
        elsewhere = [episode for other in others for episode in other["episodes"].values()]
        own = [*seen["own"].values()]
        assert (len(others), len(own), len(elsewhere)) == (10, 100, 100), task_id
        assert sum(episode["success"] for episode in own) >= 0.98 * len(own), task_id
        assert sum(episode["success"] for episode in elsewhere) >= 0.95 * len(elsewhere), task_id
        assert not any(episode["touching"] for episode in own + elsewhere), task_id


def test_what_is_no_record_is_left_alone(tmp_path, capsys):
    out = tmp_path / "seen.json"
    out.write_text("[]")
    assert main(["--out", str(out), "--table"]) == 1
    assert "holds no record of experts" in capsys.readouterr().err
    assert out.read_text() == "[]"

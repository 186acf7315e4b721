"""``python -m measurements.conversions``: recordings in other control modes, counted."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from measurements.conversions import main, markdown
from tasks import list_clones

RECORD = Path(__file__).parents[2] / "docs" / "conversions.json"


@pytest.mark.long
def test_what_is_kept_is_counted(tmp_path, capsys):
    out = tmp_path / "seen.json"
    words = ["--tasks", "PickCube-v1", "--modes", "pd_ee_pose", "--episodes", "1"]
    words += ["--work", str(tmp_path), "--out", str(out)]
    assert main(words) == 0
    seen = json.loads(out.read_text())["tasks"]["PickCube-v1"]
    assert seen["modes"]["pd_ee_pose"] == {"tried": 1, "kept": 1, "lost": [], "length": 1.0}
    assert 0 < seen["turn"] < 90
    assert "| `PickCube-v1` |" in out.with_suffix(".md").read_text()
    before = (tmp_path / "PickCube-v1" / "pd_ee_pose" / "trajectory.h5").stat().st_mtime_ns
    assert main(words) == 0  # nothing is done twice
    after = (tmp_path / "PickCube-v1" / "pd_ee_pose" / "trajectory.h5").stat().st_mtime_ns
    assert before == after
    out.write_text("[]")
    assert main(words) == 1
    assert "holds no record of conversions" in capsys.readouterr().err


def test_the_page_is_the_records():
    found = json.loads(RECORD.read_text())
    assert list(found["tasks"]) == sorted(list_clones())
    assert RECORD.with_suffix(".md").read_text() == "\n".join(markdown(found)) + "\n"

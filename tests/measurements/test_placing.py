"""``python -m measurements.placing``: the search for places, beside a ring."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from measurements.placing import CELLS, main, markdown, targets_of

RECORD = Path(__file__).parents[2] / "docs/placing.json"


@pytest.mark.long
def test_a_cell_is_measured_in_both_ways(tmp_path, capsys):
    out = tmp_path / "seen.json"
    words = ["--cells", "three small arms", "--out", str(out), "--pictures", str(tmp_path)]
    assert main(words) == 0
    cell = json.loads(out.read_text())["cells"]["three small arms"]
    assert cell["search"]["clear"]
    assert cell["search"]["reached"] == 12
    assert cell["search"]["shared"] > cell["ring"]["shared"]
    assert "| three small arms |" in out.with_suffix(".md").read_text()
    assert len(list(tmp_path.glob("three_small_arms_*.png"))) == 2
    before = out.read_text()
    assert main(words) == 0  # nothing is done twice
    assert out.read_text() == before
    out.write_text("[]")
    assert main(words) == 1
    assert "holds no record of places" in capsys.readouterr().err


def test_targets_are_twelve_places_that_differ():
    for robots in CELLS.values():
        targets = targets_of(robots)
        assert len(set(targets)) == 12
        assert all(z > 0 for _, _, z in targets)


def test_the_page_is_the_records():
    seen = json.loads(RECORD.read_text())
    assert list(seen["cells"]) == list(CELLS)
    assert RECORD.with_suffix(".md").read_text() == "\n".join(markdown(seen)) + "\n"


def test_what_the_page_promises():
    for name, cell in json.loads(RECORD.read_text())["cells"].items():
        assert cell["search"]["clear"], name
        assert cell["search"]["reached"] == 12, name
        assert cell["search"]["shared"] >= 1.3 * cell["ring"]["shared"], name
        assert cell["search"]["clearance"] >= 0.1, name

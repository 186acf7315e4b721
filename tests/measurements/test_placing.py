"""``python -m measurements.placing``: the search for places, beside a ring."""

from __future__ import annotations

import json

import pytest

from measurements.placing import CELLS, main, targets_of


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


def test_targets_are_twelve_places_that_differ():
    for robots in CELLS.values():
        targets = targets_of(robots)
        assert len(set(targets)) == 12
        assert all(z > 0 for _, _, z in targets)

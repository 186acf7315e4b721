"""The benchmark of collision checks answers like FCL alone before it measures anything."""

import numpy as np
import pytest

from measurements import motion_checks

FEW = "4 Pandas, close, table"


@pytest.fixture
def few(monkeypatch):
    monkeypatch.setattr(motion_checks, "CELLS", {FEW: motion_checks.CELLS[FEW]})


@pytest.mark.usefixtures("few")
def test_both_tables_have_a_row_for_each_cell(capsys):
    assert motion_checks.main(["--states", "24", "--edges", "1"]) == 0
    rows = [line for line in capsys.readouterr().out.splitlines() if line.startswith(f"| {FEW}")]
    states, edges = ([cell.strip() for cell in row.strip("|").split("|")] for row in rows)
    assert len(states) == 8
    assert int(states[1]) > 2000
    assert len(edges) == 6
    assert int(edges[3]) > 5 * int(edges[1]) > 50  # ten times as many steps, or nearly so


@pytest.mark.usefixtures("few")
def test_a_wrong_answer_is_no_measurement(monkeypatch):
    wrong = motion_checks.FclAlone.free
    monkeypatch.setattr(motion_checks.FclAlone, "free", lambda self, q: ~wrong(self, q))
    with pytest.raises(AssertionError, match="FCL alone answers otherwise"):
        list(motion_checks.report(8, 1))


def test_states_are_the_same_every_time_and_within_the_limits():
    cell = motion_checks.CELLS["2 Pandas"]()
    states = motion_checks.random_states(cell, 5)
    assert states.tobytes() == motion_checks.random_states(cell, 5).tobytes()
    assert ((states >= cell.limits[:, 0]) & (states <= cell.limits[:, 1])).all()
    assert np.ptp(states, axis=0).min() > 0

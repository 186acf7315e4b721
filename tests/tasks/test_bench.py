"""What a step costs with more robots: no more than in proportion."""

import pytest

from tasks.__main__ import main
from tasks.bench import MOST_ROBOTS, crowd, measure


def test_the_table_has_a_row_for_each_number(capsys):
    options = ("--robots", "1", "3", "--kinds", "panda", "so100", "--blocks", "1")
    assert main(["bench", *options]) == 0
    rows = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert [row[0] for row in rows if row and row[0].isdigit()] == ["1", "3"]


def test_kinds_take_turns():
    layout = crowd(3, ("panda", "so100"))
    assert [placement.robot.name for placement in layout.values()] == ["panda", "so100", "panda"]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--robots", "0"), "--robots 0: it takes numbers from 1 to 8"),
        (("--robots", "1", "9"), "--robots 9: it takes"),
        (("--blocks", "0"), "--blocks is 0; it must be 1 or more"),
    ],
)
def test_other_numbers_are_refused(options, message, capsys):
    assert main(["bench", *options]) == 1
    assert message in capsys.readouterr().err


@pytest.mark.long
def test_a_step_costs_no_more_than_in_proportion():
    one, *others, most = measure((1, 4, MOST_ROBOTS), ("panda",), blocks=10)
    assert others
    for cost in (*others, most):
        assert cost.step <= 1.1 * one.step * cost.robots

"""Limbs in a layout: arms by their full or short names, and whose action numbers are whose."""

from __future__ import annotations

from math import pi

import pytest

from layouts import Layout, Placement
from robots import UnknownNameError

CELL = Layout({"cell": Placement("mobile_panda_dual", position=(1.0, 0.0, 0.0), rpy=(0, 0, pi))})
MIXED = Layout(
    {
        "cell": Placement("mobile_panda_dual"),
        "left": Placement("panda_stick", position=(2.0, 0.0, 0.0)),
    }
)


def test_every_limb_has_its_slice():
    assert CELL.action_split == {
        "cell.left": slice(0, 8),
        "cell.right": slice(8, 16),
        "cell.body": slice(16, 17),
    }
    assert CELL.robot_actions == {"cell": slice(0, 17)}
    assert list(MIXED.action_split) == ["cell.left", "cell.right", "cell.body", "left"]
    assert MIXED.action_split["left"] == slice(17, 24)


def test_arms_are_what_has_a_tool():
    assert list(CELL.arms) == ["cell.left", "cell.right"]
    assert list(MIXED.arms) == ["cell.left", "cell.right", "left"]


def test_a_limb_stands_where_it_begins():
    x, y, z = CELL.arms["cell.left"].base_position
    assert (x, y, z) == pytest.approx((1.0 - 0.0808, -0.3012, 0.42))
    assert CELL.arm("left").facing == CELL["cell"].facing
    assert CELL.arm("left").robot.reach == 0.947


def test_a_limb_goes_by_its_own_name_unless_another_does():
    assert CELL.short_names == {"left": "cell.left", "right": "cell.right"}
    assert CELL.arm("right") == CELL.arm("cell.right")
    assert MIXED.short_names == {"right": "cell.right"}
    assert MIXED.arm("left").robot.name == "panda_stick"
    assert MIXED.owner("right") == "cell"
    twice = Layout({**CELL, "other": Placement("mobile_panda_dual", position=(3.0, 0.0, 0.0))})
    assert not twice.short_names


def test_a_whole_robot_is_an_arm_too():
    assert CELL.arm("cell") is CELL["cell"]
    assert CELL.owner("cell") == "cell"


def test_an_unknown_arm_names_those_that_there_are():
    with pytest.raises(
        UnknownNameError, match=r"'lefft'. Did you mean 'left'. Choices: cell.left, cell.right"
    ):
        CELL.arm("lefft")


def test_the_table_lists_limbs():
    lines = str(CELL).splitlines()
    assert lines[0] == "1 robot, 17 action numbers"
    assert [line.split()[1] for line in lines[2:]] == ["cell.left", "cell.right", "cell.body"]
    assert "8:16" in lines[3]


def test_targets_are_reached_by_limbs():
    layout = Layout({"cell": Placement("mobile_panda_dual", position=(0.0, 0.0, 0.0))})
    left, right = (0.6, 0.6, 0.5), (0.6, -0.6, 0.5)
    report = layout.validate(targets={"l": left, "r": right}, workspaces=True)
    reached = {(reach.target, reach.robot) for reach in report.reaches if reach.reached}
    assert {("l", "cell.left"), ("r", "cell.right")} <= reached
    assert [space.robots for space in report.shared] == [("cell.left", "cell.right")]

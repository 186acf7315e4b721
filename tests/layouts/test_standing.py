"""Other robots at a task's places, without its files."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from layouts import Layout, Placement, at_task, face_to_face, single
from robots import LayoutError, RobotRegistry, UnknownNameError

TWO = face_to_face({"left": "panda", "right": "panda"}, spacing=1.5)
BAXTER = RobotRegistry.load("baxter")


def test_the_robots_of_the_task_stay_where_they_are():
    assert at_task("panda", TWO) == TWO
    assert at_task({"right": "panda"}, TWO) == TWO


def test_a_shorter_arm_stands_nearer():
    layout = at_task({"left": "so100"}, TWO)
    assert layout["right"] == TWO["right"]
    share = RobotRegistry.load("so100").reach / RobotRegistry.load("panda").reach
    np.testing.assert_allclose(layout["left"].base_position, (0, -0.75 * share, 0), atol=1e-4)
    np.testing.assert_allclose(layout["left"].facing, TWO["left"].facing, atol=1e-9)
    alone = single({"arm": Placement("panda", (-0.615, 0.0, 0.0)).robot})
    at = Layout({"arm": replace(alone["arm"], position=(-0.615, 0.0, 0.0))})
    x, y, _ = at_task("so100", at)["arm"].base_position
    assert (round(x, 2), y) == (-round(0.72 * RobotRegistry.load("so100").reach, 2), 0.0)


def test_the_arms_of_one_body_serve_the_roles_called_like_them():
    """About where people have put it by hand: 0.7 m behind the middle, 0.2 m up."""
    layout = at_task(BAXTER, TWO)
    (placement,) = layout.values()
    np.testing.assert_allclose(placement.base_position, (0.7, 0.0, 0.2), atol=0.05)
    assert placement.robot == BAXTER
    assert layout.arm("left").base_position[1] < 0 < layout.arm("right").base_position[1]


def test_limbs_of_other_names_are_called_like_the_roles():
    one = {"a": BAXTER.limbs["left"], "b": BAXTER.limbs["right"]}
    groups = {"a": "left", "b": "right"}
    limbs = {
        name: replace(limb, groups=(f"{groups[name]}_arm", f"{groups[name]}_gripper"))
        for name, limb in one.items()
    }
    robot = at_task(replace(BAXTER, limbs=limbs), TWO)["robot"].robot
    assert robot.limbs["left"].tcp_link == "left_gripper"
    assert robot.parts["right"].action_split == BAXTER.parts["right"].action_split


def test_what_does_not_fit_is_refused():
    three = Layout({**TWO, "third": Placement("panda", (1.0, 0.0, 0.0))})
    with pytest.raises(LayoutError, match=r"baxter has 2 limbs \(left, right\), and the task 3"):
        at_task(BAXTER, three)
    with pytest.raises(UnknownNameError, match="unknown place 'lef'. Did you mean 'left'"):
        at_task({"lef": "panda"}, TWO)
    with pytest.raises(LayoutError, match="task is 'PickCube-v1'; a task, its class or a Layout"):
        at_task("panda", "PickCube-v1")

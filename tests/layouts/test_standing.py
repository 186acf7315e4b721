"""Other robots at a task's places."""

from __future__ import annotations

from dataclasses import replace
from typing import NoReturn

import numpy as np
import pytest

from layouts import Layout, Placement, around_table, at_task, face_to_face, ring, single
from layouts.frames import Frame
from layouts.ready import drawn_back
from layouts.shared_place import SHARES_DOWN, working_reaches
from robots import AssetError, LayoutError, RobotRegistry, UnknownNameError
from robots.assets.locator import UrdfLocator

TWO = face_to_face({"left": "panda", "right": "panda"}, spacing=1.5)
DUAL = RobotRegistry.load("mobile_panda_dual")


@pytest.fixture(scope="module")
def ready():
    """Where the body stands whose arms serve both roles."""
    return at_task(DUAL, TWO)


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


def test_what_the_roles_do_is_in_reach_of_the_one_that_reaches_least():
    """The UR10 of a ring stands no farther from its middle than the Panda that reaches less."""
    two = ring({"far": "ur10", "near": "panda"}, radius=0.8)
    placed = at_task(dict.fromkeys(two, "so101"), two)
    distances = {name: abs(complex(*p.base_position[:2])) for name, p in placed.items()}
    assert distances["far"] == pytest.approx(distances["near"])
    assert distances["near"] == pytest.approx(0.8 * 0.48 / 0.855, abs=1e-3)


def test_a_shorter_arm_stands_nearer_where_its_place_needs_a_longer_one():
    """What a UR10 does beyond the middle, an arm that reaches less does from nearer."""
    two = ring({"far": "ur10", "near": "panda"}, radius=0.8)
    placed = at_task({"far": "panda"}, two, needed={"far": 1.1})
    assert abs(complex(*placed["far"].base_position[:2])) == pytest.approx(
        0.8 * 0.855 / 1.1, abs=1e-3
    )
    assert placed["near"] == two["near"]


def test_where_all_reach_farther_a_large_arm_of_the_task_stands_farther_too():
    three = ring({"far": "ur10", "near": "panda", "other": "panda"}, radius=0.8)
    placed = at_task({"near": "ur10", "other": "ur10"}, three)
    distances = {abs(complex(*p.base_position[:2])) for p in placed.values()}
    np.testing.assert_allclose(sorted(distances), 0.8 * 1.343 / 0.855, atol=1e-3)
    assert at_task({"near": "ur10"}, three)["far"] == three["far"]


def test_an_arm_that_holds_things_stands_where_it_reaches_them_with_its_gripper_down():
    """An SO-101 reaches 0.48 m, but only about two thirds of that far down to the ground."""
    three = ring(dict.fromkeys(("a", "b", "c"), "panda"), radius=1.5)
    placed = at_task({"a": "so101"}, three, holding=["a"])
    share = 0.65 * 0.48 / (0.9 * 0.855)
    assert abs(complex(*placed["a"].base_position[:2])) == pytest.approx(1.5 * share, abs=1e-3)
    assert placed["b"] == three["b"]


def test_a_larger_arm_that_holds_things_stands_no_farther_while_the_other_one_stays():
    """A Panda gets less far with its gripper down than it reaches, and its neighbour holds none."""
    layout = at_task({"left": "ur10"}, TWO, holding=["left"])
    assert layout["left"].base_position[:2] == TWO["left"].base_position[:2]


def test_wheels_count_as_far_as_they_reach_down_with_their_torso_lowered():
    """A Fetch reaches 1.13 m, and down to what lies on the ground 0.65 of that; a Panda 0.77 m."""
    layout = at_task({"left": "fetch"}, TWO, holding=["left"])
    x, y, _ = layout["left"].base_position
    assert (x, y) == pytest.approx((0.0, -0.75 * 0.65 * 1.13 / (0.9 * 0.855)), abs=1e-3)
    joints = dict(zip(layout["left"].robot.joints, layout["left"].start_qpos, strict=True))
    assert joints["torso_lift_joint"] == 0.0


def test_arms_that_would_start_inside_each_other_draw_their_hands_back():
    small = dict.fromkeys(("a", "b", "c"), "so101")
    three = ring(dict.fromkeys(small, "panda"), radius=0.75)
    placed = at_task(small, three, holding=list(small))
    share = 0.65 * 0.48 / (0.9 * 0.855)
    assert abs(complex(*placed["a"].base_position[:2])) == pytest.approx(0.75 * share, abs=1e-3)
    assert placed["a"].qpos is not None
    assert not [f for f in placed.validate(workspaces=False).findings if f.serious]


def test_an_arm_on_a_torso_draws_its_hand_back():
    drawn = drawn_back(single({"arm": "fetch"})["arm"], (1.5, 0.0))
    assert drawn.qpos is not None
    report = Layout({"arm": drawn}).validate(workspaces=False)
    assert not [f for f in report.findings if f.serious and f.kind == "collision"]


def test_how_far_robots_of_tasks_reach_down_is_as_their_files_say(monkeypatch):
    known = dict(SHARES_DOWN)
    monkeypatch.setattr("layouts.shared_place.SHARES_DOWN", {})
    for robot, share in known.items():
        layout = single({"arm": robot})
        assert working_reaches(layout, ["arm"], ["arm"]) == [share * layout["arm"].robot.reach]
        assert working_reaches(layout, ["arm"], []) == [layout["arm"].robot.reach]


def test_the_arms_of_one_body_serve_the_roles_called_like_them(ready):
    (placement,) = ready.values()
    assert placement.robot == DUAL
    np.testing.assert_allclose(placement.base_position, (0.56, 0.0, -0.04), atol=0.01)
    assert ready.arm("left").base_position[1] < 0 < ready.arm("right").base_position[1]


def test_limbs_of_other_names_are_called_like_the_roles():
    one = {"a": DUAL.limbs["left"], "b": DUAL.limbs["right"]}
    groups = {"a": "left", "b": "right"}
    limbs = {
        name: replace(limb, groups=(f"{groups[name]}_arm", f"{groups[name]}_gripper"))
        for name, limb in one.items()
    }
    robot = at_task(replace(DUAL, limbs=limbs), TWO)["robot"].robot
    assert robot.limbs["left"].tcp_link == "left_panda_hand_tcp"
    assert robot.parts["right"].action_split == DUAL.parts["right"].action_split


def test_a_body_whose_files_are_missing_is_put_by_reach_alone(ready, monkeypatch):
    def missing(*_: object, **__: object) -> NoReturn:
        raise AssetError("no files")

    monkeypatch.setattr(UrdfLocator, "locate", missing)
    alone = at_task(DUAL, TWO)["robot"]
    monkeypatch.undo()
    assert alone == replace(ready["robot"], qpos=None)
    assert ready["robot"].start_qpos != alone.start_qpos


def test_a_place_may_be_declared_by_angles():
    turned = Layout({"arm": Placement("panda", (-0.6, 0.2, 0.0), rpy=(0.0, 0.0, -0.3))})
    at = at_task("ur5", turned)["arm"]
    np.testing.assert_allclose(at.facing, turned["arm"].facing, atol=1e-9)


def test_wheels_stand_on_an_edge_of_a_table_as_well():
    edges = around_table({"a": "panda", "b": "panda"}, edges=("north", "west"), table=(1.8, 1.7))
    at = at_task({"b": "fetch"}, edges)["b"]
    assert at.on == "table.west"
    assert at.base_position[2] == pytest.approx(0.005, abs=2e-3)


def test_small_arms_on_edges_of_a_table_stand_nearer_to_its_middle():
    """Also where they all stand on one side of it."""
    edges = around_table({"a": "panda", "b": "panda"}, edges=("west", "west"), table=(1.8, 1.7))
    share = RobotRegistry.load("so101").reach / RobotRegistry.load("panda").reach
    for name, placement in at_task("so101", edges).items():
        assert placement.on == edges[name].on
        own = np.array(edges[name].base_position)
        np.testing.assert_allclose(placement.base_position, share * own, atol=2e-4)
    assert at_task("panda_wristcam", edges)["a"].base_pose == edges["a"].base_pose


def test_robots_on_a_frame_that_is_no_table_stay_on_it():
    wall = {"wall": Frame((-0.8, 0.0, 0.0))}
    places = {n: Placement("panda", (0.0, y, 0.4), on="wall") for n, y in (("a", 0.3), ("b", -0.3))}
    for name, placement in at_task("so101", Layout(places, wall)).items():
        assert placement.base_position == Layout(places, wall)[name].base_position


def test_what_does_not_fit_is_refused():
    three = Layout({**TWO, "third": Placement("panda", (1.0, 0.0, 0.0))})
    with pytest.raises(
        LayoutError, match=r"mobile_panda_dual has 2 limbs \(left, right\), and the task 3"
    ):
        at_task(DUAL, three)
    with pytest.raises(
        UnknownNameError, match="unknown robot of this layout 'lef'. Did you mean 'left'"
    ):
        at_task({"lef": "panda"}, TWO)
    with pytest.raises(LayoutError, match="task is 'PickCube-v1'; a task, its class or a Layout"):
        at_task("panda", "PickCube-v1")

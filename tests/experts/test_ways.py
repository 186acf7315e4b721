"""Arms go round what is in their way, or wait until it is gone."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pytest

import tasks
from layouts import Layout, Placement
from robot_layouts.experts import first_success
from robot_layouts.experts.cells.tips import sweep
from robot_layouts.experts.geometry import gripper_facing
from robot_layouts.experts.rehearsal import Rehearsal
from robot_layouts.experts.script import CLOSED, Pose, Scene, Waypoint
from robot_layouts.experts.tips import pose_solver
from robot_layouts.experts.ways import NoWayError, Ways

HALF_PI = np.pi / 2
TIP = np.array([0.0, 0.05, 0.1])  # from a tap (m)
MIDDLE = np.array([0.0, 0.0, 0.3])


@pytest.fixture(scope="module")
def two_arms() -> Rehearsal:
    return Rehearsal(tasks.make("TwoRobotPickCube-v1"))


def at(place: np.ndarray, facing: float = HALF_PI) -> object:
    def poses(scene: Scene) -> list[Pose]:
        return [(place, gripper_facing(facing, 0.0))]

    return poses


def crossing() -> dict[str, tuple[Waypoint, ...]]:
    """The left arm stands in the middle; the right one goes from one side of it to the other."""
    sides = [np.array([x, 0.05, 0.3]) for x in (-0.25, 0.25)]
    return {
        "left": (Waypoint("stand", at(MIDDLE), CLOSED),),
        "right": (
            Waypoint("one side", at(sides[0], -HALF_PI), CLOSED),
            Waypoint("other side", at(sides[1], -HALF_PI), CLOSED, after=("left.stand",)),
        ),
    }


def test_an_arm_goes_round_another_one_the_same_way_every_time(two_arms: Rehearsal):
    two_arms.begin(0)
    straight = two_arms.play(crossing())
    assert straight.obstructed
    assert " touches " in straight.reason
    plays = []
    for _ in range(2):
        two_arms.begin(0)
        plays.append(two_arms.play(crossing(), around=True))
        np.testing.assert_allclose(two_arms.scene().tcp("right")[0], [0.25, 0.05, 0.3], atol=0.02)
    around, again = plays
    assert around.reason == "the episode ended at left.stand, right.other side"
    np.testing.assert_array_equal(around.actions, again.actions)


def test_a_way_round_is_done_at_its_end(two_arms: Rehearsal):
    begun: list[float] = []

    def up(scene: Scene) -> list[Pose]:
        place, quaternion = scene.tcp("right")
        begun.append(place[0])
        return [(place + (0.0, 0.0, 0.05), quaternion)]

    script = crossing()
    one_side, other_side = script["right"]
    right = (one_side, replace(other_side, near=0.3), Waypoint("up", up, CLOSED))
    two_arms.begin(0)
    two_arms.play(script | {"right": right}, around=True)
    assert begun[0] > 0.05


@pytest.mark.long
def test_an_arm_waits_until_its_place_is_free(two_arms: Rehearsal):
    """The left one leaves the middle after 50 steps; until then the right one stays away."""
    script = {
        "left": (
            Waypoint("stand", at(MIDDLE), CLOSED, steps=50),
            Waypoint("leave", at(np.array([0.0, -0.4, 0.4])), CLOSED),
        ),
        "right": (
            Waypoint("ready", at(np.array([0.0, 0.35, 0.4]), -HALF_PI), CLOSED),
            Waypoint("middle", at(MIDDLE, -HALF_PI), CLOSED),
        ),
    }
    two_arms.begin(0)
    assert " touches " in two_arms.play(script).reason
    two_arms.begin(0)
    attempt = two_arms.play(script, around=True)
    assert attempt.reason == "the episode ended at left.leave, right.middle"
    np.testing.assert_allclose(two_arms.scene().tcp("right")[0], MIDDLE, atol=0.02)


def test_where_another_arm_stays_no_way_leads(two_arms: Rehearsal):
    two_arms.begin(0)
    two_arms.play({"left": (Waypoint("stand", at(MIDDLE), CLOSED),)})
    scene = two_arms.scene()
    goals = pose_solver(two_arms.task, "right").solutions(
        MIDDLE, gripper_facing(-HALF_PI, 0.0), scene.qpos("right")
    )
    with pytest.raises(NoWayError, match=r"left/\S+ and right/\S+ overlap by .* at its end"):
        Ways(two_arms.task).find("right", goals, scene, {})


def test_bodies_are_in_the_way_unless_the_hand_is_at_them():
    rehearsal = Rehearsal(tasks.make("PickCube-v1"))
    cube = rehearsal.begin(0).body("cube")[0]
    beside = [cube + (x, 0.0, 0.0) for x in (-0.12, 0.12)]
    rehearsal.play({"arm": (Waypoint("beside", at(beside[0], 0.0), CLOSED),)})
    scene, solver = rehearsal.scene(), pose_solver(rehearsal.task, "arm")

    def way_to(place: np.ndarray) -> np.ndarray:
        goals = solver.solutions(place, gripper_facing(0.0, 0.0), scene.qpos("arm"))
        return Ways(rehearsal.task).find("arm", goals, scene, {})

    assert len(way_to(cube)) == 1
    assert len(way_to(beside[1])) > 1


def test_only_what_moves_on_is_waited_for(two_arms: Rehearsal):
    two_arms.begin(0)
    two_arms.play({"left": (Waypoint("stand", at(MIDDLE), CLOSED),)})
    scene, solver = two_arms.scene(), pose_solver(two_arms.task, "right")
    below = np.array([0.0, 0.3, -0.1])
    stays = {}
    for name, place in (("arm", MIDDLE), ("table", below)):
        goals = solver.solutions(place, gripper_facing(-HALF_PI, 0.0), scene.qpos("right"))
        with pytest.raises(NoWayError) as refusal:
            Ways(two_arms.task).find("right", goals, scene, {})
        stays[name] = refusal.value.stays
    assert stays == {"arm": False, "table": True}


def test_a_place_in_the_table_is_waited_for_as_it_may_move(two_arms: Rehearsal):
    def up_once_left_is_there(scene: Scene) -> list[Pose]:
        there = np.linalg.norm(scene.tcp("left")[0] - MIDDLE) < 0.05
        return [(np.array([0.0, 0.35, 0.4 if there else -0.1]), gripper_facing(-HALF_PI, 0.0))]

    script = crossing() | {"right": (Waypoint("place", up_once_left_is_there, CLOSED),)}
    two_arms.begin(0)
    assert two_arms.play(script, around=True, until="right.place").success


def test_a_hand_may_not_reach_into_the_table():
    """It may touch the cube that it is at."""
    rehearsal = Rehearsal(tasks.make("PickCube-v1"))
    cube = rehearsal.begin(0).body("cube")[0]
    rehearsal.play({"arm": (Waypoint("over", at(cube + (0.0, 0.0, 0.03), 0.0), CLOSED),)})
    scene, solver = rehearsal.scene(), pose_solver(rehearsal.task, "arm")
    turned = gripper_facing(0.0, 0.0)
    low = solver.solutions(cube - (0.0, 0.0, 0.03), turned, scene.qpos("arm"))
    with pytest.raises(
        NoWayError, match=r"finger and the table-workspace overlap by .* at its end"
    ):
        Ways(rehearsal.task).find("arm", low, scene, {})
    at_cube = solver.solutions(cube, turned, scene.qpos("arm"))
    assert len(Ways(rehearsal.task).find("arm", at_cube, scene, {})) == 1


def test_an_arm_looks_all_round_for_a_posture_that_is_free():
    """From where it starts, this UR10's inverse kinematics finds its elbow in the table."""
    places = {
        "first": ("ur10", -0.274, -0.82, -3.142),
        "second": ("panda_stick", 0.767, 0.298, -2.436),
        "third": ("xarm7", -0.162, 0.79, -1.171),
        "fourth": ("panda", -0.74, 0.472, -1.385),
    }
    layout = Layout(
        {
            arm: Placement(robot, (x, y, 0.0), rpy=(0.0, 0.0, yaw))
            for arm, (robot, x, y, yaw) in places.items()
        }
    )
    rehearsal = Rehearsal(tasks.make("CellTurnTaps-v1", layout=layout))
    tap, _ = rehearsal.begin(1).body("tap_first")
    over, *_ = sweep(rehearsal.task, "first", "tap_first", lambda scene, share: tap + TIP)
    assert "is blocked" in rehearsal.play({"first": (over,)}).reason
    rehearsal.begin(1)
    assert rehearsal.play({"first": (over,)}, around=True, until=f"first.{over.name}").success


def test_without_the_extra_the_reason_says_so(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "ompl", None)
    task = tasks.make("TwoRobotPickCube-v1")
    plan = first_success(task, 0, lambda scene: [crossing()])
    assert " touches " in plan.reason
    assert "no way round was sought: planning needs OMPL" in plan.reason

"""Experts of single tasks: with which robots they go, how they grip, and what they refuse."""

from dataclasses import replace

import numpy as np
import pytest

import tasks
from layouts import Layout, Placement
from robot_layouts.experts import find_expert
from robot_layouts.experts.grasps import cube_grips, held_at
from robot_layouts.experts.maniskill import push_t
from robot_layouts.experts.rehearsal import Rehearsal
from robot_layouts.experts.script import Waypoint
from robot_layouts.kinematics.rotations import rotate
from robots import RobotRegistry, TaskError
from tasks.episode import play
from tests.data.expert_plays import task

pytestmark = pytest.mark.xdist_group("experts")  # they share plans

GRIPPING = (
    *("LiftPegUpright-v1", "PegInsertionSide-v1", "PickCube-v1", "PlaceSphere-v1"),
    *("PlugCharger-v1", "PokeCube-v1", "PullCubeTool-v1", "StackCube-v1", "StackPyramid-v1"),
)


@pytest.mark.parametrize(
    ("task_id", "place"),
    [
        ("PickCubeSO100-v1", "arm"),
        ("TwoRobotPickCube-v1", "right"),
        ("TwoRobotStackCube-v1", "left"),
        *((name, "arm") for name in GRIPPING),
    ],
)
def test_an_arm_without_fingers_is_an_error(task_id, place):
    env = tasks.make(task_id, robots={place: "panda_stick"})
    with pytest.raises(TaskError, match=f"needs fingers on .*'{place}' is a panda_stick, which"):
        find_expert(task_id)(env, 0)


def test_fingers_that_go_through_things_are_an_error():
    panda = RobotRegistry.load("panda")
    links = ("panda_leftfinger", "panda_hand_tcp")  # a frame, which has no shape
    ghost = replace(panda, fingers=replace(panda.fingers, links=links))
    env = tasks.make("PickCube-v1", robots={"arm": ghost})
    with pytest.raises(TaskError, match="panda_hand_tcp of 'arm' go through .* no <collision>"):
        find_expert("PickCube-v1")(env, 0)


def test_jaws_that_do_not_roll_are_an_error():
    env = tasks.make("PickCubeSO100-v1", robots={"arm": "panda"})
    with pytest.raises(TaskError, match="jaws that roll about 'wrist_roll'; 'arm' is a panda"):
        find_expert("PickCubeSO100-v1")(env, 0)


@pytest.mark.parametrize(
    "name", ["DrawTriangle-v1", "PullCube-v1", "PushCube-v1", "RollBall-v1", *GRIPPING]
)
def test_an_arm_too_far_away_is_an_error(name):
    robot = task(name).layout["arm"].robot.name
    env = tasks.make(name, layout=Layout({"arm": Placement(robot, position=(-3.0, 0.0, 0.0))}))
    with pytest.raises(TaskError, match=r"^no plan: arm\.above.* is out"):
        find_expert(name)(env, 0)


def test_a_stick_too_far_away_is_an_error(monkeypatch):
    monkeypatch.setattr(push_t, "ATTEMPTS", 1)
    away = Layout({"arm": Placement("panda_stick", position=(-3.0, 0.0, 0.0))})
    with pytest.raises(TaskError, match="^no plan: the T is out of reach"):
        find_expert("PushT-v1")(tasks.make("PushT-v1", layout=away), 0)


@pytest.mark.parametrize(
    ("name", "robot"),
    [
        *((name, "panda_stick") for name in ("PushCube-v1", "PullCube-v1", "RollBall-v1")),
        ("RollBall-v1", "panda_wristcam"),
        *((name, "panda") for name in ("PegInsertionSide-v1", "PlugCharger-v1")),
    ],
)
def test_other_robots_solve_it_as_well(name, robot):
    env = tasks.make(name, robots={"arm": robot})
    assert play(env, 0, find_expert(name)(env, 0)).solved


@pytest.mark.long
def test_arms_from_one_side_make_room_for_each_other():
    """Both come from behind the cubes; the one that waits would stand where the other one goes."""
    at = {"left": ((-0.225, -0.556, 0.0), 0.08), "right": ((-0.446, 0.194, 0.0), 0.44)}
    robot = RobotRegistry.load("panda_wristcam")
    layout = Layout(
        {name: Placement(robot, position=p, rpy=(0.0, 0.0, yaw)) for name, (p, yaw) in at.items()}
    )
    env = tasks.make("TwoRobotStackCube-v1", layout=layout)
    assert play(env, 0, find_expert("TwoRobotStackCube-v1")(env, 0)).solved


@pytest.fixture(scope="module")
def rehearsal() -> Rehearsal:
    return Rehearsal(task("StackCube-v1"))


def test_grips_of_a_cube_face_its_sides(rehearsal):
    scene = rehearsal.begin(3)
    cube = scene.body("cubeA")
    grips = cube_grips(cube)
    assert len(grips) == 4
    for position, quaternion in grips:
        np.testing.assert_array_equal(position, cube[0])
        # the gripper's y axis, along which its fingers open, is one of the cube's level axes
        matches = np.abs(_axes(cube[1])[:, :2].T @ _axes(quaternion)[:, 1])
        np.testing.assert_allclose(np.sort(matches), [0, 1], atol=1e-6)


def test_what_is_held_ends_where_it_was_asked_to(rehearsal):
    """The grip does not change, so that gripper and cube move as one body."""
    scene = rehearsal.begin(3)
    place = np.array([0.1, 0.2, 0.3])
    position, quaternion = scene.tcp("arm")
    cube = scene.body("cubeA")[0]
    in_gripper = _axes(quaternion).T @ (cube - position)
    for position, quaternion in held_at(scene, "arm", "cubeA", place, (-0.5, 0.5), (0.0, 0.4)):
        np.testing.assert_allclose(position + _axes(quaternion) @ in_gripper, place, atol=1e-6)


def test_two_waypoints_of_one_name_are_refused(rehearsal):
    rehearsal.begin(0)
    with pytest.raises(TaskError, match=r"2 waypoints are called 'arm\.wait'; one may be"):
        rehearsal.play({"arm": (Waypoint("wait"), Waypoint("go"), Waypoint("wait"))})


def test_a_waypoint_that_takes_too_long_ends_the_attempt(rehearsal):
    rehearsal.begin(0)
    script = {"arm": (Waypoint("wait", until=lambda scene: False, most=7),)}
    attempt = rehearsal.play(script)
    assert attempt.reason == "arm.wait took more than 7 steps"
    assert len(attempt.actions) == 7


def _axes(quaternion: np.ndarray) -> np.ndarray:
    """A rotation's own axes as columns, (3, 3)."""
    return np.column_stack([rotate(quaternion, axis) for axis in np.eye(3)])

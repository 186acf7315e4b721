"""Tasks that fit their robots: sizes by reach and gripper, places by what arms share."""

from dataclasses import astuple, replace
from math import cos, pi, sin

import numpy as np
import pytest

import tasks
from layouts import Frame, Layout, Placement, at_task, face_to_face, side_by_side
from layouts.shared_place import shared_place
from robots import TaskError
from tasks.language.fitting import AS_DECLARED
from tasks.registry import make_scenario

TASK = "TwoRobotHandOver-v1"


def two(robot: str, **places: float) -> Layout:
    return face_to_face({"left": robot, "right": robot}, **places)


def test_its_own_robots_keep_every_number():
    env = tasks.make(TASK)
    assert env.task.fit is AS_DECLARED
    assert env.task.cube is env.task_class.cube
    place, turn = (0.1, 0.2, 0.3), (1.0, 0.0, 0.0, 0.0)
    assert AS_DECLARED.place(place) is place
    assert AS_DECLARED.turned(turn) is turn
    assert AS_DECLARED.length(0.02) == 0.02


def test_a_robot_that_reaches_and_holds_as_much_changes_nothing():
    assert tasks.make(TASK, robots={"right": "panda_wristcam"}).task.fit is AS_DECLARED
    assert tasks.make(TASK, robots={}).layout == tasks.get_task_class(TASK).layout


def test_small_arms_get_a_small_cube_between_them():
    env = tasks.make(TASK, layout=two("so100"))
    fit = env.task.fit
    assert 0.4 < fit.scale < 0.6
    (box,) = env.simulation.worlds[0].bodies["cube"].shapes
    assert box.half_size == pytest.approx([0.02 * fit.scale] * 3)
    for seed in range(5):
        env.reset(seed)
        x, y, z = env.state.position("cube")[0]
        assert z == pytest.approx(0.02 * fit.scale)
        assert -0.15 * fit.scale <= y - fit.y <= -0.1 * fit.scale
        assert abs(x - fit.x) <= 0.05 * fit.scale
        assert env.state.position("goal_site")[0, 1] > y


@pytest.mark.parametrize("robots", [{"left": "so100"}, {"left": "so100", "right": "koch"}])
def test_other_robots_stand_where_they_reach_as_far(robots):
    task = tasks.get_task_class(TASK)
    assert tasks.make(TASK, robots=robots).layout == at_task(robots, task)


def test_robots_that_would_collide_as_they_start_draw_back_or_stand_apart():
    cell = tasks.get_task_class("CellUnlock-v1")  # two Fetches on either side of a Panda
    robots = {"holder": "fetch", "thrower": "panda", "presser": "fetch"}
    report = at_task(robots, cell).validate(workspaces=False)
    assert [finding for finding in report.findings if finding.kind == "collision"] == []


def test_a_task_is_as_small_as_the_place_asks_whose_robot_reaches_too_little():
    """The Panda pushes the block where the UR10 of the cell needs 1.1 m."""
    env = tasks.make("CellRelay-v1", robots={"second": "panda"})
    assert env.task.fit.scale == pytest.approx(0.855 / 1.1)


def test_cameras_see_what_is_smaller_from_nearer():
    env = tasks.make(TASK, robots={"left": "so100"})
    fit, (own,) = env.task.fit, env.task_class.cameras
    assert env.task.cameras[0].eye == pytest.approx(fit.place(own.eye))
    assert env.task.viewpoint[1] == pytest.approx(fit.place(env.task_class.viewpoint[1]))
    assert env.task_class.cameras == (own,)


def test_the_frame_turns_with_the_arms():
    layout = two("koch").moved((0.0, 0.0, 0.0), yaw=pi / 2)
    straight, turned = (tasks.make(TASK, layout=a).task.fit for a in (two("koch"), layout))
    assert turned.yaw - straight.yaw == pytest.approx(pi / 2, abs=1e-3)
    assert turned.scale == pytest.approx(straight.scale, rel=0.2)


def test_a_narrow_gripper_gets_what_it_can_hold():
    env = tasks.make(TASK, layout=side_by_side({"left": "panda", "right": "koch"}, spacing=0.4))
    assert env.task.fit.length(0.04) <= 0.75 * 0.0775


def test_arms_that_share_nothing_are_refused():
    with pytest.raises(TaskError, match=r"no place .* in reach of all of 'left' \(so100\)"):
        tasks.make(TASK, layout=two("so100", spacing=3.0))


def test_arms_that_never_get_near_the_ground_are_refused_in_the_same_words():
    high = two("so100").moved((0.0, 0.0, 3.0))
    with pytest.raises(TaskError, match="no place on the ground is in reach"):
        tasks.make(TASK, layout=high)


def test_the_shared_place_lies_in_the_middle_of_equal_arms():
    found = shared_place(two("panda", spacing=1.5), ("left", "right"))
    assert found is not None
    (x, y), depth = found
    assert np.hypot(x, y) < 0.05
    assert 0.05 < depth < 0.3


def test_one_robot_stands_in_all_places():
    task = tasks.get_task_class("TwoRobotHandOver-v1")
    one = make_scenario(task, robots="so101").layout
    assert one == make_scenario(task, robots={"left": "so101", "right": "so101"}).layout


FOUND = {"packer": ((-0.432, 0.077, 0.0), -1.2), "closer": ((-0.254, 0.5, 0.0), -0.08)}


def found_elsewhere() -> Layout:
    """Return the packer and the closer both to the left of what they work on."""
    own = tasks.get_task_class("CellPutAndClose-v1").layout
    return Layout(
        {
            name: Placement(own[name].robot, at, rpy=(0.0, 0.0, yaw))
            for name, (at, yaw) in FOUND.items()
        }
    )


def test_what_is_declared_stays_where_all_arms_reach_it_from_other_places():
    env = tasks.make("CellPutAndClose-v1", layout=found_elsewhere())
    assert env.task.fit == AS_DECLARED
    own = tasks.make("CellPutAndClose-v1")
    for seed in range(3):
        for each in (env, own):
            each.reset(seed)
        assert np.array_equal(env.state.pose("cube"), own.state.pose("cube"))


def test_a_layout_says_where_the_task_lies():
    """Its frame is where the declaration is, whoever stands where."""
    frame = Frame((0.1, -0.05, 0.0), rpy=(0.0, 0.0, 0.5))
    env = tasks.make("CellPutAndClose-v1", layout=Layout(found_elsewhere(), {"task": frame}))
    assert astuple(env.task.fit) == pytest.approx((1.0, 0.1, -0.05, 0.5))
    own = tasks.make("CellPutAndClose-v1")
    for each in (env, own):
        each.reset(0)
    x, y, z = own.state.position("cube")[0].tolist()
    there = (0.1 + cos(0.5) * x - sin(0.5) * y, sin(0.5) * x + cos(0.5) * y - 0.05, z)
    assert env.state.position("cube")[0].tolist() == pytest.approx(there, abs=1e-6)


def test_what_is_laid_before_arms_stays_where_a_layout_says_where_the_task_lies():
    """It stays before where the task's own arms stand; else it goes along with the arms."""
    own = tasks.get_task_class("CellHammerPegs-v1").layout
    base, turn = own["first"].base_pose.position, pi / 6
    x, y = cos(turn) * base[0] - sin(turn) * base[1], sin(turn) * base[0] + cos(turn) * base[1]
    moved = {**own, "first": replace(own["first"], position=(x, y, base[2]))}
    places = []
    for layout in (own, Layout(moved), Layout(moved, {"task": Frame()})):
        env = tasks.make("CellHammerPegs-v1", layout=layout, check_layout=False)
        env.reset(0)
        places.append(env.state.position("mallet")[0].tolist())
    assert places[2] == places[0] != places[1]


@pytest.mark.parametrize("frame", [Frame((0.0, 0.0, 0.3)), Frame(rpy=(0.1, 0.0, 0.0))])
def test_a_task_lies_on_the_ground(frame):
    with pytest.raises(TaskError, match="at z = 0, turned about z alone"):
        tasks.make("CellPutAndClose-v1", layout=Layout(found_elsewhere(), {"task": frame}))


def test_the_table_is_also_where_a_task_is_declared_to_work():
    """The cube, beyond the table under these two arms alone, rests on it."""
    env = tasks.make("CellPutAndClose-v1", layout=found_elsewhere())
    env.reset(0)
    for _ in range(10):
        env.step(np.zeros(env.action_space.shape, np.float32))
    x, y, z = env.state.position("cube")[0].tolist()
    assert z == pytest.approx(0.02, abs=1e-3)
    plain = env.task_class.table.outline(env.layout)
    assert y < plain[1]
    own = env.task_class.layout
    assert env.task_class.table.under(own, [(0.0, 0.5)]) is env.task_class.table


def test_its_own_robots_in_other_places_hold_what_they_hold():
    """The can is as wide as a Panda holds, and wider than what other hands of its opening get."""
    layout = face_to_face({"opener": "panda", "packer": "panda_wristcam"}, spacing=1.5)
    assert tasks.make("CellPutAway-v1", layout=layout).task.fit.scale == 1.0

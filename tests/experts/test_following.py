"""Motions carried out in SAPIEN."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from layouts import face_to_face
from robot_layouts.experts import Follower, follow
from robot_layouts.motion.model.obstacles import Held, box
from robot_layouts.motion.motion import Motion
from robots import CONTROL_MODES, TaskError, UnknownNameError
from tests.experts.free_motions import FreeRobots, free_robots, swing

CLEARANCE = 0.01  # m; what plans keep unless asked otherwise
POSITIONS = [mode for mode in CONTROL_MODES if not mode.startswith("pd_ee")]
TCPS = ["pd_ee_delta_pose", "pd_ee_pose", "pd_ee_target_delta_pose"]
LAYOUT = FreeRobots.layout
SIX = face_to_face({"left": "ur5_gripper", "right": "z1"}, spacing=2.5)


@pytest.mark.parametrize("mode", POSITIONS)
def test_joints_stay_on_their_way(mode):
    task, motion = free_robots(LAYOUT, mode), swing(LAYOUT)
    followed = follow(task, motion)
    assert max(followed.strays.values()) < CLEARANCE
    assert max(followed.tcp_errors.values()) < CLEARANCE
    assert followed.contacts == ()
    assert followed.actions.shape[1] == task.layout.action_dim
    for name, end in motion.end.items():
        came = task.simulation.read().qpos(name)[0]
        assert came == pytest.approx(end, abs=0.006)


def test_control_modes_are_mixed_and_the_same_actions_do_the_same():
    modes = {"left": "pd_ee_delta_pose", "right": "pd_joint_delta_pos_vel"}
    task, motion = free_robots(LAYOUT, modes), swing(LAYOUT)
    followed = follow(task, motion)
    assert max(followed.tcp_errors.values()) < CLEARANCE
    assert followed.strays["right"] < CLEARANCE
    end = task.get_state_dict()["articulations"]
    task.reset(0, options={"reconfigure": True})
    again = follow(task, motion)
    assert np.array_equal(again.actions, followed.actions)
    task.reset(0, options={"reconfigure": True})
    for action in followed.actions:
        task.step(action[None])
    for name, rows in task.get_state_dict()["articulations"].items():
        assert np.array_equal(rows, end[name])


@pytest.mark.long
@pytest.mark.example_robots
@pytest.mark.parametrize("mode", TCPS)
def test_arms_of_six_joints_stay_on_their_way_by_their_tcps(mode):
    followed = follow(free_robots(SIX, mode), swing(SIX))
    assert max(followed.strays.values()) < CLEARANCE


@pytest.mark.parametrize("mode", TCPS)
def test_tcps_stay_on_their_way(mode):
    followed = follow(free_robots(LAYOUT, mode), swing(LAYOUT))
    assert max(followed.tcp_errors.values()) < CLEARANCE
    assert max(followed.strays.values()) > CLEARANCE  # the solver holds the elbow as it likes


@pytest.mark.parametrize("mode", ["pd_ee_delta_pos", "pd_ee_target_delta_pos"])
def test_tcps_keep_their_places_where_nothing_turns_them(mode):
    followed = follow(free_robots(LAYOUT, mode), swing(LAYOUT, far=0.2))
    assert max(followed.tcp_errors.values()) < CLEARANCE


def test_a_mode_that_cannot_keep_up_makes_all_go_slower():
    task, motion = free_robots(LAYOUT, "pd_joint_delta_pos"), swing(LAYOUT, 0.6, 0.5)
    followed = follow(task, motion)
    assert followed.late >= 0.1
    assert max(followed.strays.values()) < 2 * CLEARANCE
    assert np.abs(followed.actions).max() <= 1.0


def test_robots_that_are_not_in_the_motion_stay_and_grippers_do_as_asked():
    task = free_robots(LAYOUT)
    motion = swing(LAYOUT)
    alone = type(LAYOUT)({"right": LAYOUT["right"]})
    part = Motion(
        alone,
        motion.times,
        {"right": motion.positions["right"]},
        {"right": motion.velocities["right"]},
    )
    followed = follow(task, part, {"left": -1.0})
    gripper = task.layout["left"].robot.action_split["gripper"]
    assert (followed.actions[:, gripper] == -1.0).all()
    left = task.simulation.read().qpos("left")[0]
    assert left[:7] == pytest.approx(LAYOUT["left"].start_qpos[:7], abs=1e-3)
    assert left[7:] == pytest.approx([0, 0], abs=1e-3)


def test_a_robot_that_is_held_up_is_named():
    near = face_to_face({"left": "panda", "right": "panda"}, spacing=1.45)
    task, motion = free_robots(near), swing(near)
    ahead = {name: motion.positions[name].copy() for name in near}
    course = np.linspace(0, 1, len(motion.times))[:, None]
    for rows in ahead.values():  # both stretch their arms towards the other
        rows[:] = rows[0] + course * np.array([0, 0.7, 0, 0.9, 0, 0, 0, 0, 0])
    speeds = {name: np.gradient(rows, motion.times, axis=0) for name, rows in ahead.items()}
    with pytest.raises(
        TaskError,
        match=r"(left|right)'s panda_joint\d is .*; (left|right)\.panda_\S+ and \w+\.panda_\S+ ov",
    ):
        follow(task, Motion(near, motion.times, ahead, speeds))


@pytest.fixture(scope="module")
def task():
    return free_robots(LAYOUT)


OTHERS = face_to_face({"left": "panda", "middle": "xarm7"}, spacing=2.0)
AWAY = face_to_face({"left": "panda", "right": "xarm7"}, spacing=3.0)
SWING = swing(LAYOUT)
BACKWARDS = replace(SWING, positions={name: rows[::-1] for name, rows in SWING.positions.items()})
CARRIED = replace(SWING, held=(Held("left", box("cube", (0.04, 0.04, 0.04))),))


@pytest.mark.parametrize(
    ("motion", "grippers", "message"),
    [
        (swing(OTHERS), {}, "the motion moves 'middle', a xarm7; the task has left"),
        (swing(AWAY), {}, "a layout in which 'left' stands elsewhere"),
        (BACKWARDS, {}, "left's panda_joint1 is 0.216 from where the motion"),
        (SWING, {"lefd": 1.0}, "'lefd'. Did you mean 'left'"),
        (CARRIED, {}, r"carries 'cube'.*grippers=\{'left': -1.0\}"),
    ],
)
def test_what_is_no_motion_for_a_task(task, motion, grippers, message):
    with pytest.raises((TaskError, UnknownNameError), match=message):
        Follower(task, motion, grippers)


def test_a_motion_is_followed_in_one_environment_by_whoever_holds_what_it_carries(task):
    Follower(task, CARRIED, {"left": -1.0})
    with pytest.raises(TaskError, match="followed in 1 environment; the task has 2"):
        Follower(free_robots(LAYOUT, num_envs=2), SWING)

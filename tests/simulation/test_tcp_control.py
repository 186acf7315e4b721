"""TCP control: joints that turn without end, arms of five joints, and the end of reach."""

from __future__ import annotations

from contextlib import closing
from dataclasses import replace
from math import pi

import numpy as np
import pytest

import tasks
from layouts import Layout, Placement
from robot_layouts.simulation import PhysicsSettings, Simulation
from robot_layouts.simulation.checks.tcp_control import ERROR, TcpTrial, try_tcp_control
from robot_layouts.simulation.control.tcp import nearest_turns
from robots import RobotDescriptor, RobotRegistry
from tests.quick import quick_cases

DELTA, TARGET, POSE = "pd_ee_delta_pose", "pd_ee_target_delta_pose", "pd_ee_pose"
AXES = {5: "zyyyz", 6: "zyyxyx", 7: "zyzyzyz"}  # of the joints, from the base
BENT = {5: (0.3, 0.7, 1.2, -0.4, 0.2), 6: (0.3, 0.7, 1.2, 0.2, -0.9, 0.2)}
ENDLESS = (pi - 0.02, 0.7, pi + 0.02, 1.4, -pi - 0.02, 0.9, pi + 0.02)


def arm(folder, count, rest, endless=False):
    """Guess an arm of links of 15 cm, whose first, third, … joint may turn without end."""
    text = "<robot name='arm'>" + "".join(
        f"<link name='l{i}'><inertial><mass value='1'/>"
        "<inertia ixx='.01' iyy='.01' izz='.01' ixy='0' ixz='0' iyz='0'/></inertial></link>"
        for i in range(count + 1)
    )
    for i, axis in enumerate(AXES[count]):
        vector = {"x": "1 0 0", "y": "0 1 0", "z": "0 0 1"}[axis]
        kind = "continuous" if endless and i % 2 == 0 else "revolute"
        ends = "" if kind == "continuous" else "lower='-3' upper='3'"
        text += (
            f"<joint name='j{i}' type='{kind}'><parent link='l{i}'/><child link='l{i + 1}'/>"
            f"<origin xyz='0 0 0.15'/><axis xyz='{vector}'/>"
            f"<limit {ends} effort='100' velocity='3'/></joint>"
        )
    path = folder / "arm.urdf"
    path.write_text(text + "</robot>")
    return RobotDescriptor.from_urdf(path, quiet=True, keyframes={"rest": rest})


def alone(robot, mode):
    layout = Layout({"arm": Placement(robot)}).in_control_mode(mode)
    simulation = Simulation(layout, lambda world, _: None, 1, PhysicsSettings())
    simulation.worlds[0].stand("arm", layout["arm"].start_qpos)
    return simulation


def went(simulation, action, steps):
    """Give an action some times; return how far the TCP went (m), and what was reported last."""
    start = simulation.read().tcp_position("arm")[0]
    for _ in range(steps):
        state = simulation.read()
        simulation.step(np.array([action], np.float32), state.joint_positions)
    return simulation.read().tcp_position("arm")[0] - start, simulation.modes.shortfalls["arm"][0]


def test_joints_beyond_half_a_turn_stay_there(tmp_path):
    robot = arm(tmp_path, 7, ENDLESS, endless=True)
    trials = list(try_tcp_control(robot))
    assert [trial.problem for trial in trials] == [None] * 3
    assert max(trial.drift for trial in trials) < 1e-5
    split = robot.action_split
    native = replace(
        robot, action_split=split.replace(arm=replace(split.groups["arm"], approximate_ik=False))
    )
    (whirled,) = try_tcp_control(native, [DELTA])
    assert "pd_ee_delta_pose moves robot by" in str(whirled.problem)


def test_the_nearest_turns():
    limits = np.array([(-np.inf, np.inf), (-3.0, 3.0)])
    found = nearest_turns(np.array([-3.1, 1.0]), np.array([9.5, 1.0]), limits)
    np.testing.assert_allclose(found, (-3.1 + 4 * pi, 1.0))
    same = np.array([-0.0, 1.0])
    assert np.signbit(nearest_turns(same, same, limits)[0])
    assert nearest_turns(np.array([0.0, 3.1]), np.zeros(2), limits) is None


@pytest.mark.parametrize("name", quick_cases(["so100", "koch"], ["koch"]))
def test_arms_of_five_joints_follow_a_square(name):
    for trial in try_tcp_control(RobotRegistry.load(name), [TARGET]):
        assert trial.problem is None
        assert trial.corner < ERROR


def test_the_place_comes_before_the_orientation(tmp_path):
    robot = arm(tmp_path, 5, BENT[5])
    (trial,) = try_tcp_control(robot, [POSE])
    assert trial.problem is None
    assert trial.corner < ERROR
    assert trial.turn_reported > 0.05


@pytest.mark.parametrize("count", quick_cases([5, 6], [5]))
def test_the_end_of_reach_is_told(tmp_path, count):
    simulation = alone(arm(tmp_path, count, BENT[count]), DELTA)
    way, (away, _) = went(simulation, [0, 0, 1] + [0] * 3, 40)
    height = simulation.read().tcp_position("arm")[0, 2]
    assert height > 0.15 * count - 0.05  # nearly as high as it gets
    assert 0.05 < away <= 0.1 + 1e-6
    way, (away, _) = went(simulation, [0, 0, -0.2] + [0] * 3, 10)
    assert way[2] < -0.05
    assert away < ERROR


def test_tasks_tell_it_of_robots_that_approximate(tmp_path):
    modes = {"control_mode": DELTA, "obs_mode": "none"}
    with closing(tasks.make("PickCube-v1", **modes)) as clone:
        assert not [key for key in clone.step(np.zeros((1, 7)))[-1] if "shortfall" in key]
    with closing(tasks.make("PickCube-v1", robots="so100", num_envs=2, **modes)) as task:
        (key,) = [key for key in task.start[1] if "shortfall" in key]
        up = np.zeros((2, task.layout.action_dim), np.float32)
        up[0, 2] = 1.0
        for _ in range(12):
            info = task.step(up)[-1]
        assert info[key].shape == (2, 2)
        assert info[key][0, 0] > 0.02
        assert info[key][1].tolist() == pytest.approx([0.0, 0.0], abs=1e-3)
        assert task.reset(env_ids=[0])[1][key][0].tolist() == [0.0, 0.0]


def test_what_counts_as_a_problem():
    good = TcpTrial("arm", POSE, 0.0, 0.05, 0.05, 0.3)
    assert good.problem is None
    assert "misses a corner of a square by 50 mm" in str(good._replace(reported=0.01).problem)
    assert "moves arm by inf mm" in str(good._replace(drift=np.inf).problem)

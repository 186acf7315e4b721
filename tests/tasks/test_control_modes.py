"""Joint positions as actions: their limits, and the same motion as deltas."""

import numpy as np
import pytest

import tasks
from layouts import single
from robot_layouts.data.playing.mode_conversion import as_positions
from robot_layouts.simulation.sapien3.world import BuiltWorld
from robots import CONTROL_MODES, DescriptorError, RobotRegistry, TaskError, UnknownNameError
from tasks.episode import play
from tests.catalogue import every_robot
from tests.motions import touching_episode

MODE = "pd_joint_pos"


@pytest.mark.parametrize("task_id", ["PushT-v1", "TwoRobotPickCube-v1"])
def test_positions_move_everything_as_the_deltas_they_come_from(task_id):
    deltas = touching_episode(task_id, 0).actions
    first = tasks.make(task_id)
    second = tasks.make(task_id, control_mode=MODE)
    one, other = play(first, 0, deltas), play(second, 0, as_positions(first, 0, deltas))
    for kind, entries in one.states.items():
        for name, rows in entries.items():
            np.testing.assert_array_equal(rows, other.states[kind][name])
    assert not np.array_equal(one.actions, other.actions)
    with pytest.raises(TaskError, match="the task has pd_joint_pos"):
        as_positions(second, 0, deltas)


@pytest.mark.parametrize("robot", every_robot())
def test_the_limits_are_those_of_the_robot_files(robot):
    simulated = BuiltWorld(single({"arm": robot})).robots["arm"]
    limits = {j.name: j.limits[0] for j in simulated.driven}
    descriptor = simulated.descriptor
    relative = [g for g in descriptor.action_split.groups.values() if g.delta]
    assert relative
    for group in relative:
        expected = np.array([limits[joint] for joint in group.joints])
        given = np.array(group.limits, np.float32)
        endless = ~np.isfinite(expected)  # joints that turn without end
        np.testing.assert_array_equal(given[~endless], expected[~endless])
        assert (np.abs(given[endless]) == np.float32(2 * np.pi)).all()


@pytest.mark.parametrize("robot", every_robot())
def test_a_robot_in_another_control_mode(robot):
    deltas = RobotRegistry.load(robot)
    assert deltas.in_control_mode(CONTROL_MODES[0]) == deltas
    positions = deltas.in_control_mode(MODE)
    assert positions.action_dim == deltas.action_dim
    assert list(positions.action_split) == list(deltas.action_split)
    for before, after in zip(deltas.describe_action(), positions.describe_action(), strict=True):
        assert after.name == before.name
        if before.group in deltas.control_modes.get(MODE, {}):
            continue  # the robot's own
        assert not after.relative
        if before.relative:
            assert (after.unit, after.normalised) == (before.unit.split()[0], False)
            assert positions.action_bounds[after.index] == (after.lower, after.upper)
        else:
            assert after == before
            assert positions.action_bounds[after.index] == (-1, 1)


def test_a_robot_without_limits_says_so():
    panda = RobotRegistry.load("panda")
    arm = panda.action_split.groups["arm"]
    split = panda.action_split.replace(arm=type(arm)(**{**vars(arm), "limits": ()}))
    unlimited = type(panda)(**{**vars(panda), "action_split": split})
    with pytest.raises(DescriptorError, match=r"panda_joint1.*has no limits.*limits=\(\(lower"):
        unlimited.in_control_mode(MODE)


def test_an_unknown_control_mode():
    with pytest.raises(UnknownNameError, match="Did you mean 'pd_joint_pos'"):
        RobotRegistry.load("panda").in_control_mode("pd_joint_pose")
    with pytest.raises(TaskError, match=r"'pd_ee_dance' is not offered; choices: 'pd_joint_delta"):
        tasks.make("PickCube-v1", control_mode="pd_ee_dance")

"""A robot that is tried out: what is seen of one that works, and of ones that do not."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from layouts import Layout, Placement
from robot_layouts.__main__ import main
from robot_layouts.simulation import Simulation
from robot_layouts.simulation.checks.overlaps import Causes, empty, stand, starting_overlaps
from robot_layouts.simulation.checks.trial import TCP_ERROR, tcp_error, try_robot
from robots import RobotDescriptor, RobotRegistry
from tests.three_links import arm, save


@pytest.fixture
def small(tmp_path):
    return RobotDescriptor.from_urdf(save(tmp_path, arm()), quiet=True)


def folded(robot: RobotDescriptor) -> RobotDescriptor:
    """Return the arm with its third link laid onto its base."""
    return dataclasses.replace(robot, keyframes={"rest": (0.0, math.pi - 0.1, 0.0)})


def driven(robot: RobotDescriptor, **drive: object) -> RobotDescriptor:
    groups = robot.action_split.groups
    changed = {name: dataclasses.replace(group, **drive) for name, group in groups.items()}
    return dataclasses.replace(robot, action_split=robot.action_split.replace(**changed))


def test_a_robot_that_works():
    seen = try_robot(RobotRegistry.load("panda"), steps=20)
    assert seen.problems == ()
    assert seen.overlaps == ()
    assert seen.stands
    assert seen.exploded is None
    assert 0 < seen.fastest.times < 2
    assert [trial.number.name for trial in seen.numbers][-1] == "gripper"
    assert seen.numbers[-1].asked == pytest.approx(0.05)  # from open to squeezing
    assert all(trial.least.joint in trial.number.joints for trial in seen.numbers)
    assert 0.01 < seen.tcp_way < 0.1


def test_links_that_start_inside_each_other(small):
    robot = folded(small)
    seen = try_robot(robot, steps=5)
    pairs = {frozenset((overlap.one.name, overlap.other.name)) for overlap in seen.overlaps}
    assert frozenset(("l0", "l3")) in pairs or frozenset(("l1", "l3")) in pairs
    assert any("also moves j2" in problem for problem in seen.problems)
    assert seen.problems[-1].startswith("the likely cause: at the start l")
    assert "overlap by" in seen.problems[-1]


def test_a_drive_that_is_too_weak_moves_too_little(small):
    seen = try_robot(driven(small, force_limit=0.01), steps=5)
    (name,) = {trial.number.name for trial in seen.numbers if trial.number.index == 0}
    assert f"{name} moves j1 by 0% of what it asks for" in " ".join(seen.problems)


def test_a_joint_with_a_number_of_its_own_is_not_dragged_along(small, tmp_path):
    """The file has it mimic another one, the descriptor gives it a number of its own."""
    text = arm(mimics='<mimic joint="j2" multiplier="1"/>')
    path = save(tmp_path, text, "free.urdf")
    split, keyframes = small.action_split, small.keyframes
    robot = RobotDescriptor.from_urdf(path, quiet=True, action_split=split, keyframes=keyframes)
    assert not any("also moves" in problem for problem in try_robot(robot, steps=5).problems)


def test_the_tcp_goes_where_inverse_kinematics_says(small):
    assert tcp_error(RobotRegistry.load("panda")) < TCP_ERROR
    assert tcp_error(driven(small, force_limit=0.001)) > TCP_ERROR


def test_two_robots_in_one_place_are_the_cause_of_what_comes():
    place = Placement("panda", position=(0.0, 0.0, 0.0))
    layout = Layout({"left": place, "right": dataclasses.replace(place, position=(0.1, 0, 0))})
    overlaps = starting_overlaps(layout)
    assert overlaps[0].depth == max(overlap.depth for overlap in overlaps)
    assert {overlaps[0].one.robot, overlaps[0].other.robot} == {"left", "right"}
    causes = Causes(Simulation(layout, empty, 1))
    assert causes.of("left", "panda_joint1") == f"at the start {overlaps[0]}"


def test_the_cause_is_a_drive_where_nothing_overlaps(small):
    layout = Layout({"arm": Placement(small)})
    simulation = Simulation(layout, empty, 1)
    stand(simulation)
    simulation.step(np.zeros((1, 3), np.float32), simulation.read().joint_positions)
    cause = Causes(simulation).of("arm", "j2", 0)
    assert cause.startswith("the drive of j2 is too stiff for what it moves (stiffness ")


class TestCommand:
    def test_it_prints_what_it_saw(self, capsys):
        assert main(["robots", "inspect", "--try", "panda", "panda_stick"]) == 0
        printed = capsys.readouterr().out
        assert "panda: 9 joints, 8 action numbers" in printed
        assert "panda_stick: 7 joints, 7 action numbers" in printed
        assert printed.count("It stands and moves as it should.") == 2
        assert "arm.panda_joint7" in printed
        assert "0.1 rad per step" in printed

    def test_a_robot_without_one_arm_is_tried_but_for_steering_its_tcp(self, capsys):
        assert main(["robots", "inspect", "--try", "floating_panda_gripper"]) == 0
        printed = capsys.readouterr().out
        assert "grasps and holds a cube" in printed
        assert "is not steered: floating_panda_gripper: 'pd_ee_delta_pose' moves the" in printed

    def test_what_is_wrong_is_its_exit_code(self, tmp_path, capsys, monkeypatch, small):
        monkeypatch.setattr(
            "robot_layouts.simulation.checks.commands.named_robot", lambda name: folded(small)
        )
        assert main(["robots", "inspect", "--try", "folded"]) == 1
        printed = capsys.readouterr().out
        assert "WRONG: the likely cause: at the start l" in printed

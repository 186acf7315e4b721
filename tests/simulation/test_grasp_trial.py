"""Grippers that are closed on a cube: ones that hold it, and ones that do not."""

from __future__ import annotations

import dataclasses

import pytest

from robot_layouts.simulation.checks.grasp import try_grasps
from robots import RobotRegistry
from robots.from_urdf import guess_descriptor
from tests.simulation.test_trial import driven

PANDA = RobotRegistry.load("panda")


def test_a_gripper_that_holds_a_cube():
    (seen,) = try_grasps(PANDA)
    assert seen.problem is None
    assert seen.between
    assert seen.closed
    assert seen.grasps
    assert 0 < seen.side <= 0.03


def test_fingers_that_are_not_known():
    (seen,) = try_grasps(dataclasses.replace(PANDA, fingers=None))
    assert seen.problem is not None
    assert "are not known, so that its grasps go unnoticed" in seen.problem


def test_a_tcp_beside_the_fingers():
    (seen,) = try_grasps(dataclasses.replace(PANDA, tcp_offset=(0.0, 0.0, 0.05)))
    assert seen.problem is not None
    assert "from where panda_leftfinger and panda_rightfinger meet" in seen.problem
    assert 0.03 < seen.tcp_off < 0.05


def test_a_drive_that_is_too_weak_grasps_nothing():
    (seen,) = try_grasps(driven(PANDA, force_limit=0.01))
    assert seen.problem == (
        "panda_leftfinger and panda_rightfinger close on a cube of 30 mm without grasping it"
    )


def test_jaws_that_close_slowly_are_waited_for():
    slow = {"stiffness": 2250.0, "damping": 450.0, "armature": 0.1}
    (seen,) = try_grasps(driven(RobotRegistry.load("so100"), **slow))
    assert seen.grasps


def test_a_robot_without_a_gripper():
    assert list(try_grasps(RobotRegistry.load("panda_stick"))) == []


@pytest.mark.parametrize(
    "name",
    [
        "fixed_inspire_hand_left",
        *(
            pytest.param(name, marks=pytest.mark.long)
            for name in ("ability_hand_left", "ability_hand_right", "allegro_hand_right", "dclaw")
        ),
    ],
)
def test_a_hand_that_is_guessed_closes_thumb_and_finger_on_a_cube(name: str):
    """Each joint of it is driven alone, and nothing says which way closes it."""
    (seen,) = try_grasps(guess_descriptor(RobotRegistry.load(name).urdf.locate()).descriptor)
    assert seen.problem is None
    assert seen.tcp_off < 1e-3  # m


@pytest.mark.long
def test_both_hands_of_a_tiago_pro_hold_a_cube():
    left, right = try_grasps(RobotRegistry.load("tiago_pro"))
    assert left.problem is None
    assert right.problem is None

"""Inverse kinematics of a point leads there, for every robot, or says that it cannot."""

import numpy as np
import pytest

from robot_layouts.kinematics.solve import scattered
from robot_layouts.simulation.sapien3.arms import SapienArm
from robot_layouts.simulation.solvers import PointReach
from robots import UnknownNameError
from tests.catalogue import QUICK
from tests.simulation.test_kinematics import start_of, world_of

ROBOTS = QUICK
POINT = np.array([0.01, -0.02, 0.03])


@pytest.mark.parametrize("robot", ROBOTS)
def test_a_solution_brings_the_point_there_nearby(robot):
    reach = PointReach(SapienArm(world_of(robot), "arm"))
    start = with_room(robot, reach)
    moved = start + 0.1 * np.sin(np.arange(1, len(start) + 1))
    place = reach.place_of(POINT, moved)
    solution = reach.solve(POINT, place, start)
    assert solution is not None
    np.testing.assert_allclose(reach.place_of(POINT, solution), place, atol=1e-3)
    assert np.abs(solution - start).max() < 0.3


def with_room(robot: str, reach: PointReach) -> np.ndarray:
    """Arm joints near a keyframe's that can move both ways (Koch's rest at their limits)."""
    limits = {joint.name: joint.limits[0] for joint in world_of(robot).robots["arm"].joints}
    low, high = np.array([limits[joint] for joint in reach.joints]).T
    room = np.minimum(0.2, (high - low) / 4)
    return np.clip(reach.arm(start_of(robot)), low + room, high - room)


def test_fixed_joints_stay():
    reach = PointReach(SapienArm(world_of("so100"), "arm"))
    start = reach.arm(start_of("so100"))
    place = reach.place_of(POINT, start) + [0.0, 0.0, -0.03]
    solution = reach.solve(POINT, place, start, fixed=("wrist_roll",))
    assert solution is not None
    moved = np.abs(solution - start) > 0
    assert moved.tolist() == [True, True, True, True, False]


def test_places_far_from_where_an_arm_rests_are_found():
    """Of 30 random postures' places, on a long way or at limits of joints, nearly all."""
    arm = SapienArm(world_of("so100"), "arm")
    reach, start = PointReach(arm), start_of("so100")
    postures = scattered(np.stack([arm.low, arm.high], axis=1), 30)
    places = [reach.place_of(POINT, posture) for posture in postures]
    found = [reach.solve(POINT, place, reach.arm(start)) for place in places]
    assert sum(one is not None for one in found) >= 27


def test_a_place_out_of_reach_has_no_solution():
    reach = PointReach(SapienArm(world_of("so100"), "arm"))
    assert reach.solve(POINT, np.array([9.0, 0.0, 0.0]), reach.arm(start_of("so100"))) is None


def test_an_unknown_joint_is_refused():
    reach = PointReach(SapienArm(world_of("so100"), "arm"))
    with pytest.raises(UnknownNameError, match="arm joint 'wrist_rol'. Did you mean 'wrist_roll'"):
        reach.solve(POINT, np.zeros(3), reach.arm(start_of("so100")), fixed=("wrist_rol",))

"""Rotations agree with scipy's, in batches and alone."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from robot_layouts.kinematics import quaternions, rotations

angles = st.floats(-math.pi, math.pi)
COUNT = 200


def random_rotations(seed=0) -> Rotation:
    return Rotation.random(COUNT, random_state=seed)


def wxyz(rotation: Rotation) -> np.ndarray:
    return np.roll(rotation.as_quat(), 1, axis=-1)


def assert_same_turn(one, other):
    np.testing.assert_allclose(np.abs((one * other).sum(-1)), 1, atol=1e-12)


def test_products_turn_by_the_second_and_then_by_the_first():
    one, other = random_rotations(0), random_rotations(1)
    assert_same_turn(rotations.multiply(wxyz(one), wxyz(other)), wxyz(one * other))


def test_one_rotation_meets_a_batch():
    one, many = wxyz(random_rotations(0))[0], wxyz(random_rotations(1))
    products = rotations.multiply(one, many)
    assert products.shape == (COUNT, 4)
    np.testing.assert_array_equal(products[7], rotations.multiply(one, many[7]))
    np.testing.assert_array_equal(products[7], quaternions.multiplied(one, many[7]))


def test_vectors_are_turned_as_by_matrices():
    turns, vectors = random_rotations(), np.random.default_rng(0).normal(size=(COUNT, 3))
    np.testing.assert_allclose(
        rotations.rotate(wxyz(turns), vectors), turns.apply(vectors), atol=1e-12
    )
    back = rotations.rotate(rotations.inverse(wxyz(turns)), turns.apply(vectors))
    np.testing.assert_allclose(back, vectors, atol=1e-12)


def test_cross_products_are_numpys():
    one, other = np.random.default_rng(0).normal(size=(2, COUNT, 3))
    np.testing.assert_array_equal(rotations.cross(one, other), np.cross(one, other))
    np.testing.assert_array_equal(rotations.cross(one[0], other), np.cross(one[0], other))


def test_matrices_and_quaternions_are_the_same_turns():
    turns = random_rotations()
    np.testing.assert_allclose(rotations.rotation_of(wxyz(turns)), turns.as_matrix(), atol=1e-12)
    read = rotations.quaternion_of(turns.as_matrix())
    assert_same_turn(read, wxyz(turns))
    assert (read[:, 0] >= 0).all()


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_half_turns_have_quaternions(axis):
    turn = quaternions.turn(axis, math.pi)
    assert_same_turn(rotations.quaternion_of(rotations.rotation_of(turn)), np.array(turn))


@given(angles, st.integers(0, 2))
def test_turns_about_an_axis(angle, axis):
    unit = np.eye(3)[axis].tolist()
    expected = Rotation.from_rotvec(angle * np.array(unit)).as_matrix()
    np.testing.assert_allclose(rotations.rotation_about(unit, angle), expected, atol=1e-12)
    quaternion = rotations.quaternion_about(unit, angle)
    np.testing.assert_allclose(rotations.rotation_of(quaternion), expected, atol=1e-12)
    np.testing.assert_allclose(quaternions.turn("xyz"[axis], angle), quaternion, atol=1e-15)


@pytest.mark.parametrize("size", [0.0, 1e-12, 1e-6, 1e-3, 0.1, 1.0, 3.0, math.pi - 1e-9])
def test_rotation_vectors_of_every_size(size):
    axes = np.random.default_rng(0).normal(size=(COUNT, 3))
    vectors = size * axes / np.linalg.norm(axes, axis=1, keepdims=True)
    read = rotations.rotation_vector(Rotation.from_rotvec(vectors).as_matrix())
    np.testing.assert_allclose(read, vectors, atol=1e-8 if size > 3 else 1e-12)


def test_poses_carry_points_and_have_inverses():
    turns, places = random_rotations(), np.random.default_rng(0).normal(size=(COUNT, 3))
    poses = rotations.pose_matrix(places, wxyz(turns))
    points = np.random.default_rng(1).normal(size=(COUNT, 3))
    there = rotations.transform(poses, points)
    np.testing.assert_allclose(there, turns.apply(points) + places, atol=1e-12)
    np.testing.assert_allclose(
        rotations.transform(rotations.inverse_pose(poses), there), points, atol=1e-12
    )


@given(angles, st.floats(-1.5, 1.5), angles)
def test_roll_pitch_and_yaw_come_back(roll, pitch, yaw):
    quaternion = quaternions.rpy_quaternion((roll, pitch, yaw))
    expected = Rotation.from_euler("xyz", [roll, pitch, yaw])
    assert_same_turn(np.array(quaternion), wxyz(expected))
    again = quaternions.rpy_quaternion(quaternions.quaternion_rpy(quaternion))
    assert_same_turn(np.array(again), np.array(quaternion))


@pytest.mark.parametrize("size", [1e-9, 1e-5, 1.0])
@pytest.mark.parametrize("part", range(5))
def test_a_rotation_alone_has_the_vector_that_it_has_among_others(size, part):
    """To the last bit, whichever component of its quaternion is the largest, if one is."""
    drawn = np.random.default_rng(part).normal(size=(200, 4))
    drawn[:, [i for i in range(4) if i != part]] *= size
    turns = rotations.rotation_of(drawn / np.linalg.norm(drawn, axis=1, keepdims=True))
    together = rotations.rotation_vector(turns)
    for one, expected in zip(turns, together, strict=True):
        np.testing.assert_array_equal(rotations.rotation_vector(one), expected)
        np.testing.assert_array_equal(rotations.rotation_vector(one[None])[0], expected)

"""Products, inverses and frames of poses: of many as of one, asked for once or again."""

import numpy as np
import pytest

from robot_layouts.kinematics.rotations import rotate
from tasks import compose, inverse, transform
from tasks.language.terms import FEW
from tasks.maths import Floats

COUNTS = (1, 3, FEW, FEW + 1)


def drawn(count: int, seed: int) -> Floats:
    poses = np.random.default_rng(seed).normal(size=(count, 7)).astype(np.float32)
    poses[:, 3:] /= np.linalg.norm(poses[:, 3:], axis=1, keepdims=True)
    return poses


@pytest.mark.parametrize("count", COUNTS)
def test_a_pose_and_its_inverse_cancel(count: int):
    poses = drawn(count, 0)
    still = compose(poses, inverse(poses))
    np.testing.assert_allclose(still, [[0, 0, 0, 1, 0, 0, 0]] * count, atol=2e-6)
    points = drawn(count, 1)[:, :3]
    there = poses[:, :3] + np.array([rotate(p[3:], x) for p, x in zip(poses, points, strict=True)])
    np.testing.assert_allclose(transform(poses, points), there, atol=2e-6)


@pytest.mark.parametrize("count", COUNTS)
def test_a_pose_does_not_depend_on_those_beside_it(count: int):
    first, second = drawn(count, 0), drawn(count, 1)
    composed, inverted = compose(first, second), inverse(first)
    fixed = compose(first, second[:1])
    placed = transform(first, second[:, :3])
    for i in range(count):
        one = slice(i, i + 1)
        np.testing.assert_array_equal(compose(first[one], second[one]), composed[one])
        np.testing.assert_array_equal(compose(first[one], second[:1]), fixed[one])
        np.testing.assert_array_equal(inverse(first[one]), inverted[one])
        np.testing.assert_array_equal(transform(first[one], second[one, :3]), placed[one])


@pytest.mark.parametrize("count", COUNTS)
def test_points_are_transformed_together_as_one_by_one(count: int):
    poses, points = drawn(count, 0), np.stack([drawn(count, k)[:, :3] for k in (1, 2)])
    together = transform(poses, points)
    for one, placed in zip(points, together, strict=True):
        np.testing.assert_array_equal(transform(poses, one), placed)


@pytest.mark.parametrize("count", COUNTS)
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_what_was_asked_for_before_is_given_again(count: int, dtype: type):
    first, second = drawn(count, 0).astype(dtype), drawn(count, 1).astype(dtype)
    composed, inverted = compose(first, second), inverse(first)
    kept = composed.copy(), inverted.copy()
    composed[:], inverted[:] = 0.0, 0.0  # what one was given may be changed
    for again, before in zip((compose(first, second), inverse(first)), kept, strict=True):
        assert again.dtype == dtype
        np.testing.assert_array_equal(again, before)
    first[0, 0] += 1.0
    assert compose(first, second)[0, 0] != kept[0][0, 0]
    assert inverse(pose=first)[0, 0] != kept[1][0, 0]

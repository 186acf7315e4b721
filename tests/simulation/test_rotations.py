import math

import numpy as np
import pytest
import torch

from robot_layouts.simulation.maths import Floats
from robot_layouts.simulation.rotations import last_euler_angle, rotation_matrix


def random_quaternions(count: int) -> Floats:
    return np.random.default_rng(0).standard_normal((count, 4), np.float32)


def about(axis: int, angle: float) -> Floats:
    quaternion = np.zeros((1, 4), np.float32)
    quaternion[0, 0], quaternion[0, 1 + axis] = math.cos(angle / 2), math.sin(angle / 2)
    return rotation_matrix(quaternion)


@pytest.mark.parametrize("count", [1, 2, 8, 33, 1000])
def test_squares_are_added_as_torch_adds_them(count):
    quaternions = random_quaternions(count)
    scale = 2.0 / torch.from_numpy(quaternions * quaternions).sum(-1).numpy()
    x, y = quaternions[:, 1], quaternions[:, 2]
    np.testing.assert_array_equal(
        rotation_matrix(quaternions)[:, 2, 2], 1.0 - scale * (x * x + y * y)
    )


def test_a_quarter_turn_about_each_axis_carries_the_next_axis_into_the_one_after():
    for axis in range(3):
        turned = about(axis, math.pi / 2)[0, :, (axis + 1) % 3]
        np.testing.assert_allclose(turned, np.eye(3)[(axis + 2) % 3], atol=1e-6)


def test_the_last_euler_angle_is_that_of_the_last_turn():
    for z in (-3.0, -0.5, 0.0, 2.0):
        matrix = about(0, 0.7) @ about(1, -0.4) @ about(2, z)
        assert last_euler_angle(matrix).item() == pytest.approx(z, abs=1e-6)


def test_a_row_does_not_depend_on_the_batch_it_is_in():
    quaternions = random_quaternions(100)
    matrices = rotation_matrix(quaternions)
    angles = last_euler_angle(matrices)
    for i in range(100):
        alone = rotation_matrix(quaternions[i : i + 1])
        assert np.array_equal(alone[0], matrices[i])
        assert np.array_equal(last_euler_angle(alone)[0], angles[i])

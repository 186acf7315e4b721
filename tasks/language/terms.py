"""What rewards, success and observations are computed of: terms, bodies on others, poses."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import lru_cache

import numpy as np
from torch import Tensor

from robot_layouts.simulation import State
from robot_layouts.simulation.maths import (
    Flags,
    Floats,
    added,
    arctan2,
    columns,
    concatenate,
    constant,
    copy,
    minimum,
    norm,
    rounded,
    sin,
    stack,
    tanh,
    where,
    zeros,
)
from robot_layouts.simulation.maths import closeness as close

# The same in StackCube, StackPyramid and PlaceSphere of mani_skill 3.0.1
HEIGHT_TOLERANCE = 0.005  # m
SLOW, SLOW_SPIN = 1e-2, 0.5  # m/s, rad/s

# Component j of a product is the sum over k of a[k] · b[_FACTOR[k, j]] · _SIGN[k, j], k = 0 first.
# Signs have the shape of a single pose's factors: NumPy multiplies these in half the time.
_TERM = np.repeat(np.arange(4), 4).reshape(4, 4)
_FACTOR = np.array(((0, 1, 2, 3), (1, 0, 3, 2), (2, 3, 0, 1), (3, 2, 1, 0)))
_SIGN = np.array((((1, 1, 1, 1), (-1, 1, -1, 1), (-1, 1, 1, -1), (-1, -1, 1, 1)),), np.float32)
_CONJUGATE = np.array(((1, -1, -1, -1),), np.float32)
_BACK = _SIGN * _CONJUGATE[:, _FACTOR]  # of a product with the conjugate of b

FEW, LATEST = 32, 32  # poses up to which results are recalled, and of how many calls

_SMALL_ANGLE = 1e-6  # below it sin(x / 2) / x is taken from its series (rad)


# -- terms of dense rewards ------------------------------------------------------------------------


def closeness(*distances: Floats) -> Sequence[Floats]:
    """Return ``1 - tanh(5 d)`` of each distance: 1 at 0, 0.24 at 0.2, nearly 0 from 0.5 on.

    Args:
        distances: Arrays of one shape, which are taken together, since calls cost more than
            numbers.
    """
    return [*close(stack(distances), 5.0)]


def stillness(state: State, body: str) -> Floats:
    """Return ``1 - tanh(10 v + w)`` of a body's speed v (m/s) and spin w (rad/s), shape (N,)."""
    return 1.0 - tanh(state.speed(body) * 10.0 + state.spin(body))


def letting_go(state: State, robot: str, grasped: Flags, released: float) -> Floats:
    """Return how far a gripper is open while it holds something, and ``released`` afterwards.

    Args:
        state: The state.
        robot: Whose gripper.
        grasped: Whether it holds something, shape (N,) bool.
        released: What having let go is worth.
    """
    return where(grasped, state.gripper_opening(robot), released)


# -- whether a body lies on another one ------------------------------------------------------------


def lies_on(state: State, top: str, bottom: str, aside: float, *heights: float) -> Flags:
    """Tell whether a body lies on another one, to within 5 mm of height.

    Args:
        state: The state.
        top: The upper body.
        bottom: The lower body.
        aside: How far its origin may be from the lower one's, seen from above (m).
        heights: How much higher its origin must be, in parts (m); float32 sums depend on the
            order of their parts.

    Returns:
        Shape (N,), bool.
    """
    error = state.offset(bottom, top)[:, 2]
    for height in heights:
        error = error - height
    return (state.planar_distance(bottom, top) <= aside) & (abs(error) <= HEIGHT_TOLERANCE)


def distance_to_top(state: State, top: str, bottom: str, *heights: float) -> Floats:
    """Return how far a body is from its place on another one, shape (N,) (m).

    Args:
        state: The state.
        top: The body to be put on top.
        bottom: The body that it is to lie on.
        heights: How much higher its origin must be, in parts (m), as for `lies_on`.
    """
    goal = copy(state.position(bottom))
    for height in heights:
        goal[:, 2] += height
    return norm(goal - state.position(top))


def is_at_rest(state: State, body: str) -> Flags:
    """Tell whether a body is slower than 1 cm/s and 0.5 rad/s, shape (N,) bool.

    Those are speeds in the world, at any size of the task: what lies still keeps some mm/s there.
    """
    return (state.speed(body) <= SLOW / state.scale) & (state.spin(body) <= SLOW_SPIN)


def diagonal(side: float, beyond: float = 0.0) -> float:
    """Return the diagonal of a square and something beyond, as float32 rounds (unit of both)."""
    return rounded(float(norm(np.array([side, side], np.float32))) + rounded(beyond))


# -- poses -----------------------------------------------------------------------------------------
#
# Products, inverses and angles of poses, in the order of operations of native's ``Pose``. Poses are
# position (m) and quaternion (wxyz), float32, (N, 7). Native's order decides the last bits of
# observations and rewards, so these stand apart from `robot_layouts.kinematics.rotations`.


def compose(first: Floats, second: Floats) -> Floats:
    """Return the pose that ``second`` has in the world if ``first`` is the frame it is given in.

    Args:
        first: Shape (N, 7).
        second: Shape (N, 7) or (1, 7).

    Returns:
        Shape (N, 7), with w ≥ 0.
    """
    return _recalled(_composed, first, second)


def inverse(pose: Floats) -> Floats:
    """Return the inverse of poses, shape (N, 7)."""
    return _recalled(_inverted, pose)


def transform(pose: Floats, point: Floats) -> Floats:
    """Return points that are given in the frame ``pose`` in the frame of ``pose``, (..., N, 3) (m).

    Args:
        pose: Shape (N, 7).
        point: Shape (..., N, 3) or (..., 1, 3) (m).
    """
    return pose[:, :3] + _rotated(pose[:, 3:], point)


def angle_between(first: Floats, second: Floats) -> Floats:
    """Return the angle by which quaternions (N, 4) differ, shape (N,), in [0, π] (rad).

    Native takes the length of the axis-angle vector, which differs from the angle by rounding.
    """
    turn = _with_positive_w(_product(_conjugate(first), second))
    axis = turn[:, 1:]
    half_angle = arctan2(norm(axis), turn[:, 0])
    angle = 2.0 * half_angle
    small = abs(angle) < _SMALL_ANGLE
    with np.errstate(invalid="ignore"):  # 0 / 0, where the series is taken
        ratio = where(small, 0.5 - angle * angle / 48.0, sin(half_angle) / angle)
    turned = norm(axis / ratio[:, None])
    return minimum(turned, (2 * math.pi) - turned)


def _recalled(compute: Callable[..., Floats], *poses: Floats) -> Floats:
    """Compute something of poses, or recall it: what stands still is asked for in every step."""
    if isinstance(poses[0], Tensor) or len(poses[0]) > FEW:
        return compute(*poses)
    return _latest(compute, *[(pose.dtype.char, pose.tobytes()) for pose in poses]).copy()


@lru_cache(maxsize=LATEST)
def _latest(compute: Callable[..., Floats], *poses: tuple[str, bytes]) -> Floats:
    return compute(*[np.frombuffer(data, kind).reshape(-1, 7) for kind, data in poses])


def _composed(first: Floats, second: Floats) -> Floats:
    position = first[:, :3] + _rotated(first[:, 3:], second[:, :3])
    turned = _with_positive_w(_product(first[:, 3:], second[:, 3:]))
    return concatenate((position, turned), 1)


def _inverted(pose: Floats) -> Floats:
    turned_back = _conjugate(pose[:, 3:])
    return concatenate((_rotated(turned_back, -pose[:, :3]), turned_back), 1)


def _product(a: Floats, b: Floats, signs: Floats = _SIGN) -> Floats:
    """Products of quaternions, (N, 4)."""
    factors: Floats = columns(b, _FACTOR) * constant(b, signs)
    return added(columns(a, _TERM) * factors)


def _rotated(quaternion: Floats, point: Floats) -> Floats:
    """Points (N, 3) turned by quaternions (N, 4)."""
    as_quaternion = concatenate((zeros(point[..., :1]), point), -1)
    return _product(_product(quaternion, as_quaternion), quaternion, _BACK)[..., 1:]


def _conjugate(quaternion: Floats) -> Floats:
    return quaternion * constant(quaternion, _CONJUGATE)


def _with_positive_w(quaternion: Floats) -> Floats:
    return where(quaternion[:, :1] < 0, -quaternion, quaternion)

"""Terms that dense rewards are made of."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from simulation import State
from simulation.arrays import Flags, Floats, constants, tanh

_ONE, _FIVE, _TEN = constants(1.0, 5.0, 10.0)


def closeness(*distances: Floats) -> Sequence[Floats]:
    """Return ``1 - tanh(5 d)`` of each distance: 1 at 0, 0.24 at 0.2, nearly 0 from 0.5 on.

    Args:
        distances: Arrays of one shape, which are taken together, since calls cost more than
            numbers.
    """
    return [*(_ONE - tanh(np.array(distances) * _FIVE))]


def stillness(state: State, body: str) -> Floats:
    """Return ``1 - tanh(10 v + w)`` of a body's speed v (m/s) and spin w (rad/s), shape (N,)."""
    return _ONE - tanh(state.speed(body) * _TEN + state.spin(body))


def letting_go(state: State, robot: str, grasped: Flags, released: Floats) -> Floats:
    """Return how far a gripper is open while it holds something, and ``released`` afterwards.

    Args:
        state: The state.
        robot: Whose gripper.
        grasped: Whether it holds something, shape (N,) bool.
        released: What having let go is worth, shape ().
    """
    return np.where(grasped, state.gripper_opening(robot), released)

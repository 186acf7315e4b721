"""Terms that dense rewards are made of."""

from __future__ import annotations

from collections.abc import Sequence

from robot_layouts.simulation import State
from robot_layouts.simulation.maths import Flags, Floats, stack, tanh, where
from robot_layouts.simulation.maths import closeness as close


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

"""Whether a body lies on another one and at rest, and how far it is from lying there."""

from __future__ import annotations

import numpy as np

from robot_layouts.simulation import State
from robot_layouts.simulation.maths import Flags, Floats, copy, norm, rounded

# The same in StackCube, StackPyramid and PlaceSphere of mani_skill 3.0.1
HEIGHT_TOLERANCE = 0.005  # m
SLOW, SLOW_SPIN = 1e-2, 0.5  # m/s, rad/s


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
    """Tell whether a body is slower than 1 cm/s and 0.5 rad/s, shape (N,) bool."""
    return (state.speed(body) <= SLOW) & (state.spin(body) <= SLOW_SPIN)


def diagonal(side: float, beyond: float = 0.0) -> float:
    """Return the diagonal of a square and something beyond, as float32 rounds (unit of both)."""
    return rounded(float(norm(np.array([side, side], np.float32))) + rounded(beyond))

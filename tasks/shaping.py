"""Terms that dense rewards are made of."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor

from simulation import State

# Tensors, because arithmetic with Python numbers costs twice as much per call.
_ONE, _FIVE, _TEN = torch.tensor([1.0, 5.0, 10.0])


def closeness(*distances: Tensor) -> Sequence[Tensor]:
    """Return ``1 - tanh(5 d)`` of each distance: 1 at 0, 0.24 at 0.2, nearly 0 from 0.5 on.

    Args:
        distances: Tensors of one shape. Many are taken together, since calls cost more than
            numbers; two are not worth the joining.
    """
    if len(distances) <= 2:
        return [_ONE - (distance * _FIVE).tanh() for distance in distances]
    return (_ONE - (torch.stack(distances) * _FIVE).tanh()).unbind()


def stillness(state: State, body: str) -> Tensor:
    """Return ``1 - tanh(10 v + w)`` of a body's speed v (m/s) and spin w (rad/s), shape (N,)."""
    return _ONE - torch.tanh(state.speed(body) * _TEN + state.spin(body))


def letting_go(state: State, robot: str, grasped: Tensor, released: Tensor) -> Tensor:
    """Return how far a gripper is open while it holds something, and ``released`` afterwards.

    Args:
        state: The state.
        robot: Whose gripper.
        grasped: Whether it holds something, shape (N,) bool.
        released: What having let go is worth, shape ().
    """
    return torch.where(grasped, state.gripper_opening(robot), released)

"""Terms that dense rewards are made of."""

from __future__ import annotations

import torch
from torch import Tensor

# Tensors, because arithmetic with Python numbers costs twice as much per call.
_ONE, _FIVE = torch.tensor(1.0), torch.tensor(5.0)


def closeness(*distances: Tensor) -> tuple[Tensor, ...]:
    """Return ``1 - tanh(5 d)`` of each distance: 1 at 0, 0.24 at 0.2, nearly 0 from 0.5 on.

    Args:
        distances: Tensors of one shape; taken together, since calls cost more than numbers.
    """
    return torch.sub(_ONE, torch.stack(distances).mul_(_FIVE).tanh_()).unbind()

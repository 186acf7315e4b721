"""Arrays that become tensors of a device, and flags beside them."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor


def move_arrays(holder: object, device: torch.device) -> None:
    """Let the NumPy arrays that an object holds be tensors of a device."""
    vars(holder).update(
        {
            name: torch.from_numpy(np.ascontiguousarray(array)).to(device)
            for name, array in vars(holder).items()
            if isinstance(array, np.ndarray)
        }
    )


def beside(flags: Tensor, rows: Tensor) -> Tensor:
    """Return flags, (N,), in as many axes as rows have, (N, …)."""
    return flags.view(-1, *[1] * (rows.ndim - 1))

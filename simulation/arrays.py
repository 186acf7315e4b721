"""Float32 arrays, and the functions of them whose last bit depends on who computes them.

Sums, products, quotients and comparisons round alike everywhere, so NumPy does them at a fifth of
what a torch call costs. Roots, norms and transcendental functions do not: native takes torch's, so
they are torch's here.
"""

from __future__ import annotations

from math import isfinite
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

Floats = NDArray[np.float32]
Flags = NDArray[np.bool_]
Array = NDArray[Any]


def constants(*values: float) -> tuple[Floats, ...]:
    """Return numbers as float32 arrays of shape (), which NumPy need not convert at every use."""
    return tuple(np.array(value, np.float32) for value in values)


def all_finite(values: Array) -> bool:
    """Tell whether every number is finite; takes half a microsecond, where `numpy.all` takes two.

    A sum of squares is finite unless a number is not, or is larger than 1e19.
    """
    if values.size == 1:
        return isfinite(values.item())
    return isfinite(np.vdot(values, values)) or bool(np.isfinite(values).all())


def tanh(x: Array) -> Floats:
    """Return torch's hyperbolic tangents."""
    return torch.from_numpy(x).tanh().numpy()


def sqrt(x: Array) -> Floats:
    """Return torch's square roots."""
    return torch.from_numpy(x).sqrt().numpy()


def cos(x: Array) -> Floats:
    """Return torch's cosines (of rad)."""
    return torch.from_numpy(x).cos().numpy()


def sin(x: Array) -> Floats:
    """Return torch's sines (of rad)."""
    return torch.from_numpy(x).sin().numpy()


def arccos(x: Array) -> Floats:
    """Return torch's arc cosines (rad)."""
    return torch.from_numpy(x).arccos().numpy()


def arctan2(y: Array, x: Array) -> Floats:
    """Return torch's arc tangents of ``y / x``, shape (N,) (rad).

    One by one, because torch's arc tangents of a batch round differently from those of one number.
    """
    rows = zip(torch.from_numpy(y), torch.from_numpy(x), strict=True)
    return torch.stack([torch.atan2(a, b) for a, b in rows]).numpy()


def norm(x: Array) -> Floats:
    """Return torch's Euclidean norms along the last axis."""
    return torch.linalg.vector_norm(torch.from_numpy(x), dim=-1).numpy()

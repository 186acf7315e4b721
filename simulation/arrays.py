"""Where `simulation.maths` was before; tasks in files of one's own may still import it."""

from __future__ import annotations

import numpy as np

from simulation.maths import (
    Array,
    Flags,
    Floats,
    arccos,
    arctan2,
    cos,
    norm,
    sin,
    sqrt,
    tanh,
)

__all__ = [
    "Array",
    "Flags",
    "Floats",
    "arccos",
    "arctan2",
    "constants",
    "cos",
    "norm",
    "sin",
    "sqrt",
    "tanh",
]


def constants(*values: float) -> tuple[Floats, ...]:
    """Return numbers as float32 arrays of shape (); plain floats do as well."""
    return tuple(np.array(value, np.float32) for value in values)

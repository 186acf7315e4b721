"""Functions of the arrays that a state gives, NumPy's or torch's; see `maths`."""

from typing import TYPE_CHECKING, NoReturn

from robot_layouts.core.errors import missing_name
from robot_layouts.simulation.maths import (
    Array,
    Flags,
    Floats,
    abs,
    all,
    all_finite,
    any,
    arccos,
    arctan2,
    argmax,
    argmin,
    by_torch,
    clip,
    columns,
    concatenate,
    copy,
    cos,
    counted,
    cross,
    exp,
    floats,
    full,
    like,
    log,
    max,
    maximum,
    mean,
    min,
    minimum,
    norm,
    rounded,
    sin,
    sqrt,
    stack,
    sum,
    tanh,
    where,
    zeros,
)

__all__ = [
    "Array",
    "Flags",
    "Floats",
    "abs",
    "all",
    "all_finite",
    "any",
    "arccos",
    "arctan2",
    "argmax",
    "argmin",
    "by_torch",
    "clip",
    "columns",
    "concatenate",
    "copy",
    "cos",
    "counted",
    "cross",
    "exp",
    "floats",
    "full",
    "like",
    "log",
    "max",
    "maximum",
    "mean",
    "min",
    "minimum",
    "norm",
    "rounded",
    "sin",
    "sqrt",
    "stack",
    "sum",
    "tanh",
    "where",
    "zeros",
]

if not TYPE_CHECKING:  # type checkers know what there is, and would believe in any name

    def __getattr__(name: str) -> NoReturn:
        """Say what there is."""
        raise missing_name(__name__, name, __all__)


def __dir__() -> list[str]:
    """List what is public: completion goes by this."""
    return __all__

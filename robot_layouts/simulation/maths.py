"""The functions that tasks compute with, on whatever arrays a state gives: NumPy's or torch's.

They are called as in NumPy and mean the same. What both kinds of arrays have as an operator
(``+``, ``<=``, ``&``, ``@``, slices) needs no function. Plain floats stay what they are: they take
the arrays' float32.

Sums, products, quotients and comparisons round alike everywhere, so NumPy does them at a fifth of
what a torch call costs. Roots, norms and transcendental functions do not: native takes torch's, so
they are torch's here, of NumPy's arrays too.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache, wraps
from math import isfinite
from typing import Any, cast

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from robot_layouts.core.portable import is_portable

Floats = NDArray[np.float32]
Flags = NDArray[np.bool_]
Array = NDArray[Any]
"""Types of arrays in signatures. Torch's behave alike wherever the functions below are used."""


def by_torch(function: Callable[..., Tensor]) -> Callable[..., Any]:
    """Let a function of tensors take NumPy's arrays as well, and return what it was given."""

    @wraps(function)
    def call(*arguments: Any, **options: Any) -> Any:
        given = [torch.from_numpy(a) if isinstance(a, np.ndarray) else a for a in arguments]
        result = function(*given, **options)
        return result if isinstance(arguments[0], Tensor) else result.numpy()

    return call


def all_finite(values: Array) -> bool:
    """Tell whether every number is finite; takes half a microsecond, where `numpy.all` takes two.

    A sum of squares is finite unless a number is not, or is larger than 1e19.
    """
    if isinstance(values, Tensor):
        return bool(values.isfinite().all())
    if values.size == 1:
        return isfinite(values.item())
    return isfinite(np.vdot(values, values)) or bool(np.isfinite(values).all())


def all(x: Array, axis: int | None = None) -> Any:
    """Return whether all flags along an axis are set, or all there are."""
    return x.all() if axis is None else x.all(axis)


def any(x: Array, axis: int | None = None) -> Any:
    """Return whether one of the flags along an axis is set, or one of all."""
    return x.any() if axis is None else x.any(axis)


def where(condition: Array, one: Array | float, other: Array | float) -> Any:
    """Return ``one`` where a condition holds and ``other`` elsewhere."""
    if isinstance(condition, Tensor):
        return torch.where(condition, _any(one), _any(other))
    if isinstance(one, float) and isinstance(other, np.ndarray):
        if other.dtype == np.float32 and other.shape == condition.shape:
            chosen = other.copy()  # half of what `numpy.where` costs for a few numbers
            chosen[condition] = one
            return chosen
    return np.where(condition, one, other)


def maximum(x: Array, bound: Array | float) -> Any:
    """Return the larger of two, number by number."""
    return torch.clamp(x, min=_any(bound)) if isinstance(x, Tensor) else np.maximum(x, bound)


def minimum(x: Array, bound: Array | float) -> Any:
    """Return the smaller of two, number by number."""
    return torch.clamp(x, max=_any(bound)) if isinstance(x, Tensor) else np.minimum(x, bound)


def clip(x: Array, low: float, high: float) -> Any:
    """Return numbers, those beyond a bound moved to it."""
    return torch.clamp(x, low, high) if isinstance(x, Tensor) else np.clip(x, low, high)


def abs(x: Array) -> Any:
    """Return numbers without their sign."""
    return x.__abs__()


def max(x: Array, axis: int | None = None) -> Any:
    """Return the largest number along an axis, or of all."""
    return x.amax(() if axis is None else axis) if isinstance(x, Tensor) else x.max(axis)


def min(x: Array, axis: int | None = None) -> Any:
    """Return the smallest number along an axis, or of all."""
    return x.amin(() if axis is None else axis) if isinstance(x, Tensor) else x.min(axis)


def argmax(x: Array, axis: int | None = None) -> Any:
    """Return where the largest number along an axis is, the first if there are several."""
    return x.argmax(axis)


def argmin(x: Array, axis: int | None = None) -> Any:
    """Return where the smallest number along an axis is, the first if there are several."""
    return x.argmin(axis)


@by_torch
def sum(x: Any, axis: int | None = None) -> Any:
    """Return torch's sums along an axis, or of all numbers.

    Of rows in memory one after the other: else torch adds in another order than for a single row.
    """
    return x.sum() if axis is None else x.contiguous().sum(axis)


@by_torch
def mean(x: Any, axis: int | None = None) -> Any:
    """Return torch's means of floats along an axis, or of all; see `sum`."""
    return x.mean() if axis is None else x.contiguous().mean(axis)


def stack(arrays: Sequence[Array], axis: int = 0) -> Any:
    """Return arrays of one shape as one, along a new axis."""
    if isinstance(arrays[0], Tensor):
        return torch.stack(_any(arrays), axis)
    return np.array(arrays) if axis == 0 else np.stack(arrays, axis)


def concatenate(arrays: Sequence[Array], axis: int = 0) -> Any:
    """Return arrays as one, along an axis that they have."""
    if isinstance(arrays[0], Tensor):
        return torch.cat(_any(arrays), axis)
    return np.concatenate(arrays, axis)


def counted(x: Array, count: int) -> Any:
    """Return the numbers from 0 to ``count - 1``, as an array of the kind of ``x``."""
    return torch.arange(count, device=x.device) if isinstance(x, Tensor) else np.arange(count)


def columns(x: Array, numbers: tuple[tuple[int, ...], ...] | NDArray[np.intp]) -> Any:
    """Return columns of ``x``, (..., k), by their numbers, (i, j); shape (..., i, j)."""
    if isinstance(x, Tensor):
        return x[..., _kept(numbers, x.device)]
    return x.take(numbers if isinstance(numbers, np.ndarray) else _places(numbers), -1)


def added(x: Array) -> Any:
    """Return the sums of four along the last axis but one, added one after the other."""
    if isinstance(x, Tensor):
        return x[..., 0, :] + x[..., 1, :] + x[..., 2, :] + x[..., 3, :]
    return np.add.accumulate(x, -2)[..., 3, :]


def floats(x: Array) -> Any:
    """Return flags or integers as float32."""
    return x.float() if isinstance(x, Tensor) else x.astype(np.float32)


def zeros(x: Array) -> Any:
    """Return zeros of the shape and type of ``x``."""
    return torch.zeros_like(x) if isinstance(x, Tensor) else np.zeros(x.shape, x.dtype)


def copy(x: Array) -> Any:
    """Return a copy, which may be changed."""
    return x.clone() if isinstance(x, Tensor) else x.copy()


def tanh(x: Array) -> Any:
    """Return torch's hyperbolic tangents."""
    return _each(x, Tensor.tanh, Tensor.tanh_)


def closeness(x: Array, steepness: float) -> Any:
    """Return ``1 - tanh(steepness · x)``, the way to reward that a distance is small."""
    if isinstance(x, Tensor) or x.dtype != np.float32:
        return 1.0 - tanh(x * steepness)
    tangents = x * number(steepness)
    torch.from_numpy(tangents).tanh_()
    return number(1.0) - tangents


def exp(x: Array) -> Any:
    """Return torch's exponentials."""
    return _each(x, Tensor.exp, Tensor.exp_)


def log(x: Array) -> Any:
    """Return torch's natural logarithms."""
    return _each(x, Tensor.log, Tensor.log_)


def sqrt(x: Array | Tensor) -> Any:
    """Return torch's square roots; in a portable process, those rounded as IEEE 754 says.

    Torch's differ from processor to processor, also where everything else of it does not: they
    begin with the processor's own estimate of 1 / √x.
    """
    if is_portable():
        return x.double().sqrt().type(x.dtype) if isinstance(x, Tensor) else np.sqrt(x)
    return _each(x, Tensor.sqrt, Tensor.sqrt_)


def cos(x: Array) -> Any:
    """Return torch's cosines (of rad)."""
    return _each(x, Tensor.cos, Tensor.cos_)


def sin(x: Array) -> Any:
    """Return torch's sines (of rad)."""
    return _each(x, Tensor.sin, Tensor.sin_)


def arccos(x: Array) -> Any:
    """Return torch's arc cosines (rad)."""
    return _each(x, Tensor.arccos, Tensor.arccos_)


def arctan2(y: Array, x: Array) -> Any:
    """Return torch's arc tangents of ``y / x``, shape (N,) (rad).

    Those of NumPy's arrays one by one, as native computes them: torch's of a batch round otherwise.
    """
    if isinstance(y, Tensor):
        return torch.atan2(y, _any(x))
    angles = y.copy()
    for a, b in zip(torch.from_numpy(angles).unbind(), torch.from_numpy(x).unbind(), strict=True):
        a.atan2_(b)
    return angles


def norm(x: Array) -> Any:
    """Return torch's Euclidean norms along the last axis."""
    if isinstance(x, Tensor):
        return torch.linalg.vector_norm(x, dim=-1)
    rows = np.ascontiguousarray(x)  # else torch adds in another order than for a single row
    norms = np.empty(rows.shape[:-1], rows.dtype)
    torch.linalg.vector_norm(torch.from_numpy(rows), dim=-1, out=torch.from_numpy(norms))
    return norms


@by_torch
def cross(x: Any, y: Any) -> Any:
    """Return torch's cross products of vectors, (..., 3)."""
    return torch.linalg.cross(x, y)


def like(x: Array, values: Any) -> Any:
    """Return numbers as an array of the kind of another, float32, on its device.

    Args:
        x: The other array.
        values: Nested tuples of numbers, whose arrays are kept and must not be changed; or lists.
    """
    if isinstance(x, Tensor):
        kept = _constant_on(x.device, _as_tuples(values))
        return kept if isinstance(values, tuple) else kept.clone()
    return _constant(values) if isinstance(values, tuple) else np.array(values, np.float32)


def doubles(x: Array, values: Sequence[Any]) -> Any:
    """Return numbers as an array of the kind of another, float64, on its device."""
    if isinstance(x, Tensor):
        return torch.tensor(values, dtype=torch.float64, device=x.device)
    return np.array(values, np.float64)


def constant(x: Array, values: Floats) -> Any:
    """Return a constant NumPy array as an array of the kind of ``x``, whose memory it may share."""
    return _kept(values, x.device) if isinstance(x, Tensor) else values


def full(x: Array, count: int, value: float) -> Any:
    """Return ``count`` times a number or a flag, as an array of the kind of ``x``."""
    if isinstance(x, Tensor):
        kind = torch.float32 if isinstance(value, float) else None
        return torch.full((count,), value, dtype=kind, device=x.device)
    return np.full(count, value, np.float32 if isinstance(value, float) else None)


@lru_cache(maxsize=4096)
def number(value: float) -> Any:
    """Return a number as a float32 array of shape (), which cannot be changed.

    It does what a plain float does, and NumPy takes half the time for it.
    """
    array = np.array(value, np.float32)
    array.flags.writeable = False
    return array


def rounded(value: float) -> float:
    """Return the float32 nearest to a number."""
    return float(np.float32(value))


def _each(
    x: Array | Tensor, function: Callable[..., Tensor], in_place: Callable[..., Tensor]
) -> Any:
    """Return what a function of torch makes of every number.

    Where it writes in place, NumPy need not take a tensor back, which takes as long as the function
    does.
    """
    if isinstance(x, Tensor):
        return function(x)
    if x.dtype.kind != "f":  # whole numbers, which have no place for what is between them
        return function(torch.from_numpy(x)).numpy()
    values = x.copy()
    in_place(torch.from_numpy(values))
    return values


@lru_cache(maxsize=4096)
def _places(numbers: Any) -> NDArray[np.intp]:
    return np.array(numbers)


@lru_cache(maxsize=4096)
def _constant(values: Any) -> Floats:
    array = np.array(values, np.float32)
    array.flags.writeable = False
    return array


# A device's copies of constants are kept: to copy one anew is to wait for the device.
_copies: dict[Any, tuple[Any, Tensor]] = {}


def _kept(values: Any, device: Any) -> Tensor:
    """Return nested tuples of numbers, or a constant array of a module, on a device."""
    key = (values if isinstance(values, tuple) else id(values)), device
    if key not in _copies:  # which holds the array, so that its number stays its own
        _copies[key] = values, torch.from_numpy(np.array(values)).to(device)
    return _copies[key][1]


@lru_cache(maxsize=4096)
def _constant_on(device: torch.device, values: Any) -> Tensor:
    return torch.tensor(values, dtype=torch.float32, device=device)


def _as_tuples(values: Any) -> Any:
    return tuple(map(_as_tuples, values)) if isinstance(values, (list, tuple)) else values


def _any(x: object) -> Any:
    return cast(Any, x)

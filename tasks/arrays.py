"""Arrays out of what users give for them, and mappings of arrays, which may be nested."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from robots import RobotLayoutsError


def array_of(value: Any, what: str, error: type[RobotLayoutsError]) -> NDArray[Any]:
    """Return a tensor, an array or nested lists of numbers as an array, which may share memory.

    Raises:
        RobotLayoutsError: ``error``, if it is none of these, or of a kind that NumPy lacks.
    """
    try:
        if isinstance(value, Tensor):
            if value.dtype is not torch.float32 and value.is_floating_point():
                value = value.double()  # exact; NumPy has not all of the short types
            return value.numpy(force=value.requires_grad or not value.is_cpu)
        return np.asarray(value)
    except (TypeError, ValueError, RuntimeError) as problem:  # sparse, quantized, meta, ragged
        raise error(f"{what} is not an array of numbers: {problem}") from None


def leaves(tree: Any, name: str = "", nothing: Any = None) -> Iterator[tuple[str, Any]]:
    """Yield what a nested mapping holds, by the path to it: ``"extra/tcp_pose"``.

    Args:
        tree: The mapping, or what one holds.
        name: What paths begin with.
        nothing: What empty mappings are said to hold, by a path that ends with a slash; None skips
            them.
    """
    if isinstance(tree, Mapping):
        if not tree and nothing is not None:
            yield f"{name}/", nothing
        for key, part in tree.items():
            yield from leaves(part, f"{name}/{key}" if name else f"{key}", nothing)
    else:
        yield name, tree


def nested(flat: Mapping[str, Any]) -> dict[str, Any]:
    """Return a mapping by ``a/b/c`` as mappings of mappings; a name ``a/b/`` is an empty one."""
    tree: dict[str, Any] = {}
    for name, value in flat.items():
        *above, last = name.split("/")
        branch = tree
        for step in above:
            branch = branch.setdefault(step, {})
        if last:
            branch[last] = value
    return tree


def stacked(rows: Sequence[Any]) -> Any:
    """Return nested mappings of arrays, all alike, or arrays, as one with a first axis more."""
    if isinstance(rows[0], Mapping):
        return {key: stacked([row[key] for row in rows]) for key in rows[0]}
    return np.stack([np.asarray(row) for row in rows])


def row_of(tree: Any, row: int) -> Any:
    """Return one row of each array of a nested mapping, or of a single array."""
    if isinstance(tree, Mapping):
        return {key: row_of(part, row) for key, part in tree.items()}
    return tree[row]

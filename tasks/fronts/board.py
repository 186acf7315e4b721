"""The batch that all workers of a vector write to: named arrays in one piece of memory."""

from __future__ import annotations

import mmap
import os
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

Arrays = dict[str, NDArray[Any]]
Shapes = Mapping[str, tuple[tuple[int, ...], str]]
"""Name → shape of one environment's entry, and dtype."""

_ALIGNMENT = 64  # bytes; two arrays never share a cache line


def board_size(shapes: Shapes, num_envs: int) -> int:
    """Return how many bytes the arrays of a batch take."""
    return sum(_bytes(shape, dtype, num_envs) for shape, dtype in shapes.values())


def lay_out(memory: Any, shapes: Shapes, num_envs: int) -> Arrays:
    """Return the arrays of a batch, each (N, …), in a writable buffer of `board_size` bytes."""
    arrays, start = Arrays(), 0
    for name, (shape, dtype) in shapes.items():
        full = (num_envs, *shape)
        count = int(np.prod(full))
        arrays[name] = np.frombuffer(memory, dtype, count, start).reshape(full)
        start += _bytes(shape, dtype, num_envs)
    return arrays


def new_shared_memory(size: int) -> int:
    """Return the file descriptor of new memory that processes can share.

    It has no name: the kernel frees it with the last process that has it open, however that ends.

    Raises:
        OSError: If there is too little memory, now rather than when it is written to.
    """
    descriptor = os.memfd_create("robot-layouts")
    try:
        os.posix_fallocate(descriptor, 0, size)
    except BaseException:
        os.close(descriptor)
        raise
    return descriptor


def map_shared_memory(descriptor: int, size: int) -> mmap.mmap:
    """Return shared memory as a buffer; closes the file descriptor."""
    try:
        return mmap.mmap(descriptor, size)
    finally:
        os.close(descriptor)


def _bytes(shape: tuple[int, ...], dtype: str, num_envs: int) -> int:
    exact = int(np.prod((num_envs, *shape))) * np.dtype(dtype).itemsize
    return max(-(-exact // _ALIGNMENT), 1) * _ALIGNMENT

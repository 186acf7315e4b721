"""The graphics driver's device: a process that draws has one, and a fork of it has none."""

from __future__ import annotations

import ctypes
import os
from typing import Any
from weakref import WeakSet

from robots import SimulationError

_owner: int | None = None  # the process that drew first, here or in what this is a fork of
_worlds: WeakSet[Any] = WeakSet()


def expect_render_device() -> None:
    """Note that this process draws, before it does.

    Raises:
        SimulationError: If it is a fork of one that did: there it would wait for ever.
    """
    global _owner
    if _owner is None:
        _owner = os.getpid()
    elif _owner != os.getpid():
        raise SimulationError(
            f"no pictures can be drawn here: process {_owner}, of which this one is a fork, drew"
            " some, and graphics drivers do not survive a fork; use spawn in the place of fork"
            ' (multiprocessing.get_context("spawn"), or context="spawn")'
        )


def outlive_forks(world: Any) -> None:
    """Let a world that draws never be freed in a fork: its driver would wait for ever there."""
    _worlds.add(world)


def _keep_worlds() -> None:
    for world in _worlds:
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(world))  # not even when Python ends


os.register_at_fork(after_in_child=_keep_worlds)

"""The graphics driver's device: a process that draws has one, and a fork of it has none."""

from __future__ import annotations

import os

from robots import SimulationError

_owner: int | None = None  # the process that drew first, here or in what this is a fork of


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

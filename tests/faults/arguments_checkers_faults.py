"""Every wrong type and number, once for each function that checks arguments.

The other files of this area only try whether each argument is checked by one of these, and its own
bounds.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from robot_layouts.core.bounds import (
    checked_choice,
    checked_flag,
    checked_number,
    checked_numbers,
    checked_whole,
)
from robots import TaskError
from tests.faults.fault import Fault

AREA = "arguments"
NAN, INF, HUGE = math.nan, math.inf, 1e300

NO_NUMBERS = (None, True, "1", b"1", (1,), {}, 1j, NAN, INF, -INF, HUGE, 10**400)
NO_WHOLES = (None, True, "1", b"1", (1,), {}, 1j, NAN, 2.5, 1.0, 10**400, np.array([2, 3]))
NO_FLAGS = (None, 0, 1, 2.5, "", "yes", [], [True], np.array([True, False]))
NO_NAMES = (5, 2.5, True, b"state", ["state"], {"a": 1}, "", "stat", np.array(["state", "rgb"]))
NO_POINTS: tuple[Any, ...] = (
    *(5, "abc", b"abc", True, (), (0, 0), (0, 0, 0, 0), (0, 0, None), (0, 0, "0"), (0, 0, True)),
    *((NAN, 0, 0), (0, INF, 0), (1e308, 0, 0), (0, -1e30, 0), (0, 0, 1e7), {0, 1, 2}, {0: 1}),
    *((1j, 0, 0), np.zeros((3, 1)), np.array(["a", "b", "c"]), (10**400, 0, 0), [[0, 0, 0]]),
)
CHECKERS: dict[str, tuple[Callable[[Any], object], tuple[Any, ...]]] = {
    "number": (lambda x: checked_number("x", x, 0.0, 1e6, TaskError), NO_NUMBERS),
    "whole number": (lambda x: checked_whole("x", x, 0, 100, TaskError), NO_WHOLES),
    "truth value": (lambda x: checked_flag("x", x, TaskError), NO_FLAGS),
    "choice": (lambda x: checked_choice("x", x, ("state", "rgb"), TaskError), NO_NAMES),
    "point": (lambda x: checked_numbers("x", x, 3, 1e6, TaskError), NO_POINTS),
}


def faults() -> Iterator[Fault]:
    """Go through this area's faults."""
    for kind, (check, values) in CHECKERS.items():
        for value in values:
            text = repr(value).replace(repr(10**400), "10**400")
            yield Fault(AREA, f"a {kind}: {text}", partial(_check, check, value))


def _check(check: Callable[[Any], object], value: Any, folder: Path) -> None:
    check(value)

"""Which cases of a parametrized test belong to `make test`; the rest run in `make test-all`."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import Any

import pytest

# Tasks of different kinds: one arm, two, many, a clone that reads its past, and one without bodies.
FEW_TASKS = ("DrawTriangle-v1", "PickCube-v1", "PushT-v1", "Relay-v1", "TwoRobotPickCube-v1")


def quick_cases(values: Iterable[Any], quick: Collection[Any] = FEW_TASKS) -> list[Any]:
    """Return parameters, or tuples of some, those that are not quick marked as long."""
    return [value if value in quick else _long(value) for value in values]


def _long(value: Any) -> Any:
    several = value if isinstance(value, tuple) else (value,)
    return pytest.param(*several, marks=pytest.mark.long)

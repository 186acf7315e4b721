"""Which cases of a parametrized test belong to `make test`; the rest run in `make test-all`."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import Any

import pytest

# Tasks of different kinds: one arm, two, many, a clone that reads its past, and one without bodies.
FEW_TASKS = ("DrawTriangle-v1", "PickCube-v1", "PushT-v1", "Relay-v1", "TwoRobotPickCube-v1")


def quick_cases(values: Iterable[Any], quick: Collection[Any] = FEW_TASKS) -> list[Any]:
    """Return parameters, those that are not quick marked as long."""
    return [v if v in quick else pytest.param(v, marks=pytest.mark.long) for v in values]

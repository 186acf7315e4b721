"""Wrong arguments of tasks: numbers that are none, names that do not exist."""

from __future__ import annotations

from collections.abc import Iterator

from tests.faults.fault import Fault

AREA = "arguments"


def faults() -> Iterator[Fault]:
    """Go through this area's faults."""
    for value in (0, -1, 2.5, "4", None):
        yield Fault(AREA, f"num_envs={value!r}", lambda folder, value=value: _make(num_envs=value))


def _make(**arguments: object) -> None:
    import tasks

    tasks.make("PickCube-v1", **arguments).close()

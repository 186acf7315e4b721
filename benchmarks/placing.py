"""``python -m benchmarks placing``: what `layouts.search` makes of ten cells, beside a ring.

The same robots stand in ``ring(radius="auto")`` and where the search puts them. Of both it measures
by `Layout.validate` how much space pairs of robots share, how near they come, and which targets
are reached.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from tqdm import tqdm

from benchmarks.records import (
    DOCS,
    Record,
    read_record,
    table,
    versions_of,
    write_page,
    write_record,
)
from layouts import Layout, ring, search
from robots import RobotRegistry

CELLS: Mapping[str, tuple[str, ...]] = {
    "two Pandas": ("panda", "panda"),
    "four Pandas": ("panda", "panda", "panda", "panda"),
    "Panda, UR5": ("panda", "ur5_gripper"),
    "Panda, xArm7, SO-100": ("panda", "xarm7", "so100"),
    "three small arms": ("so100", "so101", "koch"),
    "two xArm7, UR5": ("xarm7", "xarm7", "ur5_gripper"),
    "four mixed arms": ("panda", "ur5_gripper", "xarm7", "so100"),
    "UR3, Z1, Jaco": ("ur3_gripper", "z1", "jaco2"),
    "Panda with camera, stick": ("panda_wristcam", "panda_stick", "panda"),
    "five arms": ("panda", "xarm7", "ur3_gripper", "z1", "ur5_gripper"),
}
TARGETS, LEVELS = 12, 3  # how many, and their heights
PATIENCE = 1e6  # s; busy machines are slow
HEADINGS = (
    "cell",
    "shared: ring (m³)",
    "search (m³)",
    "times",
    "clearance: ring (cm)",
    "search (cm)",
    "reached: ring",
    "search",
    "CPU (s)",
)

Point = tuple[float, float, float]


def placing(
    *, cells: tuple[str, ...] = tuple(CELLS), seed: int = 0, out: Path = DOCS / "placing.json"
) -> int:
    """Search places for the robots of ten cells, and compare them with a ring.

    Args:
        cells: Their names; those in the record are not searched again.
        seed: Of the search.
        out: The record; the page is beside it.

    Raises:
        RobotLayoutsError: If something cannot be read or written.
    """
    record = read_record(out, versions={}, cells={})
    for name in tqdm([name for name in cells if name not in record["cells"]], disable=None):
        record["versions"] = versions_of("numpy", "python-fcl")
        record["cells"][name] = _searched(CELLS[name], seed)
        write_record(out, record)
    rows = ((name, *_cells(cell)) for name, cell in record["cells"].items())
    shown = table(HEADINGS, rows)
    write_page(out, "placing", targets=TARGETS, versions=record["versions"], table=shown)
    return 0


def targets_of(robots: Sequence[str]) -> list[Point]:
    """Return targets on a spiral about the origin, within twice the smallest robot's reach (m)."""
    reach = min(RobotRegistry.load(robot).reach for robot in robots)
    places: list[Point] = []
    for i in range(TARGETS):
        radius, angle = 0.7 * reach * math.sqrt((i + 0.5) / TARGETS), i * math.pi * (3 - 5**0.5)
        height = (0.15 + 0.1 * (i % LEVELS)) * reach
        places.append((radius * math.cos(angle), radius * math.sin(angle), height))
    return places


def _searched(robots: Sequence[str], seed: int) -> Record:
    named, targets = {f"robot{i}": robot for i, robot in enumerate(robots, 1)}, targets_of(robots)
    preset = ring(named, radius="auto")
    preset.validate()  # so that files are read, and not counted
    begun, worked = time.monotonic(), time.process_time()
    found = search(named, targets, seed=seed, patience=PATIENCE)
    return {
        "robots": list(robots),
        "seconds": round(time.monotonic() - begun, 1),
        "cpu": round(time.process_time() - worked, 1),
        "ring": _measured(preset, targets),
        "search": _measured(found, targets),
    }


def _measured(layout: Layout, targets: Sequence[Point]) -> Record:
    report = layout.validate(targets=targets)
    return {
        "clear": not any(f.serious and f.kind != "target" for f in report.findings),
        "shared": round(sum(shared.volume for shared in report.shared), 3),  # m³
        "clearance": round(min(c.noisy_distance for c in report.clearances if not c.table), 3),
        "reached": len({reach.target for reach in report.reaches if reach.reached}),
        "by": round(sum(reach.reached for reach in report.reaches) / TARGETS, 2),
        "bases": {
            name: [*placement.base_position, *placement.base_quaternion]
            for name, placement in layout.items()
        },
    }


def _cells(cell: Mapping[str, Any]) -> Iterator[str]:
    before, after = cell["ring"], cell["search"]
    yield f"{before['shared']:.2f}"
    yield f"{after['shared']:.2f}"
    yield f"{after['shared'] / before['shared']:.1f}" if before["shared"] else "–"
    for way in (before, after):
        yield f"{100 * way['clearance']:.1f}" if way["clear"] else "collides"
    for way in (before, after):
        yield f"{way['reached']} / {TARGETS}, by {way['by']:.1f}"
    yield f"{cell['cpu']:.0f}"

"""``python -m measurements.placing``: what `layouts.search` makes of ten cells, beside a ring.

The same robots stand in ``ring(radius="auto")`` and where the search puts them. Of both it measures
by `Layout.validate` how much space pairs of robots share, how near they come, and which targets
are reached. The record is JSON, and goes on where it stopped; the table is beside it as markdown.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from layouts import Layout, ring, search
from measurements.robots.record import SurveyError, versions_of
from robots import RobotRegistry
from robots.common.commands import exit_code, notice, start
from robots.common.writing import write_whole

RECORD = Path("docs/placing.json")
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
TARGETS = 12
PATIENCE = 1e6  # s; busy machines are slow
LEVELS = 3  # heights of targets

Seen = dict[str, Any]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command.

    Returns:
        0 if every cell was tried, 1 if something cannot be written.
    """
    parser = argparse.ArgumentParser(prog="python -m measurements.placing", description=__doc__)
    add = parser.add_argument
    add("--cells", nargs="+", metavar="CELL", default=list(CELLS), choices=list(CELLS))
    add("--seed", type=int, default=0, metavar="N", help="of the search (0)")
    add("--out", type=Path, default=RECORD, metavar="FILE", help="the record (%(default)s)")
    add("--pictures", type=Path, metavar="DIR", help="save a view of every layout there")
    options = parser.parse_args(arguments)
    return exit_code(lambda: _run(options))


def _run(options: argparse.Namespace) -> int:
    seen: dict[str, Any] = {"versions": versions_of("numpy", "python-fcl"), "cells": {}}
    if options.out.exists():
        seen["cells"] = _read(options.out)
    for name in options.cells:
        if name in seen["cells"]:
            continue
        seen["cells"][name] = _tried(name, options.seed, options.pictures)
        notice(f"{name}: {seen['cells'][name]}")
        write_whole(options.out, json.dumps(seen, indent=1) + "\n")
    table = options.out.with_suffix(".md")
    write_whole(table, "\n".join(markdown(seen)) + "\n")
    print(f"{options.out}, {table}: {len(seen['cells'])} cells")
    return 0


def _read(path: Path) -> dict[str, Seen]:
    try:
        return dict(json.loads(path.read_text(encoding="utf-8"))["cells"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise SurveyError(f"{path} holds no record of places: {error!r}") from error


def targets_of(robots: Sequence[str]) -> list[tuple[float, float, float]]:
    """Return targets on a spiral about the origin, within twice the smallest robot's reach (m)."""
    reach = min(RobotRegistry.load(robot).reach for robot in robots)
    places: list[tuple[float, float, float]] = []
    for i in range(TARGETS):
        radius, angle = 0.7 * reach * math.sqrt((i + 0.5) / TARGETS), i * math.pi * (3 - 5**0.5)
        height = (0.15 + 0.1 * (i % LEVELS)) * reach
        places.append((radius * math.cos(angle), radius * math.sin(angle), height))
    return places


def _tried(name: str, seed: int, pictures: Path | None) -> Seen:
    robots = {f"robot{i}": robot for i, robot in enumerate(CELLS[name], start=1)}
    targets = targets_of(CELLS[name])
    preset = ring(robots, radius="auto")
    preset.validate()  # so that files are read, and not counted
    begun, worked = time.monotonic(), time.process_time()
    found = search(robots, targets, seed=seed, patience=PATIENCE)
    taken, worked = time.monotonic() - begun, time.process_time() - worked
    seen: Seen = {"robots": list(CELLS[name]), "seconds": round(taken, 1), "cpu": round(worked, 1)}
    for way, layout in (("ring", preset), ("search", found)):
        picture = pictures and pictures / f"{name.replace(', ', ' ').replace(' ', '_')}_{way}.png"
        seen[way] = _measured(layout, targets, picture)
    return seen


def _measured(
    layout: Layout, targets: Sequence[tuple[float, float, float]], picture: Path | None
) -> Seen:
    report = layout.validate(targets=targets)
    if picture is not None:
        picture.parent.mkdir(parents=True, exist_ok=True)
        report.picture(picture)
    reached = {reach.target for reach in report.reaches if reach.reached}
    return {
        "clear": not any(f.serious and f.kind != "target" for f in report.findings),
        "shared": round(sum(shared.volume for shared in report.shared), 3),  # m³
        "clearance": round(min(c.noisy_distance for c in report.clearances if not c.table), 3),
        "reached": len(reached),
        "by": round(sum(reach.reached for reach in report.reaches) / TARGETS, 2),
        "bases": {
            name: [*placement.base_position, *placement.base_quaternion]
            for name, placement in layout.items()
        },
    }


def markdown(seen: Mapping[str, Any]) -> Iterator[str]:
    """Yield the lines of the page."""
    cells: Mapping[str, Seen] = seen["cells"]
    versions = ", ".join(f"{name} {version}" for name, version in seen["versions"].items())
    yield "# Placement search, measured"
    yield ""
    yield 'The same robots in `ring(radius="auto")` and where `layouts.search` puts them, with'
    yield f"{TARGETS} targets about the origin; `python -m measurements.placing` writes this page."
    yield "*Shared* is the sum of the shared workspaces of all pairs as `Layout.validate` measures"
    yield "them; *clearance* the least distance of two robots at their keyframes with joint noise;"
    yield "*reached* how many targets some robot reaches, and by how many robots on the average;"
    yield "*CPU* the processor time of the search, in one process."
    yield f"Made with {versions}."
    yield ""
    yield _row(
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
    yield _row("---", *["---:"] * 8)
    for name, cell in cells.items():
        yield _row(name, *_cells(cell))


def _cells(cell: Seen) -> Iterator[str]:
    before, after = cell["ring"], cell["search"]
    yield f"{before['shared']:.2f}"
    yield f"{after['shared']:.2f}"
    yield f"{after['shared'] / before['shared']:.1f}" if before["shared"] else "–"
    for way in (before, after):
        yield f"{100 * way['clearance']:.1f}" if way["clear"] else "collides"
    for way in (before, after):
        yield f"{way['reached']} / {TARGETS}, by {way['by']:.1f}"
    yield f"{cell['cpu']:.0f}"


def _row(*cells: str) -> str:
    return f"| {' | '.join(cells)} |"


if __name__ == "__main__":
    start(main)

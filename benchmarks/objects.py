"""``python -m benchmarks objects``: what every object is, how it stands, and who can hold it.

Each is put on a table for 10 s in all the ways in which it rests, and grasped and shaken by hands
of three sizes; the page shows what was seen beside a picture of all.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from hashlib import sha256
from math import degrees
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
from objects import Joint, ObjectDescriptor, ObjectRegistry
from objects.picture import save_sheet
from objects.registry import CATALOGUE
from robot_layouts.simulation.checks.objects import OPENINGS, try_rests, try_thing_grasps

HEADINGS = (
    "object",
    "size (cm)",
    "mass (kg)",
    "points",
    "joints",
    "rests",
    "drift (mm)",
    *(f"held, {opening * 100:g} cm" for opening in OPENINGS),
)
PICTURE = "images/objects.png"


def objects(
    *, objects: tuple[str, ...] = tuple(CATALOGUE), out: Path = DOCS / "objects.json"
) -> int:
    """Try objects in physics, draw all of them, and write their page.

    Args:
        objects: Their names; those that are in the record as they are now are not tried again.
        out: The record; the page is beside it.

    Raises:
        RobotLayoutsError: If something cannot be read or written.
    """
    record = read_record(out, versions={}, objects={})
    known = record["objects"]
    things = {name: ObjectRegistry.load(name) for name in objects}
    new = [n for n, thing in things.items() if known.get(n, {}).get("digest") != digest_of(thing)]
    for name in tqdm(new, disable=None):
        record["versions"] = versions_of("sapien")
        known[name] = _tried(things[name])
        record["objects"] = {one: known[one] for one in CATALOGUE if one in known}
        write_record(out, record)
    if new:
        everything = [ObjectRegistry.load(name) for name in CATALOGUE]
        save_sheet(everything, out.parent / PICTURE)
    rows = [(name, *_cells(seen)) for name, seen in record["objects"].items()]
    shown = table(HEADINGS, rows, numbers=(2, 6, 7, 8, 9))
    write_page(out, "objects", count=len(rows), versions=record["versions"], table=shown)
    return 0


def digest_of(thing: ObjectDescriptor) -> str:
    """Return what changes with a thing's shapes, rests, grasps and joints."""
    text = repr((thing.parts, sorted(thing.rests.items()), thing.grasps, *thing.joints))
    return sha256(text.encode()).hexdigest()[:16]


def _tried(thing: ObjectDescriptor) -> Record:
    rests = {seen.rest: round(seen.drift * 1e3, 3) for seen in try_rests([thing])}
    grasps: dict[str, list[int]] = {}
    for opening in OPENINGS:
        tried = try_thing_grasps(thing, opening)
        grasps[f"{opening:g}"] = [sum(one.holds for one in tried), len(tried)]
    return {
        "digest": digest_of(thing),
        "size": [round(100 * length, 1) for length in thing.extent],
        "mass": float(f"{thing.mass:.2g}"),
        "points": list(thing.points),
        "joints": {joint.name: _travel(joint) for joint in thing.joints},
        "drift": rests,
        "grasps": grasps,
    }


def _travel(joint: Joint) -> str:
    if joint.kind == "slide":
        return f"slides {100 * (joint.upper - joint.lower):.3g} cm"
    return f"turns {degrees(joint.upper - joint.lower):.0f}°"


def _cells(seen: Mapping[str, Any]) -> Iterator[str]:
    yield " × ".join(f"{length:g}" for length in seen["size"])
    yield f"{seen['mass']:g}"
    yield ", ".join(f"`{name}`" for name in seen["points"])
    yield ", ".join(f"`{name}` {travel}" for name, travel in seen.get("joints", {}).items()) or "–"
    yield ", ".join(seen["drift"])
    yield f"{max(seen['drift'].values()):.3f}"
    for held, tried in seen["grasps"].values():
        yield f"{held} / {tried}" if tried else "–"

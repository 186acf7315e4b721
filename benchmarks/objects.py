"""``python -m benchmarks objects``: what every object is, how it stands, and who can hold it.

Each is put on a table for 10 s in all the ways in which it rests, and grasped and shaken by hands
of three sizes. A page lists all of them, and one of each kind shows them, with an entry each.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from hashlib import sha256
from math import degrees
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from benchmarks.packaged import SINGLE
from benchmarks.records import (
    DOCS,
    Record,
    read_record,
    render,
    table,
    versions_of,
    write_page,
    write_record,
)
from objects import Joint, ObjectDescriptor, ObjectRegistry
from objects.packaged import PACKAGED, PackagedObject
from objects.picture import save_sheet
from objects.registry import CATALOGUE
from objects.shapes import Mesh, Shape
from robot_layouts.core.writing import write_whole
from robot_layouts.simulation.checks.objects import OPENINGS, try_rests, try_thing_grasps

HEADINGS = (
    "object",
    "size (cm)",
    "mass (kg)",
    "joints",
    "rests",
    "drift (mm)",
    *(f"held, {opening * 100:g} cm" for opening in OPENINGS),
    "held again",
)
NAMES = (*CATALOGUE, *SINGLE)
MANY = tuple(one for one in PACKAGED.values() if one.members > 1)
SEEDS = (1, 2)  # of misses and shakes
SHOWN = 10  # members of those
KINDS = {
    "containers": "Containers",
    "controls": "Controls",
    "furniture": "Things that open",
    "joining": "Things to put together",
    "stock": "Stock and tools",
    "two_handed": "Things for two hands",
    "vessels": "Vessels",
    "gymnasium_robotics": "Things of a kitchen",
    "metaworld": "Things of Meta-World",
    "pybullet": "Things of PyBullet",
    "robosuite": "Things of robosuite",
}


def objects(*, objects: tuple[str, ...] = NAMES, out: Path = DOCS / "objects.json") -> int:
    """Try objects in physics, draw those of each kind, and write their pages.

    Args:
        objects: Their names; those that are in the record as they are now are not tried again.
        out: The record; the pages are beside it.

    Raises:
        RobotLayoutsError: If something cannot be fetched, read or written.
    """
    record = read_record(out, versions={}, objects={})
    known = record["objects"]
    things = {name: ObjectRegistry.load(name) for name in objects}
    new = [
        name
        for name, thing in things.items()
        if known.get(name, {}).get("digest") != digest_of(thing) or "again" not in known[name]
    ]
    for name in tqdm(new, disable=None):
        record["versions"] = versions_of("sapien")
        known[name] = {**_described(things[name]), **_tried(things[name])}
        record["objects"] = {one: known[one] for one in NAMES if one in known}
        write_record(out, record)
    for name, thing in things.items():
        known[name] = {
            **_described(thing),
            **{key: known[name][key] for key in ("drift", "grasps", "again")},
        }
    record["objects"] = {one: known[one] for one in NAMES if one in known}
    write_record(out, record)
    pictures = out.parent / "images" / "objects"
    for kind in dict.fromkeys(kind_of(name) for name in new):
        own = [ObjectRegistry.load(name) for name in NAMES if kind_of(name) == kind]
        own += [
            one.load(seed) for one in MANY if kind_of(one.name) == kind for seed in range(SHOWN)
        ]
        save_sheet(own, pictures / f"{kind}.png")
    for kind in KINDS:
        _write_kind(out, kind, record)
    rows = [(_link(name), *_cells(seen)) for name, seen in record["objects"].items()]
    again = np.sum([seen["again"] for seen in record["objects"].values()], 0).tolist()
    counts = {
        "again": again,
        "count": len(CATALOGUE),
        "packaged": len(PACKAGED),
        "jointed": sum(bool(seen["joints"]) for seen in record["objects"].values()),
    }
    shown = table(HEADINGS, rows, numbers=(2, 5, 6, 7, 8, 9))
    write_page(out, "objects", **counts, kinds=KINDS, versions=record["versions"], table=shown)
    return 0


def kind_of(name: str) -> str:
    """Return the kind of an object: the module of its family, or its package."""
    if name in PACKAGED:
        return PACKAGED[name].package.removesuffix("_objects")
    return CATALOGUE[name].partition(":")[0].rpartition(".")[2]


def digest_of(thing: ObjectDescriptor) -> str:
    """Return what changes with a thing's shapes, rests, grasps and joints."""
    joints = [replace(joint, parts=_portable(joint.parts)) for joint in thing.joints]
    text = repr((_portable(thing.parts), sorted(thing.rests.items()), thing.grasps, *joints))
    return sha256(text.encode()).hexdigest()[:16]


def _portable(parts: Sequence[Shape]) -> tuple[Shape, ...]:
    """Return shapes without the folders that mesh files are in on this machine."""
    return tuple(
        replace(part, file=part.path.name) if isinstance(part, Mesh) else part for part in parts
    )


def _write_kind(out: Path, kind: str, record: Record) -> None:
    page = out.parent / "objects" / f"{kind}.md"
    seen = {name: one for name, one in record["objects"].items() if kind_of(name) == kind}
    entries = {name: [*_entry(one)] for name, one in seen.items()}
    entries |= {one.name: _family_entry(one) for one in MANY if kind_of(one.name) == kind}
    write_whole(page, render("objects_kind", kind=kind, title=KINDS[kind], entries=entries))


def _family_entry(one: PackagedObject) -> list[tuple[str, str]]:
    members = f"{one.members:,}, drawn by `ObjectRegistry.load({one.name!r}, seed=7)`"
    return [("what", one.about), ("members", members), ("licence", one.licence), ("from", one.file)]


def _entry(seen: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield what an entry says of an object: what, and a few words."""
    yield "what", seen["about"]
    yield "size", " × ".join(f"{length:g}" for length in seen["size"]) + " cm"
    yield "mass", f"{seen['mass']:g} kg"
    rests = (f"{rest} ({drift:.3f} mm in 10 s)" for rest, drift in seen["drift"].items())
    yield "rests", ", ".join(rests)
    for joint, travel in seen["joints"].items():
        yield "joint", f"`{joint}` {travel}"
    if seen["points"]:
        yield "points", ", ".join(f"`{point}`" for point in seen["points"])
    held = [
        f"{holds} of {tried} in a hand of {100 * float(opening):g} cm"
        for opening, (holds, tried) in seen["grasps"].items()
        if tried
    ]
    yield "grasps that hold", ", ".join(held) or "none; it is worked by pressing"
    yield "licence", seen["licence"]
    yield "from", seen["source"]


def _described(thing: ObjectDescriptor) -> Record:
    return {
        "digest": digest_of(thing),
        "about": thing.about,
        "licence": thing.licence,
        "source": thing.source,
        "size": [round(100 * length, 1) for length in thing.extent],
        "mass": float(f"{thing.mass:.2g}"),
        "points": list(thing.points),
        "joints": {joint.name: _travel(joint) for joint in thing.joints},
    }


def _tried(thing: ObjectDescriptor) -> Record:
    rests = {seen.rest: round(seen.drift * 1e3, 3) for seen in try_rests([thing])}
    grasps: dict[str, list[int]] = {}
    again = [0, 0]
    for opening in OPENINGS:
        tried = try_thing_grasps(thing, opening)
        grasps[f"{opening:g}"] = [sum(one.holds for one in tried), len(tried)]
        for seed in SEEDS:
            missed = try_thing_grasps(thing, opening, seed=seed)
            again[0] += sum(one.holds for one in missed)
            again[1] += len(missed)
    return {"drift": rests, "grasps": grasps, "again": again}


def _travel(joint: Joint) -> str:
    if joint.is_endless:
        return "turns without end"
    lower, upper = joint.limits
    if joint.kind == "slide":
        return f"slides {100 * (upper - lower):.3g} cm"
    return f"turns {degrees(upper - lower):.0f}°"


def _link(name: str) -> str:
    return f"[{name}](objects/{kind_of(name)}.md#{name})"


def _cells(seen: Mapping[str, Any]) -> Iterator[str]:
    yield " × ".join(f"{length:g}" for length in seen["size"])
    yield f"{seen['mass']:g}"
    yield ", ".join(f"`{name}` {travel}" for name, travel in seen["joints"].items()) or "–"
    yield ", ".join(seen["drift"])
    yield f"{max(seen['drift'].values()):.3f}"
    for held, tried in seen["grasps"].values():
        yield f"{held} / {tried}" if tried else "–"
    held, tried = seen["again"]
    yield f"{held} / {tried}" if tried else "–"

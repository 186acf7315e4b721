"""``python -m benchmarks packaged``: how things of packages rest, and which grasps hold them.

What their shapes suggest is tried in physics; what stands still and what holds is written to
``objects/packaged.json``, and is what users get.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from tqdm import tqdm

from objects import Grasp, ObjectDescriptor
from objects.files.grasps import MOST
from objects.packaged import MEASURED, PACKAGED, measurements
from robot_layouts.core.writing import write_whole
from robot_layouts.simulation.checks.objects import holding, try_rests

DIGITS = 6
MISSES = 11, 12  # seeds, not those by which `benchmarks objects` tries them again
ENOUGH, MANY = 20, 1000  # grasps that hold, and as many as are tried where fewer do
SINGLE = tuple(name for name, one in PACKAGED.items() if one.members == 1)


def packaged(*, objects: tuple[str, ...] = SINGLE) -> int:
    """Try things of packages in physics, and write down what holds.

    Args:
        objects: Their names; what is known of others is kept.

    Raises:
        RobotLayoutsError: If something cannot be fetched, read or written.
    """
    known = dict(measurements())
    for name in tqdm(objects, disable=None):
        known[name] = tried(PACKAGED[name].load(measured=False))
        if len(known[name]["grasps"]) < ENOUGH:
            many = PACKAGED[name].load(measured=False, most_grasps=MANY)
            known[name] = tried(many, (None, *MISSES))
        rows = (f" {json.dumps(one)}: {json.dumps(known[one])}" for one in SINGLE if one in known)
        write_whole(MEASURED, "{\n" + ",\n".join(rows) + "\n}\n")
    return 0


def tried(thing: ObjectDescriptor, seeds: Sequence[int | None] = (None,)) -> dict[str, Any]:
    """Return the rests of a thing in which it stands still, and the grasps that hold it."""
    still = {seen.rest for seen in try_rests([thing]) if seen.problem is None}
    rounded = replace(thing, grasps=tuple(_rounded(grasp) for grasp in thing.grasps))
    return {
        "rests": {name: list(turn) for name, turn in thing.rests.items() if name in still},
        "grasps": [_row(grasp) for grasp in holding(rounded, seeds=seeds).grasps[:MOST]],
    }


def _rounded(grasp: Grasp) -> Grasp:
    x, y, z = (round(number, DIGITS) for number in grasp.position)
    a, b, c, d = (round(number, DIGITS) for number in grasp.quaternion)
    return Grasp((x, y, z), (a, b, c, d), round(grasp.opening, DIGITS), grasp.part)


def _row(grasp: Grasp) -> list[Any]:
    return [*grasp.position, *grasp.quaternion, grasp.opening, grasp.part]

"""``robot-layouts objects inspect``, which also tries things in physics."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Annotated

from objects import ObjectDescriptor
from objects.inspect import OBJECT, report
from objects.named import named_object
from robot_layouts.core.cli import Seed
from robot_layouts.simulation.checks.objects import OPENINGS, try_rests, try_thing_grasps


def inspect(
    objects: Sequence[Annotated[str, OBJECT]],
    *,
    seed: Seed | None = None,
    try_: bool = False,
) -> int:
    """Print everything about objects: sizes, mass, rests, points, grasps; or try them in physics.

    Exit code: 0, or 1 if an object that is tried does not stand still, or no grasp of it holds.

    Args:
        objects: The objects.
        seed: Draws a member of each object's family (default: the usual ones).
        try_: Put the objects on a table for 10 s, grasp them with hands that open 4, 7 and 10 cm,
            shake them, and print what was seen.

    Raises:
        RobotLayoutsError: If an object does not exist, or cannot be built.
    """
    things = [named_object(name, seed) for name in objects]
    problems = 0
    for thing in things:
        print(report(thing))
        for line, wrong in _tried(thing) if try_ else ():
            print(f"  {'WRONG: ' if wrong else ''}{line}")
            problems += wrong
    return int(problems > 0)


def _tried(thing: ObjectDescriptor) -> Iterator[tuple[str, bool]]:
    """Yield what is seen of a thing in physics, a line each, and whether that is wrong."""
    for seen in try_rests([thing]):
        moved = f"{seen.drift * 1e3:.2g} mm"
        yield seen.problem or f"put down {seen.rest}, it moves by {moved}", seen.problem is not None
    held = 0
    for opening in OPENINGS:
        tried = try_thing_grasps(thing, opening)
        holds = sum(grasp.holds for grasp in tried)
        held += holds
        yield f"a hand of {opening * 100:g} cm holds it in {holds} of {len(tried)} grasps", False
    if thing.grasps and not held:
        yield "no grasp holds it", True

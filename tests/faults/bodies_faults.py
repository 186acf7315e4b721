"""Bodies and shapes that cannot be: refused where they are declared."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from robots import RobotLayoutsError
from tasks.language import bodies
from tests.faults.fault import Fault

AREA = "bodies"
NO_LENGTH = (0, -1, -1e-9, 1e-300, 1e300, math.nan, math.inf, -math.inf, True, "0.1", None, 1j)
NO_LENGTHS = (*NO_LENGTH, 0.1, (), (0.1, 0.1), (0.1,) * 4, "abc", {}, (0.1, math.nan, 0.1))
NO_DENSITY = (0, -1000.0, 1e300, math.nan, math.inf, "heavy", None)
NO_COLOR = (
    *((), (1, 0, 0), (1, 0, 0, 1, 0), (2, 0, 0, 1), (0, -0.1, 0, 1), (0, 0, 0, math.nan)),
    *("red", 0.5, None, (255, 0, 0, 255), ("1", 0, 0, 1)),
)
NO_PLACE = ((), (0, 0), (0, 0, math.nan), (0, 0, 1e300), "origin", 0.0, (0, 0, None))
NO_TURN = ((0, 0, 0, 0), (1, 0, 0), (2, 0, 0, 0), (1, 0, 0, math.nan), "up", None)
NO_FRICTION = (0.3, -1, "rough", (0.3, 0.3))
NO_KIND = ("moving", None, 3, ["dynamic"], "Dynamic")
NO_FLAG = (1, 0.0, "yes", None)


def faults() -> Iterator[Fault]:
    """Go through this area's faults."""
    for name, arguments, field, values in _wrong():
        for value in values:
            what = f"{name}({field}={value!r})"
            yield Fault(AREA, what, partial(_declare, name, {**arguments, field: value}))


def _wrong() -> Iterator[tuple[str, dict[str, Any], str, tuple[Any, ...]]]:
    """Go through what is declared: class, good arguments, and a field with values it refuses."""
    cube, box, mesh = {"half_size": 0.1}, {"half_size": (0.1,) * 3}, {"file": "cube.obj"}
    round_sizes = {"radius": 0.1, "half_length": 0.1}
    for name in ("Cube", "Ball", "Goal", "Target", "Sphere"):
        yield name, {}, "half_size" if name == "Cube" else "radius", NO_LENGTH
    for name in ("Cuboid", "Box"):
        yield name, {}, "half_size", NO_LENGTHS
    for name in ("Capsule", "Cylinder"):
        for field in round_sizes:
            yield name, round_sizes, field, NO_LENGTH
    for field in ("half_length", "half_width"):
        yield "Peg", {"half_length": 0.1, "half_width": 0.01}, field, NO_LENGTH
    yield "Compound", {}, "parts", ((), 5, (None,), "box")
    yield "Object", {"thing": "mug"}, "scale", NO_LENGTH
    yield "Object", {"thing": "mug"}, "seed", (2.5, "7", math.nan)
    yield "Object", {}, "thing", (5, None, "", b"mug", ["mug"])
    yield "ConvexHull", {}, "corners", (*NO_LENGTHS, ((0.0,) * 3,) * 4, ((0.0,) * 3,) * 70)
    for name, arguments in (("Cube", cube), ("Box", box)):
        yield name, arguments, "density", NO_DENSITY
        yield name, arguments, "color", NO_COLOR
        yield name, arguments, "friction", NO_FRICTION
    yield "Cube", cube, "start", NO_PLACE
    yield "Cube", cube, "kind", NO_KIND
    yield "Cube", cube, "spawn", ((0, 0), 1, "here")
    yield "Box", box, "position", NO_PLACE
    yield "Box", box, "quaternion", NO_TURN
    yield "Box", box, "collides", NO_FLAG
    yield "Mesh", mesh, "scale", NO_LENGTHS
    yield "Mesh", {}, "file", (5, None, "", b"cube.obj", "a\0b")
    yield "Floor", {"texture": "wood.png"}, "size", (0, -1, 2.5, 1e9, True, None)
    yield "Floor", {"texture": "wood.png"}, "tile", NO_LENGTH
    yield "Finish", {}, "roughness", (-0.1, 1.1, math.nan, "matt", None)
    yield "Table", {}, "textured", NO_FLAG


def _declare(name: str, arguments: dict[str, Any], _: Path) -> None:
    from objects import shapes

    make: Callable[..., Any] = getattr(bodies, name, None) or getattr(shapes, name)
    with pytest.raises(RobotLayoutsError, match=f"^{name}: ") as caught:
        make(**arguments)
    raise caught.value

"""What a check of a layout is given: targets, and the tops of tables."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

from layouts.arrangement import Arrangement
from layouts.frames import table_outlines
from layouts.validation.findings import Point
from robot_layouts.core.bounds import shown
from robots import LayoutError

Rectangle = tuple[float, float, float, float]  # x_min, y_min, x_max, y_max (m)
Targets = Mapping[str, Sequence[float]] | Sequence[Sequence[float]]


def table_tops(layout: Arrangement, table: Rectangle | None) -> dict[str, tuple[Point, ...]]:
    """Return the corners of each table's top (m): those of the layout's frames, and the one given.

    The one given takes the place of a frame called ``table``.
    """
    tops: dict[str, tuple[Point, ...]] = {
        name: tuple(map(tuple, corners))
        for name, corners in table_outlines(layout.frame_poses).items()
    }
    if table is not None:
        x_min, y_min, x_max, y_max = table
        outline = ((x_min, y_min), (x_max, y_min), (x_max, y_max), (x_min, y_max))
        tops["table"] = tuple((x, y, 0.0) for x, y in outline)
    return tops


def named_targets(targets: Targets) -> dict[str, tuple[float, ...]]:
    """Return targets by name; those in a list are called by their number.

    Raises:
        LayoutError: If one is no place, or they come neither by name nor in order.
    """
    if isinstance(targets, str) or not isinstance(targets, Iterable):
        raise LayoutError(
            f"targets is {shown(targets)}; it takes places by name or in order:"
            " {'cube': (0.4, 0.0, 0.1)}, in m"
        )
    named = (
        dict(targets)
        if isinstance(targets, Mapping)
        else {f"target {i}": target for i, target in enumerate(targets, start=1)}
    )
    return {name: _target(name, numbers) for name, numbers in named.items()}


def _target(name: str, numbers: Sequence[float]) -> tuple[float, ...]:
    try:
        target = tuple(float(x) for x in numbers)
    except (TypeError, ValueError):
        target = ()
    if len(target) not in (3, 7) or not all(math.isfinite(x) for x in target):
        raise LayoutError(
            f"target {name!r} is {numbers!r}; it takes x, y, z (m), or these and w, x, y, z of the"
            " TCP's orientation"
        )
    length = math.hypot(*target[3:])
    if target[3:] and abs(length - 1) > 1e-3:
        raise LayoutError(
            f"the quaternion {target[3:]} of target {name!r} has length {length:.4g}; a rotation"
            " has length 1 (order w, x, y, z)"
        )
    return (*target[:3], *(x / length for x in target[3:]))

"""Refuses layouts whose robots collide, unless `check_layout` is False."""

from __future__ import annotations

import warnings
from functools import lru_cache

from layouts import Layout
from robots import LayoutError, MissingPackageError
from tasks.engine.task import Task

Rectangle = tuple[float, float, float, float]


def refuse_collisions(layout: Layout, table: Rectangle | None = None) -> None:
    """Refuse a layout whose robots collide with each other, themselves or a table.

    Looks at their keyframes and at some draws of joint noise. The verdict on a layout is
    remembered. Where python-fcl is not installed it cannot look, and warns instead.

    Args:
        layout: The layout; the tables among its frames count.
        table: Outline of the task's own table, whose top is at z = 0: x_min, y_min, x_max, y_max
            (m); None if it has none.

    Raises:
        LayoutError: If robots collide; names the links, and says what to change.
        AssetError: If robot files cannot be found.
    """
    try:
        collisions = _collisions(layout, table)
    except MissingPackageError as error:
        warnings.warn(
            f"the layout is built unchecked: {error} (or say so, with check_layout=False)",
            stacklevel=2,
        )
        return
    if collisions:
        raise LayoutError(
            f"the robots of this layout collide:\n{collisions}\n"
            "check_layout=False builds it all the same; layout.validate() gives the details"
        )


def is_tested(cls: type[Task], layout: Layout) -> bool:
    """Tell whether a layout is the own one of a task of this library, which its tests check."""
    return cls.__module__.startswith("tasks.") and layout == cls.layout


@lru_cache(maxsize=256)
def _collisions(layout: Layout, table: Rectangle | None) -> str:
    findings = layout.validate(workspaces=False, table=table).findings
    kinds = ("collision", "self-collision", "table")
    return "\n".join(str(found) for found in findings if found.serious and found.kind in kinds)

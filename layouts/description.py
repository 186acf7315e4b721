"""A layout as a table of text: who stands where, and which action numbers are whose."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from robot_layouts.core.quoting import columns
from robot_layouts.kinematics.quaternions import yaw_degrees

if TYPE_CHECKING:
    from layouts.arrangement import Arrangement
    from layouts.placement import Placement

HEADS = ("#", "name", "robot", "action", "base x, y, z (m)", "facing", "keyframe", "reach (m)")


def describe(layout: Arrangement) -> str:
    """Return a headline and one line per robot, or per limb of one, in action order.

    "facing" is the turn about z from the world's +x to where the robot reaches out at home
    (degrees), or the wxyz quaternion of that turn if it tilts the base. "on" is what a robot hangs
    on, where one hangs.
    """
    parts, split = layout.parts, layout.action_split
    modes = layout.present_modes
    hanging = any(placement.on is not None for placement in layout.values())
    rows = [
        (
            str(number),
            name,
            placement.robot.name,
            action_text(split[name]),
            ", ".join(decimal(x) for x in placement.base_position),
            facing_text(placement),
            placement.start_keyframe or "–",
            f"{placement.robot.reach:g}",
            *([layout[layout.owner(name)].on or "–"] if hanging else []),
            *([_mode_text(name, layout.owner(name), modes)] if modes else []),
        )
        for number, (name, placement) in enumerate(parts.items(), start=1)
    ]
    heads = (*HEADS, *(["on"] if hanging else []), *(["control mode"] if modes else []))
    return "\n".join([headline(layout), *columns([heads, *rows])])


def _mode_text(name: str, owner: str, modes: Mapping[str, str | None]) -> str:
    return modes.get(name, modes.get(owner, "–")) or "none of its own"


def headline(layout: Arrangement) -> str:
    """Return how many robots and action numbers a layout has, in words."""
    robots = "1 robot" if len(layout) == 1 else f"{len(layout)} robots"
    return f"{robots}, {layout.action_dim} action numbers"


def action_text(numbers: slice) -> str:
    """Return a robot's slice of the flat action as it is written in code: ``0:8``."""
    return f"{numbers.start}:{numbers.stop}"


def facing_text(placement: Placement) -> str:
    """Return where a robot faces: degrees if its base is upright, a wxyz quaternion if not."""
    yaw = yaw_degrees(placement.facing)
    if yaw is not None:
        return f"{decimal(yaw, digits=1)}°"
    return f"wxyz {', '.join(decimal(x) for x in placement.facing)}"


def decimal(value: float, digits: int = 3) -> str:
    """Round to ``digits`` decimals and drop trailing zeros; there is no minus zero."""
    return f"{round(value, digits) + 0.0:g}"

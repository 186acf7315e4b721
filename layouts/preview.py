"""A layout as a table of text, and as a picture from above: bases, headings, reach, overlaps."""

from __future__ import annotations

import io
import math
from collections.abc import Mapping, Sequence
from html import escape
from itertools import accumulate
from typing import TYPE_CHECKING

import numpy as np

from layouts.frames import Rectangle, table_tops
from robot_layouts.core.figures import COLOURS, FAINT, INK, blank_figure
from robot_layouts.core.quoting import columns, cut
from robot_layouts.kinematics.quaternions import forward, yaw_degrees
from robots import MissingPackageError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from layouts.arrangement import Arrangement
    from layouts.placement import Placement


HEADS = ("#", "name", "robot", "action", "base x, y, z (m)", "facing", "keyframe", "reach (m)")
MOST_IN_NOTEBOOKS = 64  # robots in a notebook's picture
NO_METADATA = dict.fromkeys(("Creator", "Date", "Format", "Type"))
TABLE = "#EFE6D8"
WIDTH = 8.0  # inches; 1200 pixels
LEFT, RIGHT, ABOVE, BELOW = 0.75, 0.25, 0.5, 0.7  # around the plan (inches)
MARGIN = 0.06  # free space on each side of the robots, in shares of the plan's larger side
HEADING = 0.085  # length of the arrows, in the same shares
PLAN_HEIGHTS = (3.5, 6.5)  # smallest and largest height of the plan (inches)
ROW_HEIGHT = 0.3  # of the list under the plan (inches)
LIST_START, LIST_WIDTH = 0.12, 0.87  # of the list's words, in shares of the picture's width
LIST_SIZE, LIST_LETTERS = 10.5, 78  # of its letters (points), and how many of these fit on a line
LONGEST_NAME, LONGEST_ROBOT = 16, 24  # letters
TILE = 241  # grid points per side, from which the overlap is drawn


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


def layout_html(layout: Arrangement) -> str:
    """Return what notebooks show of a layout: an SVG; its table if that cannot be drawn.

    That is where matplotlib is missing, or the layout is large.
    """
    text = f"<pre>{escape(str(layout))}</pre>"
    if len(layout) > MOST_IN_NOTEBOOKS:
        return text
    try:
        figure, file = draw(layout), io.StringIO()
    except MissingPackageError:
        return text
    from matplotlib import rc_context

    with rc_context({"svg.fonttype": "none"}):  # letters stay letters, a tenth of the size
        figure.savefig(file, format="svg", metadata=NO_METADATA)
    svg = file.getvalue()
    return f'<div style="max-width: 640px">{svg[svg.index("<svg") :]}</div>'


def draw(layout: Arrangement, table: Rectangle | None = None) -> Figure:
    """Return the figure that `layouts.Layout.preview` saves.

    Args:
        layout: What to draw.
        table: Outline of a table, as x_min, y_min, x_max, y_max (m).

    Raises:
        MissingPackageError: If matplotlib is not installed.
    """
    bounds = _bounds(layout, table)
    plan_width = WIDTH - LEFT - RIGHT
    plan_height = plan_width * (bounds[3] - bounds[1]) / (bounds[2] - bounds[0])
    plan_height = min(max(plan_height, PLAN_HEIGHTS[0]), PLAN_HEIGHTS[1])
    list_height = ROW_HEIGHT * (len(layout) + 1.5)
    height = ABOVE + plan_height + BELOW + list_height

    figure = blank_figure("a preview", (WIDTH, height))
    bottom = (BELOW + list_height) / height
    plan = figure.add_axes((LEFT / WIDTH, bottom, plan_width / WIDTH, plan_height / height))
    _draw_plan(plan, layout, _stretched(bounds, plan_width / plan_height), table)
    _draw_list(figure.add_axes((0.0, 0.0, 1.0, list_height / height)), layout)
    return figure


def _bounds(layout: Arrangement, table: Rectangle | None) -> Rectangle:
    """Return the outline of everything drawn, with a margin (m)."""
    boxes: list[Rectangle] = []
    for corners in table_tops(layout.frame_poses, table).values():
        boxes += [(x, y, x, y) for x, y, _ in corners]
    for placement in layout.values():
        x, y, _ = placement.base_position
        reach = placement.robot.reach
        boxes.append((x - reach, y - reach, x + reach, y + reach))
    x_min, y_min = (min(box[i] for box in boxes) for i in (0, 1))
    x_max, y_max = (max(box[i] for box in boxes) for i in (2, 3))
    margin = MARGIN * max(x_max - x_min, y_max - y_min)
    return (x_min - margin, y_min - margin, x_max + margin, y_max + margin)


def _stretched(bounds: Rectangle, aspect: float) -> Rectangle:
    """Widen or heighten bounds (m) about their centre until width / height is ``aspect``."""
    x_min, y_min, x_max, y_max = bounds
    width, height = x_max - x_min, y_max - y_min
    more_width = max(aspect * height - width, 0) / 2
    more_height = max(width / aspect - height, 0) / 2
    return (x_min - more_width, y_min - more_height, x_max + more_width, y_max + more_height)


def _draw_plan(plan: Axes, layout: Arrangement, bounds: Rectangle, table: Rectangle | None) -> None:
    draw_tables(plan, table_tops(layout.frame_poses, table))
    if _draw_overlap(plan, layout, bounds):
        plan.set_title("grey: within reach of two or more", loc="right", color=FAINT, fontsize=10)
    plan.set_xlim(bounds[0], bounds[2])
    plan.set_ylim(bounds[1], bounds[3])
    arrow = HEADING * max(bounds[2] - bounds[0], bounds[3] - bounds[1])
    for index, (name, placement) in enumerate(layout.items()):
        _draw_robot(plan, index, name, placement, arrow)
    style_plan(plan, headline(layout))


def style_plan(plan: Axes, title: str) -> None:
    """Draw a view from above to scale, with a title, its axes and a grid."""
    plan.set_title(title, loc="left", color=INK, fontsize=13, fontweight="bold")
    plan.set_xlabel("x (m)", color=INK)
    plan.set_ylabel("y (m)", color=INK)
    plan.set_aspect("equal")
    plan.grid(color="#DDDDDD", linewidth=0.6)
    plan.set_axisbelow(True)
    plan.tick_params(colors=INK, labelsize=9, length=0)
    for spine in plan.spines.values():
        spine.set_color("#BBBBBB")


def draw_tables(plan: Axes, tops: Mapping[str, Sequence[Sequence[float]]]) -> None:
    """Draw tables from above, by the corners of their tops (m)."""
    from matplotlib.patches import Polygon

    for corners in tops.values():
        outline = [(x, y) for x, y, _ in corners]
        plan.add_patch(Polygon(outline, facecolor=TABLE, edgecolor="#C9B99B", zorder=0.5))


def write_beside(
    plan: Axes,
    place: Sequence[float],
    way: Sequence[float],
    text: str,
    colour: str,
    *,
    size: float,
    gap: float,
    zorder: int,
    halo: float,
    weight: str = "normal",
) -> None:
    """Write beside a place in a view from above.

    Args:
        plan: The view.
        place: Where, (2,) (m).
        way: To which side of it, a unit vector, (2,).
        text: What to write.
        colour: Of the letters.
        size: Of the letters (points).
        gap: From the place (points).
        zorder: Among all that is drawn.
        halo: Opacity of the white around the letters.
        weight: Of the letters.
    """
    from matplotlib.patheffects import withStroke

    x, y = way
    plan.annotate(
        text,
        xy=(float(place[0]), float(place[1])),
        xytext=(gap * x, gap * y),
        textcoords="offset points",
        color=colour,
        fontsize=size,
        fontweight=weight,
        ha="right" if x < -0.5 else "left" if x > 0.5 else "center",
        va="top" if y < -0.5 else "bottom" if y > 0.5 else "center",
        path_effects=[withStroke(linewidth=3, foreground="white", alpha=halo)],
        zorder=zorder,
    )


def _draw_overlap(plan: Axes, layout: Arrangement, bounds: Rectangle) -> bool:
    """Shade what at least two robots reach, darker where more do; return whether any is."""
    x, y = np.meshgrid(
        np.linspace(bounds[0], bounds[2], TILE), np.linspace(bounds[1], bounds[3], TILE)
    )
    inside = np.sort(
        [
            p.robot.reach - np.hypot(x - p.base_position[0], y - p.base_position[1])
            for p in layout.values()
        ],
        axis=0,
    )
    # The k-th largest margin is positive exactly where k robots or more reach.
    shared = [margin for margin in inside[:-1] if margin.max() > 0]
    for margin in shared:
        plan.contourf(x, y, margin, levels=[0, np.inf], colors=[INK], alpha=0.13, zorder=0.8)
    return bool(shared)


def _draw_robot(plan: Axes, index: int, name: str, placement: Placement, arrow: float) -> None:
    """Draw reach, heading (an arrow of the given length in m), base and name."""
    from matplotlib.patches import Circle

    colour = COLOURS[index % len(COLOURS)]
    x, y, _ = placement.base_position
    reach = placement.robot.reach
    ahead_x, ahead_y, _ = forward(placement.facing)
    plan.add_patch(Circle((x, y), reach, facecolor=colour, alpha=0.07, edgecolor="none", zorder=1))
    plan.add_patch(Circle((x, y), reach, fill=False, edgecolor=colour, linewidth=1.6, zorder=2))
    if math.hypot(ahead_x, ahead_y) > 0.1:  # a base that faces up or down has no heading
        plan.annotate(
            "",
            xy=(x + arrow * ahead_x, y + arrow * ahead_y),
            xytext=(x, y),
            arrowprops={
                "arrowstyle": "-|>",
                "color": colour,
                "linewidth": 2.6,
                "mutation_scale": 18,
                "shrinkA": 0,
                "shrinkB": 0,
            },
            zorder=3,
        )
    _draw_base(plan, x, y, index)
    _write_name(plan, (x, y), (-ahead_x, -ahead_y), cut(name, LONGEST_NAME))


def _draw_base(axes: Axes, x: float, y: float, index: int) -> None:
    """Draw a numbered disc, the same in the plan and in the list."""
    colour = COLOURS[index % len(COLOURS)]
    axes.plot(
        x,
        y,
        "o",
        markersize=16,
        color="white",
        markeredgecolor=colour,
        markeredgewidth=2.6,
        zorder=4,
    )
    axes.text(
        x,
        y,
        str(index + 1),
        color=INK,
        fontsize=9.5,
        fontweight="bold",
        ha="center",
        va="center_baseline",
        zorder=5,
    )


def _write_name(
    plan: Axes, base: tuple[float, float], behind: tuple[float, float], name: str
) -> None:
    """Write a robot's name behind its back, where its arm is least, or below if it fits only so."""
    length = math.hypot(*behind)
    x, y = (0.0, -1.0) if length <= 0.1 else (behind[0] / length, behind[1] / length)
    low, high = plan.get_xlim()
    room = (base[0] - low if x < 0 else high - base[0]) / (high - low)  # shares of the plan
    if abs(x) > 0.5 and room < (14 + 8.5 * len(name)) / (72 * (WIDTH - LEFT - RIGHT)):
        x, y = 0.0, -1.0
    write_beside(plan, base, (x, y), name, INK, size=12, gap=14, zorder=6, halo=0.8, weight="bold")


def _draw_list(listing: Axes, layout: Arrangement) -> None:
    """List name, robot, action numbers and pose of every robot under the plan."""
    heads = ("name", "robot", "action", "base x, y, z (m)", "facing", "reach (m)")
    rows = [heads, *(_cells(layout, name) for name in layout)]
    widths = [max(map(len, column)) + 2 for column in zip(*rows, strict=True)]
    places = [LIST_START + LIST_WIDTH * x / sum(widths) for x in accumulate(widths, initial=0)]
    size = min(LIST_SIZE, LIST_SIZE * LIST_LETTERS / sum(widths))
    listing.set_xlim(0, 1)
    listing.set_ylim(len(layout) + 0.9, -0.6)
    listing.axis("off")
    for row, cells in enumerate(rows):
        if row:
            _draw_base(listing, LIST_START - 0.035, row, row - 1)
        for x, cell in zip(places, cells, strict=False):
            colour = INK if row else FAINT
            listing.text(x, row, cell, color=colour, fontsize=size, va="center_baseline")


def _cells(layout: Arrangement, name: str) -> tuple[str, ...]:
    placement = layout[name]
    return (
        cut(name, LONGEST_NAME),
        cut(placement.robot.name, LONGEST_ROBOT),
        action_text(layout.robot_actions[name]),
        ", ".join(decimal(x) for x in placement.base_position),
        "tilted" if yaw_degrees(placement.facing) is None else facing_text(placement),
        decimal(placement.robot.reach),
    )

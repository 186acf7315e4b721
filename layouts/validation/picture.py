"""The picture of a report: links from above, with clearances, overlaps and targets marked."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from layouts.description import decimal, headline
from layouts.preview import LONGEST_NAME, TABLE
from layouts.validation.findings import Clearance, Results, length_text
from robot_layouts.core.figures import COLOURS, FAINT, INK, SUPPORTED, blank_figure
from robot_layouts.core.quoting import cut
from robot_layouts.core.writing import written_whole
from robot_layouts.kinematics.rotations import Floats
from robots import LayoutError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

GOOD, BAD, NARROW = "#1B7837", "#B2182B", "#B35806"

WIDTH, HEIGHT = 10.0, 8.5  # inches; 1500 × 1275 pixels
MARGIN = 0.08  # free space around the robots, in shares of the plan's larger side
GAP = 10  # points, between what is drawn and its name
SHOWN_FINDINGS, LONGEST_FINDING = 3, 125  # findings; letters of one


def save_picture(report: Results, path: str | os.PathLike[str]) -> Path:
    """Draw a report and save the picture, whole or not at all; see `Report.picture`."""
    target = Path(path)
    if target.suffix.lower() not in SUPPORTED:
        raise LayoutError(
            f"cannot save a picture as {target.name!r}; the name must end in"
            f" {', '.join(SUPPORTED[:-1])} or {SUPPORTED[-1]}"
        )
    figure = draw(report)
    with written_whole(target) as unfinished:
        figure.savefig(unfinished, format=target.suffix[1:].lower())
    return target


def draw(report: Results) -> Figure:
    """Return the figure that `save_picture` saves.

    Raises:
        MissingPackageError: If matplotlib is not installed.
    """
    figure = blank_figure("a picture", (WIDTH, HEIGHT))
    lines = _captions(report)
    below = 0.1 + 0.028 * len(lines)
    plan = figure.add_axes((0.08, below, 0.89, 0.93 - below))
    _draw_tables(plan, report)
    for index, name in enumerate(report.layout):
        _draw_robot(plan, report, index, name)
    centre = np.mean([p.base_position[:2] for p in report.layout.values()], axis=0)
    for clearance in _nearest_neighbours(report):
        _draw_clearance(plan, clearance, centre)
    _draw_overlaps(plan, report)
    for name, position in report.targets.items():
        _draw_target(plan, report, name, position)
    _frame(plan, report)
    for row, (text, colour) in enumerate(lines):
        figure.text(0.08, 0.028 * (len(lines) - row) - 0.008, text, color=colour, fontsize=9.5)
    return figure


def _draw_tables(plan: Axes, report: Results) -> None:
    from matplotlib.patches import Polygon

    for corners in report.tables.values():
        outline = np.array(corners)[:, :2]
        plan.add_patch(Polygon(outline, facecolor=TABLE, edgecolor="#C9B99B", zorder=0.5))


def _draw_robot(plan: Axes, report: Results, index: int, name: str) -> None:
    """Draw each hull's outline from above, the base, and the name below it."""
    from matplotlib.patches import Polygon

    colour = COLOURS[index % len(COLOURS)]
    for corners in report.outlines[name]:
        outline = _outline(np.array(corners)[:, :2])
        plan.add_patch(Polygon(outline, facecolor=colour, alpha=0.16, edgecolor="none", zorder=2))
        plan.add_patch(Polygon(outline, fill=False, edgecolor=colour, linewidth=0.9, zorder=3))
    x, y, _ = report.layout[name].base_position
    plan.plot(x, y, "o", color="white", markeredgecolor=colour, markersize=8, zorder=4)
    place, behind = _behind(report, name)
    _write(plan, place, behind, cut(name, LONGEST_NAME), colour, size=11, weight="bold")


def _behind(report: Results, name: str) -> tuple[Floats, Floats]:
    """Return the end of a robot's back (m), and the direction from its base to there."""
    base = np.array(report.layout[name].base_position[:2])
    corners = np.array([c[:2] for hull in report.outlines[name] for c in hull] or [base]) - base
    ahead = corners.mean(axis=0)
    length = float(np.linalg.norm(ahead))
    behind = -ahead / length if length > 0.02 else np.array([0.0, -1.0])
    return base + behind * float((corners @ behind).max()), behind


def _nearest_neighbours(report: Results) -> list[Clearance]:
    """Return, without repetition, the least clearance that each robot has from another."""
    chosen: list[Clearance] = []
    for name in report.layout:
        own = [c for c in report.clearances if name in c.between and not c.table]
        least = min(own, key=lambda clearance: clearance.distance, default=None)
        if least is not None and least.distance > 0 and least not in chosen:
            chosen.append(least)
    return chosen


def _draw_clearance(plan: Axes, clearance: Clearance, centre: Floats) -> None:
    """Join the nearest points of two robots, and write their distance on the outer side."""
    (x, y, _), (to_x, to_y, _) = clearance.points
    colour = NARROW if clearance.noisy_distance < 0.02 else INK
    plan.plot([x, to_x], [y, to_y], "-", color=colour, linewidth=1.4, zorder=6)
    plan.plot([x, to_x], [y, to_y], "o", color=colour, markersize=3, zorder=6)
    along, middle = np.array([to_x - x, to_y - y]), np.array([x + to_x, y + to_y]) / 2
    beside = np.array([-along[1], along[0]]) / max(float(np.linalg.norm(along)), 1e-9)
    outwards = round(float(beside @ (middle - centre)), 3)
    beside *= 1 if (outwards, *beside[::-1]) > (0, 0, 0) else -1
    _write(plan, middle, beside, length_text(clearance.distance), colour, size=9)


def _draw_overlaps(plan: Axes, report: Results) -> None:
    for finding in report.findings:
        for number, pair in enumerate(finding.links):
            x, y, _ = pair.point
            deepest = number == 0 and finding.serious
            plan.plot(
                x,
                y,
                "X",
                color=BAD if finding.serious else NARROW,
                markeredgecolor="white",
                markersize=13 if deepest else 6,
                alpha=1.0 if deepest else 0.6,
                zorder=8 if deepest else 7,
            )


def _draw_target(plan: Axes, report: Results, name: str, position: tuple[float, ...]) -> None:
    own = [reach for reach in report.reaches if reach.target == name]
    reached = any(reach.reached for reach in own)
    colour = GOOD if reached else BAD
    plan.plot(*position[:2], "*", color=colour, markeredgecolor="white", markersize=15, zorder=8)
    _write(plan, np.array(position[:2]), np.array([0.0, 1.0]), name, colour, size=9)
    for reach in own:
        if reach.reached:
            x, y, _ = report.layout.arm(reach.robot).base_position
            plan.plot([x, position[0]], [y, position[1]], ":", color=GOOD, linewidth=1, zorder=1)


def _write(
    plan: Axes,
    place: Floats,
    way: Floats,
    text: str,
    colour: str,
    *,
    size: float,
    weight: str = "normal",
) -> None:
    """Write beside a place (m), on the side that a unit vector points to."""
    from matplotlib.patheffects import withStroke

    x, y = way.tolist()
    plan.annotate(
        text,
        xy=(float(place[0]), float(place[1])),
        xytext=(GAP * x, GAP * y),
        textcoords="offset points",
        color=colour,
        fontsize=size,
        fontweight=weight,
        ha="right" if x < -0.5 else "left" if x > 0.5 else "center",
        va="top" if y < -0.5 else "bottom" if y > 0.5 else "center",
        path_effects=[withStroke(linewidth=3, foreground="white", alpha=0.85)],
        zorder=9,
    )


def _frame(plan: Axes, report: Results) -> None:
    """Show robots and targets with a margin, to scale, under a title with the verdict."""
    points = [corner[:2] for hulls in report.outlines.values() for hull in hulls for corner in hull]
    points += [position[:2] for position in report.targets.values()]
    points += [tuple(_behind(report, name)[0]) for name in report.layout]
    low, high = np.min(points, axis=0), np.max(points, axis=0)
    margin = MARGIN * float((high - low).max())
    middle, half = (low + high) / 2, (high - low) / 2 + margin
    box = plan.get_window_extent()
    half = np.maximum(half, half[::-1] * (box.width / box.height, box.height / box.width))
    plan.set_xlim(middle[0] - half[0], middle[0] + half[0])
    plan.set_ylim(middle[1] - half[1], middle[1] + half[1])
    plan.set_aspect("equal")
    verdict = "ok" if report.ok else "not ok"
    colour = GOOD if report.ok else BAD
    plan.set_title(headline(report.layout), loc="left", color=INK, fontsize=13, fontweight="bold")
    plan.set_title(verdict, loc="right", color=colour, fontsize=13, fontweight="bold")
    plan.set_xlabel("x (m)", color=INK)
    plan.set_ylabel("y (m)", color=INK)
    plan.grid(color="#DDDDDD", linewidth=0.6)
    plan.set_axisbelow(True)
    plan.tick_params(colors=INK, labelsize=9, length=0)
    for spine in plan.spines.values():
        spine.set_color("#BBBBBB")


def _captions(report: Results) -> list[tuple[str, str]]:
    """Return the first findings and what the marks mean, each with its colour."""
    lines = [
        (cut(finding.what, LONGEST_FINDING), BAD if finding.serious else NARROW)
        for finding in report.findings[:SHOWN_FINDINGS]
    ]
    hidden = len(report.findings) - len(lines)
    if hidden:
        lines.append((f"and {decimal(hidden)} more", FAINT))
    marks = "links' hulls at the keyframes; lines: to the nearest neighbour"
    marks += "; ✕: overlaps" * any(finding.links for finding in report.findings)
    marks += "; stars: targets, dotted to who reaches them" * bool(report.targets)
    return [*lines, (marks, FAINT)]


def _outline(points: Floats) -> Floats:
    """Return the corners of the convex hull of points in the plane, in order, (n, 2)."""
    from scipy.spatial import ConvexHull

    return points[ConvexHull(points).vertices]

"""What a check of a layout found, as data, as text and as a picture."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from layouts.arrangement import Arrangement
from layouts.preview import LONGEST_NAME, decimal, draw_tables, headline, style_plan, write_beside
from layouts.validation.findings import (
    Clearance,
    Finding,
    Point,
    SharedWorkspace,
    TargetReach,
    length_text,
    reach_text,
)
from robot_layouts.core.figures import COLOURS, FAINT, INK, blank_figure, save_figure
from robot_layouts.core.pages import plural
from robot_layouts.core.quoting import cut
from robot_layouts.kinematics.rotations import Floats
from robots import LayoutError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LISTED_PAIRS = 12  # pairs of robots that the text tells distances and shared workspaces of

GOOD, BAD, NARROW = "#1B7837", "#B2182B", "#B35806"

WIDTH, HEIGHT = 10.0, 8.5  # inches; 1500 × 1275 pixels
MARGIN = 0.08  # free space around the robots, in shares of the plan's larger side
GAP = 10  # points, between what is drawn and its name
SHOWN_FINDINGS, LONGEST_FINDING = 3, 125  # findings; letters of one


@dataclass(frozen=True, eq=False)
class Report:
    """What a check of a layout found: data that can be read as text and seen as a picture.

    Attributes:
        layout: The layout.
        draws: How many postures with joint noise were looked at, besides the keyframes.
        tables: Corners of each table's top (m), by name.
        targets: Position of each target in the world (m).
        findings: What is wrong, serious findings first.
        clearances: Between robots, and between robots and tables; what is farther than 10 m
            apart is left out.
        shared: Workspaces that overlap; empty if they were not looked at.
        workspaces: Volume of each robot's workspace (m³), to about a tenth; empty if they were not
            looked at. A robot that slides for many metres is left out.
        reaches: For each target and robot, whether it gets there.
        outlines: For each robot the corners of its hulls at the keyframe, world (m); none for one
            that could not be checked.
    """

    layout: Arrangement
    draws: int
    tables: dict[str, tuple[Point, ...]]
    targets: dict[str, Point]
    findings: tuple[Finding, ...]
    clearances: tuple[Clearance, ...]
    shared: tuple[SharedWorkspace, ...]
    workspaces: dict[str, float]
    reaches: tuple[TargetReach, ...]
    outlines: dict[str, tuple[tuple[Point, ...], ...]]

    @property
    def ok(self) -> bool:
        """Whether nothing serious was found."""
        return not any(finding.serious for finding in self.findings)

    def __str__(self) -> str:
        """Return the verdict, the findings with what to change, and the figures."""
        return "\n".join(_lines(self))

    def picture(self, path: str | os.PathLike[str]) -> Path:
        """Save a view from above: links, clearances, overlaps and targets.

        Args:
            path: Where to save; the ending chooses the format (.png, .pdf or .svg).

        Returns:
            The path of the picture.

        Raises:
            LayoutError: If the ending names no supported format.
            MissingPackageError: If matplotlib is not installed.
        """
        return save_figure(lambda: draw(self), path, "picture", LayoutError)


def _lines(report: Report) -> Iterator[str]:
    serious = sum(finding.serious for finding in report.findings)
    verdict = "ok" if report.ok else "not ok"
    found = {"problem": serious, "warning": len(report.findings) - serious}
    counts = [plural(count, what) for what, count in found.items() if count]
    yield f"{verdict}: {headline(report.layout)}{''.join(f', {text}' for text in counts)}"
    yield (
        f"looked at the keyframes and {report.draws} draws of joint noise"
        if report.draws
        else "looked at the keyframes, without joint noise"
    )
    for finding in report.findings:
        yield f"{'problem' if finding.serious else 'warning'}, {finding}"
    yield from _section("distances (at the keyframes; with joint noise)", _distances(report))
    yield from _section("tool centre points reach", _spaces(report))
    yield from _section("targets", _targets(report))


def _section(title: str, rows: Iterator[str]) -> Iterator[str]:
    lines = list(rows)
    if lines:
        yield f"{title}:"
        yield from (f"  {line}" for line in lines)


def _distances(report: Report) -> Iterator[str]:
    ordered = sorted(report.clearances, key=lambda clearance: clearance.noisy_distance)
    yield from map(_near, ordered[:LISTED_PAIRS])
    if len(ordered) > LISTED_PAIRS:
        yield f"and {len(ordered) - LISTED_PAIRS} pairs that stay farther apart"


def _near(clearance: Clearance) -> str:
    one, other = clearance.between
    first, second = clearance.links
    ends = f"{one}.{first} – {second if clearance.table else f'{other}.{second}'}"
    return (
        f"{one} – {other}: {length_text(clearance.distance)};"
        f" {length_text(clearance.noisy_distance)} ({ends})"
    )


def _spaces(report: Report) -> Iterator[str]:
    if not report.workspaces:
        return
    yield ", ".join(f"{n} {volume:.2f} m³" for n, volume in report.workspaces.items())
    ordered = sorted(report.shared, key=lambda shared: -shared.volume)
    for shared in ordered[:LISTED_PAIRS]:
        (one, other), (share, other_share) = shared.robots, shared.shares
        yield (
            f"{one} and {other} share {shared.volume:.2f} m³:"
            f" {share:.0%} of {one}'s, {other_share:.0%} of {other}'s"
        )
    if not ordered and len(report.workspaces) > 1:
        yield "no two of them share a point"
    if len(ordered) > LISTED_PAIRS:
        yield f"and {len(ordered) - LISTED_PAIRS} pairs that share less"


def _targets(report: Report) -> Iterator[str]:
    for name, position in report.targets.items():
        texts = [reach_text(reach) for reach in report.reaches if reach.target == name]
        yield f"{name} ({', '.join(decimal(x) for x in position)}): {', '.join(texts)}"


# -- picture --------------------------------------------------------------------------------


def draw(report: Report) -> Figure:
    """Return the figure that `Report.picture` saves.

    Raises:
        MissingPackageError: If matplotlib is not installed.
    """
    figure = blank_figure("a picture", (WIDTH, HEIGHT))
    lines = _captions(report)
    below = 0.1 + 0.028 * len(lines)
    plan = figure.add_axes((0.08, below, 0.89, 0.93 - below))
    draw_tables(plan, report.tables)
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


def _draw_robot(plan: Axes, report: Report, index: int, name: str) -> None:
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
    _write(plan, place, behind, cut(name, LONGEST_NAME), colour, 11, "bold")


def _behind(report: Report, name: str) -> tuple[Floats, Floats]:
    """Return the end of a robot's back (m), and the direction from its base to there."""
    base = np.array(report.layout[name].base_position[:2])
    corners = np.array([c[:2] for hull in report.outlines[name] for c in hull] or [base]) - base
    ahead = corners.mean(axis=0)
    length = float(np.linalg.norm(ahead))
    behind = -ahead / length if length > 0.02 else np.array([0.0, -1.0])
    return base + behind * float((corners @ behind).max()), behind


def _nearest_neighbours(report: Report) -> list[Clearance]:
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
    _write(plan, middle, beside, length_text(clearance.distance), colour, 9)


def _draw_overlaps(plan: Axes, report: Report) -> None:
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


def _draw_target(plan: Axes, report: Report, name: str, position: tuple[float, ...]) -> None:
    own = [reach for reach in report.reaches if reach.target == name]
    reached = any(reach.reached for reach in own)
    colour = GOOD if reached else BAD
    plan.plot(*position[:2], "*", color=colour, markeredgecolor="white", markersize=15, zorder=8)
    _write(plan, np.array(position[:2]), np.array([0.0, 1.0]), name, colour, 9)
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
    size: float,
    weight: str = "normal",
) -> None:
    ends = place.tolist(), way.tolist()
    write_beside(plan, *ends, text, colour, size=size, gap=GAP, zorder=9, halo=0.85, weight=weight)


def _frame(plan: Axes, report: Report) -> None:
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
    verdict, colour = ("ok", GOOD) if report.ok else ("not ok", BAD)
    plan.set_title(verdict, loc="right", color=colour, fontsize=13, fontweight="bold")
    style_plan(plan, headline(report.layout))


def _captions(report: Report) -> list[tuple[str, str]]:
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

"""What a check of a layout found, as text and as a picture."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

from layouts.description import decimal, headline
from layouts.validation.findings import Clearance, Results, length_text, reach_text

SPOKEN_PAIRS = 12  # pairs of robots that the text tells distances and shared workspaces of


class Report(Results):
    """What a check of a layout found: `Results` that can be read and looked at."""

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
        from layouts.validation.picture import save_picture

        return save_picture(self, path)


def _lines(report: Report) -> Iterator[str]:
    serious = sum(finding.serious for finding in report.findings)
    warnings = len(report.findings) - serious
    verdict = "ok" if report.ok else "not ok"
    counts = [_count(serious, "problem")] * bool(serious) + [_count(warnings, "warning")] * bool(
        warnings
    )
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


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'s' * (number != 1)}"


def _section(title: str, rows: Iterator[str]) -> Iterator[str]:
    lines = list(rows)
    if lines:
        yield f"{title}:"
        yield from (f"  {line}" for line in lines)


def _distances(report: Report) -> Iterator[str]:
    ordered = sorted(report.clearances, key=lambda clearance: clearance.noisy_distance)
    yield from map(_near, ordered[:SPOKEN_PAIRS])
    if len(ordered) > SPOKEN_PAIRS:
        yield f"and {len(ordered) - SPOKEN_PAIRS} pairs that stay farther apart"


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
    for shared in ordered[:SPOKEN_PAIRS]:
        (one, other), (share, other_share) = shared.robots, shared.shares
        yield (
            f"{one} and {other} share {shared.volume:.2f} m³:"
            f" {share:.0%} of {one}'s, {other_share:.0%} of {other}'s"
        )
    if not ordered and len(report.workspaces) > 1:
        yield "no two of them share a point"
    if len(ordered) > SPOKEN_PAIRS:
        yield f"and {len(ordered) - SPOKEN_PAIRS} pairs that share less"


def _targets(report: Report) -> Iterator[str]:
    for name, position in report.targets.items():
        texts = [reach_text(reach) for reach in report.reaches if reach.target == name]
        yield f"{name} ({', '.join(decimal(x) for x in position)}): {', '.join(texts)}"

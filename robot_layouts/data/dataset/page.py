"""The report of a dataset: one HTML page that needs nothing else."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from robot_layouts.core.pages import Tile, data_address, page, plural
from robot_layouts.data.dataset.certificate import Certificate
from robot_layouts.data.dataset.charts import histogram
from robot_layouts.data.dataset.clearance import Clearances
from robot_layouts.data.dataset.clips import Clip
from robot_layouts.data.dataset.contents import Contents

_CHARTS = 120  # of what was varied, at most


@dataclass(frozen=True)
class Report:
    """What a page is made of.

    Attributes:
        title: What it is of.
        contents: What the recording holds.
        layout: Where robots stood: for each its kind and base position (m).
        certificate: What replays found, or None; of these very files.
        clearances: How near robots came, or None.
        clips: Clips of some episodes.
        remarks: What is missing on the page and why, in words.
    """

    title: str
    contents: Contents
    layout: Mapping[str, tuple[str, Sequence[float]]] = field(default_factory=dict[str, Any])
    certificate: Certificate | None = None
    clearances: Clearances | None = None
    clips: Sequence[Clip] = ()
    remarks: Sequence[str] = ()


def render(report: Report) -> str:
    """Return the page."""
    contents = report.contents
    mode = contents.control_mode
    words = mode if isinstance(mode, str) else ", ".join(f"{a} {m}" for a, m in mode.items())
    return page(
        "robot_layouts.data.dataset/report.html.jinja",
        kicker="robot-layouts, a dataset",
        title=report.title,
        note=f"{contents.task_id}, {words}",
        tiles=_tiles(report),
        lengths=_lengths(contents),
        sources=_sources(contents),
        varied=[_axis(name, values, contents) for name, values in contents.drawn.items()],
        most_charts=_CHARTS,
        clearances=_clearances(report),
        certificate=_certificate(report.certificate),
        clips=[
            {
                "poster": data_address("image/jpeg", clip.poster),
                "video": data_address("video/mp4", clip.video),
                "caption": f"seed {clip.seed}" + (f", {clip.words}" if clip.words else ""),
            }
            for clip in report.clips
        ],
        layout=[
            (place, robot, *(f"{value:.3f}" for value in position))
            for place, (robot, position) in report.layout.items()
        ],
        files=_files(report),
        remarks=report.remarks,
    )


def _tiles(report: Report) -> list[Tile]:
    contents, c = report.contents, report.certificate
    count, solved = len(contents.steps), int(contents.success.sum())
    tiles = [
        Tile("episodes", f"{count:,}", f"{int(contents.steps.sum()):,} steps"),
        Tile("success", f"{solved / count:.1%}" if count else "–", f"{count - solved:,} without"),
        Tile("on disk", f"{contents.megabytes:,.1f} MB", plural(len(contents.files), "file")),
    ]
    if c is None:
        tiles.append(Tile("certified", "–", "nobody has replayed it"))
    else:
        kind = "good" if c.holds else "bad"
        equal = f"{c.equal:,} of {c.episodes:,}"
        tiles.append(Tile("equal to the last bit", equal, "replayed", kind))
        touched = f"{c.contact_episodes:,}"
        note = "in every step of physics"
        kind = "bad" if c.contact_episodes else "good"
        tiles.append(Tile("episodes in which arms touch", touched, note, kind))
    if report.clearances is not None:
        least = float(report.clearances.least.min())
        note = f"in a sample of {plural(len(report.clearances.places), 'episode')}"
        tiles.append(Tile("least clearance", f"{least * 1e3:.1f} mm".replace("-", "−"), note))
    return tiles


def _lengths(contents: Contents) -> dict[str, Any] | None:
    if not len(contents.steps):
        return None
    low, middle, high = (f"{value:.0f}" for value in np.percentile(contents.steps, (5, 50, 95)))
    chart = histogram(contents.steps.astype(float), ~contents.success, "control steps")
    failed = not contents.success.all()
    return {"low": low, "middle": middle, "high": high, "chart": chart, "failed": failed}


def _sources(contents: Contents) -> list[tuple[str, ...]]:
    return [
        (
            name,
            f"{facts.episodes:,}",
            f"{facts.successes / facts.episodes:.1%}",
            f"{facts.steps / facts.episodes:.1f}",
        )
        for name, facts in sorted(contents.sources.items(), key=lambda item: -item[1].episodes)
    ]


def _axis(name: str, values: np.ndarray, contents: Contents) -> dict[str, Any]:
    there = np.isfinite(values)
    chart = histogram(values[there], ~contents.success[there], name)
    return {"name": name, "chart": chart, "lacking": int((~there).sum())}


def _clearances(report: Report) -> dict[str, str] | None:
    found = report.clearances
    if found is None:
        return None
    failed = ~report.contents.success[found.places]
    chart = histogram(found.least * 1e3, failed, "least clearance, mm", lambda v: f"{v:.0f} mm")
    return {"episodes": plural(len(found.places), "episode"), "chart": chart}


def _certificate(certificate: Certificate | None) -> list[tuple[str, str]]:
    if certificate is None:
        return []
    c = certificate
    versions = ", ".join(f"{name} {version}" for name, version in c.versions.items())
    rows = [
        ("episodes played again", f"{len(c.checked):,} of {c.episodes:,}"),
        ("equal to the last bit", f"{c.equal:,}"),
        ("control steps", f"{c.steps:,}"),
        ("episodes in which arms touch", f"{c.contact_episodes:,}"),
        ("steps in which arms touch", f"{c.contact_steps:,}"),
        ("played on", versions),
    ]
    rows += [("touched", f"{pair}: {count:,} steps") for pair, count in sorted(c.pairs.items())]
    for entry in c.differing[:10]:
        rows.append(("differs", f"seed {entry['seed']}, step {entry['step']}, {entry['array']}"))
    for entry in c.not_played[:10]:
        rows.append(("not played", f"seed {entry['seed']}: {entry['reason']}"))
    return rows


def _files(report: Report) -> list[tuple[str, ...]]:
    sums = {
        f["file"]: f["sha256"] for f in (report.certificate.files if report.certificate else ())
    }
    return [
        (
            file.name,
            "–" if file.first is None else f"{file.first} to {file.last}",
            f"{file.episodes:,}",
            f"{file.megabytes:,.1f}",
            sums.get(file.name, "–")[:16],
        )
        for file in report.contents.files
    ]

"""The report of a dataset: one HTML page that needs nothing else."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from typing import Any

import numpy as np

from robots.common.pages import Tile, document, heading, plural, section, table
from rollouts.dataset.certificate import Certificate
from rollouts.dataset.charts import histogram
from rollouts.dataset.clearance import Clearances
from rollouts.dataset.clips import Clip
from rollouts.dataset.contents import Contents

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
    sections = (
        _lengths(report.contents),
        _sources(report.contents),
        _varied(report.contents),
        _clearances(report),
        _certificate(report.certificate),
        _clips(report.clips),
        _layout(report.layout),
        _files(report),
        _remarks(report.remarks),
    )
    return document(report.title, _header(report), sections)


def _header(report: Report) -> str:
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
    mode = contents.control_mode
    words = mode if isinstance(mode, str) else ", ".join(f"{a} {m}" for a, m in mode.items())
    note = f"{contents.task_id}, {words}"
    return heading("robot-layouts, a dataset", report.title, note, tiles)


def _lengths(contents: Contents) -> str:
    if not len(contents.steps):
        return ""
    chart = histogram(contents.steps.astype(float), ~contents.success, "control steps")
    low, middle, high = np.percentile(contents.steps, (5, 50, 95))
    words = f"Median {middle:.0f} steps; 5 % have at most {low:.0f}, 5 % at least {high:.0f}."
    if not contents.success.all():
        words += " Episodes without success are red."
    return section("Lengths", f"<p>{words}</p><figure>{chart}</figure>")


def _sources(contents: Contents) -> str:
    rows = [
        (
            name,
            f"{facts.episodes:,}",
            f"{facts.successes / facts.episodes:.1%}",
            f"{facts.steps / facts.episodes:.1f}",
        )
        for name, facts in sorted(contents.sources.items(), key=lambda item: -item[1].episodes)
    ]
    return section("Who acted", table(("source", "episodes", "success", "steps, mean"), rows))


def _varied(contents: Contents) -> str:
    if not contents.drawn:
        return ""
    figures = [_axis(name, values, contents) for name, values in contents.drawn.items()]
    left_out = len(figures) - _CHARTS
    more = f"<p>{left_out} more are left out.</p>" if left_out > 0 else ""
    words = "What was drawn for each episode; with its seed it comes back."
    return section(
        "What was varied",
        f'<p>{words}</p><div class="grid">{"".join(figures[:_CHARTS])}</div>{more}',
    )


def _axis(name: str, values: np.ndarray, contents: Contents) -> str:
    there = np.isfinite(values)
    chart = histogram(values[there], ~contents.success[there], name)
    lacking = int((~there).sum())
    note = f", not in {lacking:,} episodes" if lacking else ""
    return f"<figure>{chart}<figcaption><b>{escape(name)}</b>{note}</figcaption></figure>"


def _clearances(report: Report) -> str:
    found = report.clearances
    if found is None:
        return ""
    failed = ~report.contents.success[found.places]
    chart = histogram(found.least * 1e3, failed, "least clearance, mm", lambda v: f"{v:.0f} mm")
    words = (
        "The least distance of links of different robots at any control step, in each of"
        f" {plural(len(found.places), 'episode')}, evenly chosen; it is negative where the convex"
        " hulls of their shapes overlap, as those of hands can in clones of ManiSkill's tasks."
    )
    return section("Clearance between robots", f"<p>{words}</p><figure>{chart}</figure>")


def _certificate(certificate: Certificate | None) -> str:
    if certificate is None:
        words = (
            "There is no certificate of these files; <code>robot-layouts certify</code> makes one."
        )
        return section("Certificate", f"<p>{words}</p>")
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
    return section("Certificate", table(("", ""), rows, text=2))


def _clips(clips: Sequence[Clip]) -> str:
    if not clips:
        return ""
    shown = "".join(
        '<figure><video controls muted loop playsinline width="256" height="256"'
        f' poster="data:image/jpeg;base64,{base64.b64encode(clip.poster).decode()}"'
        f' src="data:video/mp4;base64,{base64.b64encode(clip.video).decode()}">'
        f"</video><figcaption>{escape(_caption(clip))}</figcaption></figure>"
        for clip in clips
    )
    return section("Clips", f'<div class="grid">{shown}</div>')


def _caption(clip: Clip) -> str:
    return f"seed {clip.seed}" + (f", {clip.words}" if clip.words else "")


def _layout(layout: Mapping[str, tuple[str, Sequence[float]]]) -> str:
    if not layout:
        return ""
    rows = [
        (place, robot, *(f"{value:.3f}" for value in position))
        for place, (robot, position) in layout.items()
    ]
    return section("Layout", table(("place", "robot", "x (m)", "y (m)", "z (m)"), rows, text=2))


def _files(report: Report) -> str:
    sums = {
        f["file"]: f["sha256"] for f in (report.certificate.files if report.certificate else ())
    }
    rows = [
        (
            file.name,
            "–" if file.first is None else f"{file.first} to {file.last}",
            f"{file.episodes:,}",
            f"{file.megabytes:,.1f}",
            sums.get(file.name, "–")[:16],
        )
        for file in report.contents.files
    ]
    names = ("file", "seeds", "episodes", "MB", "SHA-256 begins")
    return section("Files", table(names, rows))


def _remarks(remarks: Sequence[str]) -> str:
    lines = "".join(f"<p>{escape(remark)}</p>" for remark in remarks)
    return section("Left out", lines) if lines else ""

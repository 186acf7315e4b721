"""The report of a dataset: one HTML page that needs nothing else, and what it shows."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import torch
from numpy.typing import NDArray

from robot_layouts.core.cli import Natural, Word
from robot_layouts.core.commands import printable
from robot_layouts.core.pages import Tile, data_address, fragment, page, plural
from robot_layouts.core.progress import Progress as ProgressLine
from robot_layouts.core.writing import write_whole
from robot_layouts.data.dataset.certificate import RecordingCertificate, certificate_path
from robot_layouts.data.dataset.contents import (
    Clip,
    Contents,
    EpisodeClearances,
    chosen_places,
    film,
    measure,
    read_contents,
)
from robot_layouts.data.playing.command_options import RecordingPath
from robot_layouts.data.playing.replay import open_recording
from robot_layouts.data.reading.hub import on_hub
from robot_layouts.data.reading.json_files import TrajectoryError
from robot_layouts.data.reading.recorded_task import task_for
from robot_layouts.data.reading.recording import all_files, first_file
from robot_layouts.data.video import video_problem
from robots import RecordingError
from robots.assets.store import size
from tasks.cell_options import CellOptions

WIDTH, HEIGHT = 320, 132  # of a chart
_BASE = HEIGHT - 18  # y of the axis
_TOP = 14
MOST_BINS = 24
_CHARTS = 120  # of what was varied, at most

Progress = Callable[[float, float, str], None]


def histogram(
    values: NDArray[np.float64],
    failed: NDArray[np.bool_] | None,
    label: str,
    show: Callable[[float], str] = lambda value: f"{value:.4g}",
) -> str:
    """Return a histogram; bars of failed episodes stand on those of the others.

    Args:
        values: One for each episode, (n,) with n of 1 or more.
        failed: Whether it ended without success, (n,); None if that is unknown.
        label: What is counted, in words.
        show: Writes a value at the axis.
    """
    failed = np.zeros(len(values), np.bool_) if failed is None else failed
    edges = _edges(values)
    good, bad = (np.histogram(values[chosen], edges)[0] for chosen in (~failed, failed))
    most = int((good + bad).max())
    counts = zip(good.tolist(), bad.tolist(), strict=True)
    bars = [
        bar
        for number, pair in enumerate(counts)
        for bar in _bars(number, edges, pair, (_BASE - _TOP) / most, show)
    ]
    low, high = float(values.min()), float(values.max())
    ends = [("start", 0, show(low)), ("end", WIDTH, show(high))][: 2 if high > low else 1]
    return fragment(
        "robot_layouts.data.dataset/histogram.svg.jinja",
        width=WIDTH,
        height=HEIGHT,
        base=_BASE,
        about=f"{label}: {len(values)} values from {show(low)} to {show(high)}",
        bars=bars,
        most=f"{most:,}",
        ends=ends,
    )


def _edges(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the edges of bins, of whole numbers if these are few."""
    low, high = float(values.min()), float(values.max())
    if low == high:
        return np.array([low - 0.5, high + 0.5])
    bins = min(MOST_BINS, 4 + round(len(values) ** 0.5))
    if (values == np.round(values)).all():
        step = max(1, math.ceil((high - low + 1) / bins))
        return np.arange(low - 0.5, high + step, step)
    return np.linspace(low, high, bins + 1)


def _bars(
    number: int,
    edges: NDArray[np.float64],
    counts: tuple[int, int],
    scale: float,
    show: Callable[[float], str],
) -> Iterator[dict[str, Any]]:
    """Yield the bars of one bin: that of successes, and on it that of failures."""
    width, y = WIDTH / (len(edges) - 1), float(_BASE)
    words = f"{show(edges[number])} to {show(edges[number + 1])}: {counts[0]:,} succeeded"
    words += f", {counts[1]:,} failed" if counts[1] else ""
    for count, kind in zip(counts, ("good", "bad"), strict=True):
        y -= count * scale
        if count:
            bar = {"kind": kind, "words": words, "x": number * width + 0.5, "y": y}
            yield {**bar, "width": max(width - 1, 0.5), "height": count * scale}


@dataclass(frozen=True)
class DatasetReport:
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
    certificate: RecordingCertificate | None = None
    clearances: EpisodeClearances | None = None
    clips: Sequence[Clip] = ()
    remarks: Sequence[str] = ()


def render(report: DatasetReport) -> str:
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
        certificate=_certificate_rows(report.certificate),
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


def _tiles(report: DatasetReport) -> list[Tile]:
    contents, c = report.contents, report.certificate
    count, solved = len(contents.steps), int(contents.success.sum())
    tiles = [
        Tile("episodes", f"{count:,}", f"{int(contents.steps.sum()):,} steps"),
        Tile("success", f"{solved / count:.1%}" if count else "–", f"{count - solved:,} without"),
        Tile("on disk", f"{contents.megabytes:,.1f} MB", plural(len(contents.files), "file")),
    ]
    if c is None:
        tiles.append(Tile("certified", "–", "not replayed"))
    else:
        kind = "good" if c.holds else "bad"
        equal = f"{c.equal:,} of {c.episodes:,}"
        tiles.append(Tile("equal to the last bit", equal, "replayed", kind))
        touched = f"{c.arm_contacts.episodes:,}"
        note = "in every step of physics"
        kind = "bad" if c.arm_contacts.episodes else "good"
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


def _clearances(report: DatasetReport) -> dict[str, str] | None:
    found = report.clearances
    if found is None:
        return None
    failed = ~report.contents.success[found.places]
    chart = histogram(found.least * 1e3, failed, "least clearance, mm", lambda v: f"{v:.0f} mm")
    return {"episodes": plural(len(found.places), "episode"), "chart": chart}


def _certificate_rows(certificate: RecordingCertificate | None) -> list[tuple[str, str]]:
    if certificate is None:
        return []
    c, arms = certificate, certificate.arm_contacts
    versions = ", ".join(f"{name} {version}" for name, version in c.versions.items())
    rows = [
        ("episodes played again", f"{len(c.checked):,} of {c.episodes:,}"),
        ("equal to the last bit", f"{c.equal:,}"),
        ("control steps", f"{c.steps:,}"),
        ("episodes in which arms touch", f"{arms.episodes:,}"),
        ("steps in which arms touch", f"{arms.steps:,}"),
        ("played on", versions),
    ]
    rows += [("touched", f"{pair}: {count:,} steps") for pair, count in sorted(arms.pairs.items())]
    for entry in c.differing[:10]:
        rows.append(("differs", f"seed {entry['seed']}, step {entry['step']}, {entry['array']}"))
    for entry in c.not_played[:10]:
        rows.append(("not played", f"seed {entry['seed']}: {entry['reason']}"))
    return rows


def _files(report: DatasetReport) -> list[tuple[str, ...]]:
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


def make_report(
    path: Path,
    *,
    task_id: str | None = None,
    cell: Mapping[str, Any] | None = None,
    clearances: int = 100,
    clips: int = 4,
    progress: Progress = lambda done, total, what: None,
) -> DatasetReport:
    """Gather what the report of a data set shows.

    Args:
        path: The recording: an h5 file, a folder or a manifest.
        task_id: Its task; ``module:Id`` for one of a module that no package lists.
        cell: Where robots stood and which, where the file cannot say it; see `task_for`.
        clearances: In how many episodes to measure how near robots came.
        clips: How many episodes to film.
        progress: Called with what is done, what there is to do, and what is going on.

    Raises:
        TrajectoryError: If it cannot be read.
        RecordingError: If something that is no certificate is in its place.
    """
    cell, remarks = cell or {}, list[str]()
    files = len(all_files(path))
    total = files + clearances + clips
    contents = read_contents(path, lambda done, _: progress(done, total, "reading"))
    if not len(contents.steps):
        raise TrajectoryError(f"{path} holds no episodes; there is nothing to report")
    done, near, films = itertools.count(files + 1), None, list[Clip]()
    with open_recording(path, task_id) as file:
        if clearances and find_spec("fcl") is None:
            remarks.append("Clearances need python-fcl: pip install 'robot-layouts[checks]'.")
        elif clearances:
            last = len(contents.steps) - 1
            evenly = np.linspace(0, last, min(clearances, last + 1)).tolist()
            places = sorted({round(place) for place in evenly})
            with closing(task_for(file, **cell)) as task:
                near = measure(file, task, places, lambda: progress(next(done), total, "measuring"))
            if near is None and len(file.layout or {}) > 1:
                remarks.append("Clearances need recorded states.")
        if clips and (problem := video_problem(file.simulator)):
            remarks.append(f"There are no clips: {problem}.")
        elif clips:
            chosen = chosen_places(contents, clips)
            with closing(task_for(file, **cell, pictures=True)) as task:
                films = film(file, task, chosen, lambda: progress(next(done), total, "filming"))
        described = file.layout or {}
    return DatasetReport(
        title=_title(path),
        contents=contents,
        layout={name: (about["robot"], about["position"]) for name, about in described.items()},
        certificate=_certificate(path, remarks),
        clearances=near,
        clips=films,
        remarks=remarks,
    )


def _title(path: Path) -> str:
    if on_hub(path):
        return str(path)
    return first_file(path).absolute().parent.name if first_file(path) != path else path.name


def _certificate(path: Path, remarks: list[str]) -> RecordingCertificate | None:
    """Return the certificate of these files, which are recognised by their sizes."""
    place = certificate_path(path)
    if not place.exists():
        return None
    found = RecordingCertificate.read(place)
    sizes = {file["file"]: file["bytes"] for file in found.files}
    here = [p for h5 in all_files(path) for p in (h5, h5.with_suffix(".json"))]
    if sizes != {p.name: p.stat().st_size for p in here}:
        remarks.append(f"{place.name} is of other files, and is not shown.")
        return None
    return found


def report(
    file: RecordingPath,
    *,
    out: Annotated[Path, Word("PAGE")],
    clearances: Natural = 100,
    clips: Natural = 4,
    task: str | None = None,
    cell: CellOptions,
) -> None:
    """Write one HTML page on a data set: counts, lengths, sources, variations, clips.

    The page needs nothing else, and loads nothing. A certificate beside the recording is shown.
    Exit code: 0 if the page was written, 1 if not, 2 for bad usage.

    Args:
        file: The folder of a recording, or one h5 file.
        out: The HTML file.
        clearances: Measure in N episodes how near robots came; needs the extra checks.
        clips: Film N episodes; needs a graphics driver and the extra video.
        task: The recording's task; MODULE:ID for one of your own.
        cell: Which robots stood where, where the recording cannot say it.

    Raises:
        RobotLayoutsError: If the recording cannot be read, or the page not be written.
    """
    torch.set_num_threads(1)
    with ProgressLine(unit="parts") as line:

        def show(done: float, total: float, what: str) -> None:
            line.total = total
            line.update(done, what)

        made = make_report(
            file,
            task_id=task,
            cell=cell.making(),
            clearances=clearances,
            clips=clips,
            progress=show,
        )
    text = render(made)
    write_whole(out, text, RecordingError)
    print(printable(f"{out}: {size(len(text.encode()))}"))
    for remark in made.remarks:
        print(printable(remark))

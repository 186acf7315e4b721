"""Gathers what the report of a dataset shows."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import closing
from importlib.util import find_spec
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from robot_layouts.data.dataset.certificate import Certificate
from robot_layouts.data.dataset.certify import certificate_path
from robot_layouts.data.dataset.clearance import measure
from robot_layouts.data.dataset.clips import Clip, chosen_places, film
from robot_layouts.data.dataset.contents import read_contents
from robot_layouts.data.dataset.page import Report
from robot_layouts.data.playing.replay import open_recording, task_for
from robot_layouts.data.reading.recording import TrajectoryError, all_files, first_file
from robot_layouts.data.video import video_problem

Progress = Callable[[float, float, str], None]


def make_report(
    path: Path,
    *,
    task_id: str | None = None,
    cell: Mapping[str, Any] | None = None,
    clearances: int = 100,
    clips: int = 4,
    progress: Progress = lambda done, total, what: None,
) -> Report:
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
    done, near, films = count(files + 1), None, list[Clip]()
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
        if clips and (problem := video_problem()):
            remarks.append(f"There are no clips: {problem}.")
        elif clips:
            chosen = chosen_places(contents, clips)
            with closing(task_for(file, **cell, pictures=True)) as task:
                films = film(file, task, chosen, lambda: progress(next(done), total, "filming"))
        described = file.layout or {}
    return Report(
        title=first_file(path).absolute().parent.name if first_file(path) != path else path.name,
        contents=contents,
        layout={name: (about["robot"], about["position"]) for name, about in described.items()},
        certificate=_certificate(path, remarks),
        clearances=near,
        clips=films,
        remarks=remarks,
    )


def _certificate(path: Path, remarks: list[str]) -> Certificate | None:
    """Return the certificate of these files, which are recognised by their sizes."""
    place = certificate_path(path)
    if not place.exists():
        return None
    found = Certificate.read(place)
    sizes = {file["file"]: file["bytes"] for file in found.files}
    here = [p for h5 in all_files(path) for p in (h5, h5.with_suffix(".json"))]
    if sizes != {p.name: p.stat().st_size for p in here}:
        remarks.append(f"{place.name} is of other files, and is not shown.")
        return None
    return found

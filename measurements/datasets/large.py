"""A large dataset from end to end: other layouts, worlds that vary, certified and reported."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from layouts import Layout
from measurements.datasets.costs import timed
from measurements.experts.cells import other_layout
from robots import LayoutError, RecordingError
from robots.common.writing import write_whole
from rollouts.dataset.certify import certify
from rollouts.dataset.page import render
from rollouts.dataset.report import make_report
from rollouts.playing.executor import Executor
from rollouts.recording.record import record
from tasks import Randomization

EXPERTS = Path("docs/experts.json")
SUMMARY = "summary.json"

# Five axes, as far as experts still solve most episodes.
FIVE = {
    "mass": {"*cube*": {"uniform": [0.7, 1.4]}},
    "friction": {"*cube*": {"uniform": [0.6, 1.2]}},
    "size": {"*cube*": {"uniform": [0.95, 1.05]}},
    "stiffness": {"*": {"uniform": [0.95, 1.05]}},
    "bases": {
        "*": {
            "x": {"uniform": [-0.005, 0.005]},
            "y": {"uniform": [-0.005, 0.005]},
            "yaw": {"uniform": [-0.01, 0.01]},
        }
    },
}

Seen = dict[str, Any]


def make_large(
    out: Path,
    tasks: Sequence[str],
    episodes: int,
    layouts: Sequence[int],
    executor: Callable[[], Executor],
    *,
    clips: int = 4,
    say: Callable[[str], None] = print,
    progress: Callable[[str], None] = lambda what: None,
) -> Seen:
    """Record, certify and report episodes of tasks; what is done already is not done again.

    Each layout is a recording of its own: ``OUT/TASK/layout_K``, with its certificate and
    ``report.html``. Seeds differ from layout to layout.

    Args:
        out: Folder of all.
        tasks: Ids of tasks that `measurements.experts.cells` knows.
        episodes: Of each task.
        layouts: In which of its layouts, by their numbers; as many in each.
        executor: Makes who plays.
        clips: How many episodes of each recording are filmed.
        say: Told of each recording that is done.
        progress: Called after each episode with what is going on.

    Returns:
        What came of each recording, by its folder; also in ``OUT/summary.json``.
    """
    summary = _read(out / SUMMARY)
    each = -(-episodes // len(layouts))
    for task_id in tasks:
        for place, number in enumerate(layouts):
            name = f"{task_id}/layout_{number}"
            seeds = range(place * each, min((place + 1) * each, episodes))
            if len(seeds) and summary.get(name, {}).get("episodes") != len(seeds):
                folder = out / task_id / f"layout_{number}"
                layout = find_layout(task_id, number, folder)
                if layout is None:
                    say(f"{name}: the search finds no layout")
                    continue
                summary[name] = _make(task_id, layout, seeds, folder, executor, clips, progress)
                write_whole(out / SUMMARY, json.dumps(summary, indent=1) + "\n", RecordingError)
            if name in summary:
                say(f"{name}: {_words(summary[name])}")
    return summary


def find_layout(task_id: str, number: int, folder: Path) -> Layout | None:
    """Return one of a task's other layouts, which is kept as ``layout.yaml`` in a folder."""
    path = folder / "layout.yaml"
    if path.exists():
        return Layout.from_yaml(path.read_text(encoding="utf-8"))
    known = _read(EXPERTS).get("tasks", {}).get(task_id, {}).get("others", {})
    text: str | None = known.get(str(number), {}).get("layout")
    try:
        layout = Layout.from_yaml(text) if text else other_layout(task_id, number)
    except LayoutError:
        return None
    write_whole(path, layout.to_yaml(), RecordingError)
    return layout


def _make(
    task_id: str,
    layout: Layout,
    seeds: Sequence[int],
    folder: Path,
    executor: Callable[[], Executor],
    clips: int,
    progress: Callable[[str], None],
) -> Seen:
    summary, recording = timed(
        lambda: record(
            task_id,
            seeds,
            folder,
            executor(),
            layout=layout,
            randomization=Randomization.from_json(FIVE),
            on_event=lambda summary, event: event and progress(f"recording {folder}"),
        )
    )
    found, certifying = timed(
        lambda: certify(
            folder,
            executor(),
            on_event=lambda certificate, event: event and progress(f"certifying {folder}"),
        )
    )
    page = folder / "report.html"
    write_whole(page, render(make_report(folder, clips=clips)), RecordingError)
    return {
        "episodes": len(seeds),
        "recorded": summary.recorded,
        "recorded_now": len(summary.played),
        "not_played": {str(seed): str(error) for seed, error in summary.failed.items()},
        "successes": found.successes,
        "steps": found.steps,
        "equal": found.equal,
        "contact_episodes": found.contact_episodes,
        "bytes": sum(file["bytes"] for file in found.files),
        "record": vars(recording),
        "certify": vars(certifying),
    }


def _words(seen: Seen) -> str:
    return (
        f"{seen['recorded']} episodes, {seen['successes']} successes, {seen['equal']} equal to the"
        f" last bit, arms touched in {seen['contact_episodes']}, {seen['bytes'] / 1e6:.1f} MB"
    )


def _read(path: Path) -> Seen:
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return {}
    except (OSError, ValueError) as error:
        raise RecordingError(f"{path} cannot be read: {error}") from error

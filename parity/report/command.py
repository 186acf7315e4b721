"""``robot-layouts parity report``: what a sweep found, as one HTML page that needs nothing else."""

from __future__ import annotations

import argparse
from pathlib import Path

from parity.compare.results import RESULTS, ResultsError, read
from parity.report.content import page_content
from parity.report.html import render
from parity.show import embedding
from parity.sweep.entries import SUMMARY, read_summary
from robots import RecordingError, TaskError
from robots.common.writing import write_whole

LIMIT = 25.0  # MB
MARGIN = 20_000  # bytes kept free when clips are made to fit


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.epilog = "The page holds its clips, and needs nothing else."
    add = parser.add_argument
    add(
        "--runs",
        type=Path,
        default=Path("runs"),
        metavar="DIR",
        help="folder of the sweep (%(default)s)",
    )
    add(
        "--out",
        type=Path,
        default=Path("report.html"),
        metavar="FILE",
        help="the page (%(default)s)",
    )
    add("--results", type=Path, default=RESULTS, help="the record (this project's)")
    add("--limit", type=float, default=LIMIT, metavar="MB", help="largest page (%(default)g MB)")


def run(args: argparse.Namespace) -> int:
    """Run the command; returns 0.

    Raises:
        RobotLayoutsError: If the page could not be written.
    """
    page = make(args.runs, args.results, args.limit)
    write_whole(args.out, page, RecordingError)
    print(f"{args.out}: {len(page.encode()) / 1e6:.1f} MB")
    return 0


def make(runs: Path, results: Path = RESULTS, limit: float = LIMIT) -> str:
    """Return the page.

    Args:
        runs: Folder of a sweep.
        results: The recorded comparison.
        limit: Largest size (MB); clips are encoded anew where they have to be.

    Raises:
        ResultsError: If there is no sweep or no record, or one cannot be read.
        TaskError: If the page cannot be made as small as that.
    """
    if not (runs / SUMMARY).is_file():
        raise ResultsError(f"there is no {runs / SUMMARY}; `robot-layouts parity sweep` writes it")
    swept, recorded = read_summary(runs / SUMMARY), read(results)
    paths = {
        task_id: runs / task_id / entry["clip"]["clip"]
        for task_id, entry in swept["tasks"].items()
        if entry["clip"]
    }
    if lost := [str(path) for path in paths.values() if not path.is_file()]:
        raise ResultsError(
            f"{', '.join(lost)} is gone; `robot-layouts parity sweep --again` makes it"
        )
    posters = {path: embedding.poster(path) for path in paths.values()}
    context = page_content(runs, swept, recorded)
    bare = len(render(context, {}).encode()) + sum(_encoded(len(p)) for p in posters.values())
    room = int((limit * 1e6 - bare - MARGIN) * 3 / 4)
    try:
        fitted = embedding.take(list(paths.values()), room, posters) if paths else {}
    except embedding.ClipError as error:
        raise TaskError(_too_large(limit, str(error))) from error
    page = render(context, {task_id: fitted[path] for task_id, path in paths.items()})
    if len(page.encode()) > limit * 1e6:
        raise TaskError(_too_large(limit, f"it takes {len(page.encode()) / 1e6:.2f} MB"))
    return page


def _too_large(limit: float, why: str) -> str:
    return f"the page does not fit into {limit:g} MB ({why}); give a larger --limit, or fewer tasks"


def _encoded(count: int) -> int:
    return -(-count // 3) * 4 + 100  # base64, and the words around it

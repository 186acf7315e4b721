"""The time from drags of the mouse on the page of ``teleop`` to their pictures, in a browser."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Generator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import tasks
from layouts.viewer.server import ViewerError
from measurements.browser import PATIENCE, SOFTWARE_WEBGL, running_browser, served
from measurements.teleop.gizmos import Gizmos
from robots import TaskError
from rollouts.teleop.session import Session
from rollouts.teleop.stopwatch import MOST

SIZE = {"width": 900, "height": 560}  # of the page (pixels)
AXIS, STROKE = 2, 0.06  # the arrow that is dragged to and fro, and how far (m)


@dataclass(frozen=True)
class Latency:
    """How long it took from drags to their pictures.

    Attributes:
        times: Of each drag (ms).
        page: What the page said of them.
        clock: What the page said of real time.
        load: Processes that wanted a core, on the average of a minute, before it began.
        cores: How many cores this process may use.
    """

    times: tuple[float, ...]
    page: str
    clock: str
    load: float
    cores: int

    @property
    def median(self) -> float:
        """Half of the drags took at most so long (ms)."""
        return self._share(50)

    @property
    def most(self) -> float:
        """95 % of the drags took at most so long (ms)."""
        return self._share(95)

    def _share(self, percent: float) -> float:
        return float(np.percentile(self.times, percent, method="lower"))  # as the page does


def measure(
    task_id: str,
    drags: int,
    picture: Path | None = None,
    progress: Callable[[float, str], None] = lambda _, __: None,
) -> Latency:
    """Drag the arms of a task until enough drags were seen.

    Args:
        task_id: The task.
        drags: How many, at most `MOST`.
        picture: Where to save what the page looks like at the end.
        progress: Called with how many were seen so far, and of what.

    Raises:
        TaskError: If that is more than the page remembers, or the task cannot be made.
        ViewerError: If the page cannot be served, or shows no more drags.
        MissingPackageError: If viser, playwright or chromium is not installed.
    """
    if drags > MOST:
        raise TaskError(f"the page remembers {MOST} drags; {drags} are too many")
    load = os.getloadavg()[0]
    with _page_of(task_id) as gizmos:
        gizmos.page.keyboard.press("p")
        _drag(gizmos, drags, lambda seen: progress(seen, task_id))
        if picture is not None:
            gizmos.page.screenshot(path=picture)
        (said, times), clock = gizmos.measured(), gizmos.clock()
    return Latency(tuple(times), said, clock, load, len(os.sched_getaffinity(0)))


@contextmanager
def _page_of(task_id: str) -> Generator[Gizmos]:
    """Yield the gizmos on a page of the command that steers a task."""
    with (
        closing(tasks.make(task_id)) as task,
        TemporaryDirectory() as folder,
        served("rollouts", "teleop", task_id, "--port", "0", "--out", folder) as command,
        running_browser(*SOFTWARE_WEBGL) as browser,
    ):
        page = browser.new_page(viewport=SIZE)
        page.set_default_timeout(1000 * PATIENCE)
        yield Gizmos(page, command.url, Session(task))


def _drag(gizmos: Gizmos, drags: int, progress: Callable[[int], None]) -> None:
    """Drag all arms in turn, each up and down, until the page has seen enough drags."""
    number, seen, deadline = 0, 0, time.monotonic() + PATIENCE
    while seen < drags:
        lap, turn = divmod(number, len(gizmos.arms))
        gizmos.drag(gizmos.arms[turn], AXIS, STROKE if lap % 2 else -STROKE)
        number, before, seen = number + 1, seen, len(gizmos.measured()[1])
        progress(seen)
        if seen > before:
            deadline = time.monotonic() + PATIENCE
        elif time.monotonic() > deadline:
            raise ViewerError(f"the page has shown no drag for {PATIENCE:.0f} s; {seen} so far")

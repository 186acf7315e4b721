"""``python -m benchmarks teleop``: the time from drags of the mouse to their pictures.

A command serves its page to Debian's chromium, whose mouse drags the gizmos of the arms.
"""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Generator
from contextlib import closing, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from tqdm import tqdm

import tasks
from benchmarks.records import versions_of, write_record
from layouts.viewer.server import ViewerError
from robot_layouts.data.teleop.page import GIZMO_SIZE
from robot_layouts.data.teleop.session import Session
from robot_layouts.data.teleop.widgets import FIELD_OF_VIEW, HTML_ID, MOST, QUICK, viewpoint
from robot_layouts.kinematics.rotations import Floats, rotate
from robots import MissingPackageError, TaskError

# No traffic of the browser's own.
QUIET = (
    "--no-sandbox --disable-quic --no-first-run --disable-background-networking"
    " --disable-component-update --disable-sync"
).split()
SOFTWARE_WEBGL = (
    "--use-gl=angle --use-angle=swiftshader --enable-unsafe-swiftshader --ignore-gpu-blocklist"
).split()
PATIENCE = 120.0  # s; browsers without a graphics card are slow
ALLOWED = 150.0  # ms, the median
SIZE = {"width": 900, "height": 560}  # of the page (pixels)
AXIS, STROKE = 2, 0.06  # the arrow that is dragged to and fro, and how far (m)
ARROW = 0.85 * GIZMO_SIZE  # where to press, from the middle of a gizmo (m)
PLACE = re.compile(r"target \((\S+), (\S+), (\S+)\) m, (\d+) mm away")
CLOCK = re.compile(r"Real time\.|Time runs at .* no step is left out\.")
_MEASURED = "(id) => [document.getElementById(id).innerText, window.dragsSeen]"
_THIRTY_FRAMES = (
    "() => new Promise((done) => { let n = 0; const f = () =>"
    " ++n > 30 ? done() : requestAnimationFrame(f); f(); })"
)


def teleop(
    *,
    task: str = "TwoRobotPickCube-v1",
    drags: int = MOST,
    picture: Path | None = None,
    out: Path | None = None,
) -> int:
    """Measure the time from drags of the mouse on the page of teleop to their pictures.

    Exit code: 0 if half of the drags are seen within 150 ms, else 1.

    Args:
        task: Task id.
        drags: How many; the page remembers no more than this.
        picture: Save the page as it looks at the end.
        out: Write the numbers as JSON, too.

    Raises:
        TaskError: If that is more than the page remembers, or the task cannot be made.
        ViewerError: If the page cannot be served, or shows no more drags.
        MissingPackageError: If viser, playwright or chromium is not installed.
    """
    if not 1 <= drags <= MOST:
        raise TaskError(f"--drags is {drags}; the page remembers 1 to {MOST}")
    load, cores = os.getloadavg()[0], len(os.sched_getaffinity(0))
    with (
        closing(tasks.make(task)) as model,
        TemporaryDirectory() as folder,
        served("robot_layouts", "teleop", task, "--port", "0", "--out", folder) as command,
        running_browser(*SOFTWARE_WEBGL) as browser,
    ):
        page = browser.new_page(viewport=SIZE)
        page.set_default_timeout(1000 * PATIENCE)
        gizmos = Gizmos(page, command.url, Session(model))
        page.keyboard.press("p")
        _drag(gizmos, drags)
        if picture is not None:
            page.screenshot(path=picture)
        (said, times), clock = gizmos.measured(), gizmos.clock()
    # As the page does.
    median, most = (float(np.percentile(times, q, method="lower")) for q in (50, 95))
    print(
        f"{task}, {len(times)} drags: {median:.0f} ms from drag to picture (median),"
        f" {most:.0f} ms (95 %). {clock} {cores} cores, load {load:.1f} before."
    )
    if out:
        about = {"task": task, "median": median, "times": list(times), "page": said, "clock": clock}
        versions = versions_of("viser", "playwright", "sapien")
        write_record(out, {**about, "load": load, "cores": cores, "versions": versions})
    return int(median > ALLOWED)


def _drag(gizmos: Gizmos, drags: int) -> None:
    """Drag all arms in turn, each up and down, until the page has seen enough drags."""
    number, seen, deadline = 0, 0, time.monotonic() + PATIENCE
    with tqdm(total=drags, unit="drags", disable=None) as bar:
        while seen < drags:
            lap, turn = divmod(number, len(gizmos.arms))
            gizmos.drag(gizmos.arms[turn], AXIS, STROKE if lap % 2 else -STROKE)
            number, before, seen = number + 1, seen, len(gizmos.measured()[1])
            bar.update(seen - before)
            if seen > before:
                deadline = time.monotonic() + PATIENCE
            elif time.monotonic() > deadline:
                raise ViewerError(f"the page has shown no drag for {PATIENCE:.0f} s; {seen} so far")


class Gizmos:
    """The gizmos on a page that shows a session.

    Attributes:
        page: The page.
        arms: Names of the arms that can be steered.
        turns: How each gizmo is turned, quaternion (wxyz), by arm.
    """

    def __init__(self, page: Any, address: str, model: Session) -> None:
        """Open the page, and wait until it draws.

        Args:
            page: An empty page of a browser without a graphics card.
            address: Of the page.
            model: A session that stands as the one on the page does; says where arms begin.

        Raises:
            ViewerError: If it never draws the quick picture.
        """
        self.page, self.arms = page, model.arms
        self.turns = {arm: pose[3:] for arm, pose in model.targets.items()}
        self._camera, self._aim = viewpoint(model)
        page.goto(address)
        page.get_by_label(QUICK).wait_for(state="attached")
        self.wait_until(lambda: page.get_by_label(QUICK).is_checked(), "quick picture")
        page.evaluate(_THIRTY_FRAMES)
        page.get_by_role("alert").get_by_role("button").click()  # that there is no graphics card
        box = page.locator("canvas").first.bounding_box()
        self._size = np.array([box["width"], box["height"]])

    def wait(self, seconds: float) -> None:
        """Let the page go on for a while (s)."""
        self.page.wait_for_timeout(1000 * seconds)

    def wait_until(self, holds: Callable[[], bool], what: str) -> None:
        """Wait until something holds.

        Args:
            holds: Tells whether it does.
            what: It is, in words.

        Raises:
            ViewerError: If it does not for two minutes.
        """
        deadline = time.monotonic() + PATIENCE
        while not holds():
            if time.monotonic() > deadline:
                raise ViewerError(f"the page shows no {what} within {PATIENCE:.0f} s")
            self.wait(0.1)

    def measured(self) -> tuple[str, tuple[float, ...]]:
        """Return what the page says of its times from drag to picture, and these times (ms)."""
        return tuple(self.page.evaluate(_MEASURED, HTML_ID))

    def clock(self) -> str:
        """Return what the page says of real time."""
        return CLOCK.findall(self.page.inner_text("body"))[0]

    def targets(self) -> dict[str, tuple[Floats, int]]:
        """Return where the page says that arms are to go, (3,) (m), and how far it is (mm)."""
        found = PLACE.findall(self.page.inner_text("body"))
        return {
            arm: (np.array(row[:3], float), int(row[3]))
            for arm, row in zip(self.arms, found, strict=True)
        }

    def target(self, arm: str) -> Floats:
        """Return where the page says that an arm is to go, once that stands still, (3,) (m)."""
        before, now = None, self.targets()[arm][0]
        while before is None or not np.array_equal(before, now):
            self.wait(0.7)
            before, now = now, self.targets()[arm][0]
        return now

    def project(self, point: Floats) -> Floats:
        """Return where a point of the world, (3,) (m), is on the page, (2,) (pixels)."""
        ahead = self._aim - self._camera
        ahead /= np.linalg.norm(ahead)
        right = np.cross(ahead, [0, 0, 1])
        right /= np.linalg.norm(right)
        way = point - self._camera
        seen = np.array([way @ right, -way @ np.cross(right, ahead)]) / (way @ ahead)
        return self._size / 2 + seen * self._size[1] / 2 / np.tan(FIELD_OF_VIEW / 2)

    def drag(self, arm: str, axis: int, way: float, moves: int = 12) -> None:
        """Drag an arrow of the gizmo of an arm.

        Args:
            arm: Its name.
            axis: Of the gizmo: 0, 1 or 2.
            way: How far (m).
            moves: In how many moves of the mouse.
        """
        along = rotate(self.turns[arm], np.eye(3)[axis])
        grip = self.target(arm) + ARROW * along
        mouse = self.page.mouse
        mouse.move(*self.project(grip))
        self.wait(0.3)
        mouse.down()
        for share in np.linspace(0, 1, moves + 1)[1:]:
            mouse.move(*self.project(grip + share * way * along))
            self.wait(0.06)
        self.wait(0.3)
        mouse.up()


class Served:
    """A command that serves a page.

    Attributes:
        process: The process.
        url: Where its page is.
        lines: What it has printed before that, line by line.
    """

    def __init__(self, *words: str) -> None:
        """Run a command until it says where its page is.

        Args:
            words: Module and arguments, as after ``python -m``.

        Raises:
            ViewerError: If it ends without a page.
        """
        self.process = subprocess.Popen(
            [sys.executable, "-m", *words],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            preexec_fn=_heed_ctrl_c,
        )
        assert self.process.stdout is not None
        self.lines: list[str] = []
        self.url = ""
        for line in self.process.stdout:
            self.lines.append(line.rstrip())
            if found := re.search(r"http://\S+", line):
                self.url = found[0]
                return
        self.process.wait()
        raise ViewerError(f"`{' '.join(words)}` serves no page: {' '.join(self.lines)}")

    def interrupt(self) -> tuple[int, str]:
        """Press Ctrl-C; return the exit status and all that was printed since."""
        self.process.send_signal(signal.SIGINT)
        rest, _ = self.process.communicate(timeout=PATIENCE)
        return self.process.returncode, rest


@contextmanager
def served(*words: str) -> Generator[Served]:
    """Run a command that serves a page, and kill it at the end.

    Args:
        words: Module and arguments, as after ``python -m``.

    Raises:
        ViewerError: If it ends without a page.
    """
    command = Served(*words)
    try:
        yield command
    finally:
        command.process.kill()
        command.process.communicate()


@contextmanager
def running_browser(*flags: str) -> Generator[Any]:
    """Run Debian's chromium, and close it at the end.

    Args:
        flags: More of its flags.

    Raises:
        MissingPackageError: If it is not installed, or playwright, which drives it, is not.
    """
    try:
        from playwright.sync_api import sync_playwright
    except ImportError as error:
        raise MissingPackageError(
            "driving a browser needs playwright: pip install 'robot-layouts[browser]'"
        ) from error
    path = shutil.which("chromium")
    if path is None:
        raise MissingPackageError("there is no chromium to drive: apt-get install chromium")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=[*QUIET, *flags])
        try:
            yield browser
        finally:
            browser.close()


def _heed_ctrl_c() -> None:
    """Undo what a shell does to processes in the background: they would never see Ctrl-C."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)

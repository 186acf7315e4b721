"""Pages of ``view`` commands: served by a process of its own, and looked at in a browser."""

import io
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from PIL import Image

# No traffic of the browser's own.
QUIET = (
    "--no-sandbox --disable-quic --no-first-run --disable-background-networking"
    " --disable-component-update --disable-sync"
).split()
SOFTWARE_WEBGL = (
    "--use-gl=angle --use-angle=swiftshader --enable-unsafe-swiftshader --ignore-gpu-blocklist"
).split()
PATIENCE = 120.0  # s; browsers without a graphics card are slow
SIZE = {"width": 900, "height": 560}
PLAN = 580  # pixels from the left that no panel covers


def _heed_ctrl_c() -> None:
    """Undo what a shell does to processes in the background: they would never see Ctrl-C."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


class Served:
    """A ``view`` command that runs.

    Attributes:
        process: The process.
        url: Where its page is.
        lines: What it has printed.
    """

    def __init__(self, *words: str) -> None:
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
        raise AssertionError(f"no page, but: {self.lines}")

    def interrupt(self) -> tuple[int, str]:
        """Press Ctrl-C; return the exit status and all that was printed since."""
        self.process.send_signal(signal.SIGINT)
        rest, _ = self.process.communicate(timeout=PATIENCE)
        return self.process.returncode, rest


@contextmanager
def served(*words: str) -> Iterator[Served]:
    page = Served(*words)
    try:
        yield page
    finally:
        page.process.kill()
        page.process.communicate()


@contextmanager
def running_browser(*flags: str) -> Iterator[Any]:
    """Run Debian's chromium, with some flags more."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        path = shutil.which("chromium")
        browser = playwright.chromium.launch(executable_path=path, args=[*QUIET, *flags])
        yield browser
        browser.close()


@contextmanager
def browser_page() -> Iterator[tuple[Any, list[str]]]:
    """Yield an empty page of a browser, and the list of all addresses that it asks for."""
    with running_browser(*SOFTWARE_WEBGL) as browser:
        page = browser.new_page(viewport=SIZE)
        page.set_default_timeout(1000 * PATIENCE)
        asked: list[str] = []
        page.on("request", lambda request: asked.append(request.url))
        page.on("websocket", lambda socket: asked.append(socket.url))
        yield page, asked


def wait_until(holds: Callable[[], bool]) -> None:
    """Wait until something holds."""
    deadline = time.monotonic() + PATIENCE
    while not holds():
        assert time.monotonic() < deadline, "it never holds"
        time.sleep(0.01)


def picture(page: Any) -> np.ndarray:
    """Return what no panel covers, (560, 580, 3) int."""
    image = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
    return np.asarray(image, int)[:, :PLAN]


def settled(page: Any, after: Callable[[np.ndarray], bool] = lambda picture: True) -> np.ndarray:
    """Return the picture once it stands still and is as it should be."""
    deadline = time.monotonic() + PATIENCE
    before = picture(page)
    while time.monotonic() < deadline:
        page.wait_for_timeout(400)
        now = picture(page)
        if changed(before, now) < 20 and after(now):
            return now
        before = now
    raise AssertionError("the page does not come to rest as it should")


def changed(one: np.ndarray, other: np.ndarray) -> int:
    """Return how many pixels differ visibly."""
    return int((np.abs(one - other).max(axis=-1) > 24).sum())


def coloured(picture: np.ndarray, rgb: tuple[int, int, int], tolerance: int = 45) -> int:
    """Return how many pixels have nearly a colour."""
    return int((np.abs(picture - np.array(rgb)).max(axis=-1) < tolerance).sum())

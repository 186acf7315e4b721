"""Pages that a command serves, in Debian's chromium."""

from __future__ import annotations

import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Generator
from contextlib import contextmanager
from typing import Any

from layouts.viewer.server import ViewerError
from robots import MissingPackageError

# No traffic of the browser's own.
QUIET = (
    "--no-sandbox --disable-quic --no-first-run --disable-background-networking"
    " --disable-component-update --disable-sync"
).split()
SOFTWARE_WEBGL = (
    "--use-gl=angle --use-angle=swiftshader --enable-unsafe-swiftshader --ignore-gpu-blocklist"
).split()
PATIENCE = 120.0  # s; browsers without a graphics card are slow


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

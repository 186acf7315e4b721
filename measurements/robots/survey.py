"""Tries many URDFs, each in a process of its own: a crash is a result like any other."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path

from measurements.robots.record import Record, Seen
from measurements.robots.sources import Robot
from robots.common.child_process import running
from rollouts.progress import LiveLine

MEMORY = 8 << 30  # bytes of a process
PROBE = "measurements.robots.probe"

_PASSING = re.compile(re.escape(tempfile.gettempdir()) + r"/tmp\w+/")
_CUT_SHORT = re.compile(r"(/[^\s'\"…]*)…")


def survey_into(
    record: Record,
    out: Path,
    robots: Sequence[Robot],
    what: str,
    *,
    workers: int = 1,
    seconds: float = 180.0,
    module: str | None = None,
) -> None:
    """Try robots, and keep what was seen of each in a file at once, with progress on stderr.

    Args:
        record: What is known already; grows.
        out: Its file.
        robots: Which ones.
        what: What they are called while it goes on.
        workers: See `survey`.
        seconds: See `survey`.
        module: See `survey`.

    Raises:
        UnwritableFileError: If the file cannot be written.
        OSError: If no process can be started.
    """
    with LiveLine(len(robots), what) as line:

        def keep(robot: Robot, seen: Seen) -> None:
            record.robots[robot.key] = seen
            record.write(out)
            line.advance(1, robot.key)

        survey(robots, keep, workers=workers, seconds=seconds, module=module)
    record.write(out)


def survey(
    robots: Sequence[Robot],
    keep: Callable[[Robot, Seen], None],
    *,
    workers: int = 1,
    seconds: float = 180.0,
    module: str | None = None,
) -> None:
    """Try robots.

    Args:
        robots: Which ones.
        keep: Called in this thread with what was seen of each, as soon as it is known.
        workers: Processes at a time.
        seconds: What each may take.
        module: What a process runs, if not the probe of URDFs.

    Raises:
        OSError: If no process can be started.
    """
    with ThreadPoolExecutor(workers) as pool:
        waiting = {pool.submit(probe, robot, seconds, module): robot for robot in robots}
        try:
            for done in as_completed(waiting):
                keep(waiting[done], done.result())
        finally:
            pool.shutdown(wait=False, cancel_futures=True)


def probe(robot: Robot, seconds: float, module: str | None = None) -> Seen:
    """Return what one process sees of a robot; ``ended`` says how, where it did not end well."""
    command = [sys.executable, "-m", module or PROBE, str(robot.urdf)]
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    with tempfile.TemporaryFile() as output, tempfile.TemporaryFile() as errors:
        with running(
            command,
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=errors,
            env=environment,
            memory=MEMORY,
        ) as process:
            try:
                code = process.wait(seconds)
            except subprocess.TimeoutExpired:
                code = None
        output.seek(0)
        errors.seek(0)
        lines = output.read().decode(errors="replace").splitlines()
        words = errors.read().decode(errors="replace").strip().splitlines()
    seen: Seen = {"missing": robot.missing_meshes()}
    for line in lines:
        if line.startswith("{"):  # libraries print, too
            seen.update(json.loads(line))
    if code != 0:
        seen["ended"] = _ending(code, seconds, words)
    return without_folders(seen, robot.folder.as_posix())


def _ending(code: int | None, seconds: float, words: Sequence[str]) -> str:
    if code is None:
        return f"took longer than {seconds:g} s"
    if code < 0:
        return f"crashed: {signal.Signals(-code).name}"
    return f"ended with {code}: {words[-1] if words else 'no word'}"


def without_folders(seen: Seen, folder: str) -> Seen:
    """Return a result in which no path names a folder of this machine.

    Args:
        seen: The result; messages may cut paths short.
        folder: The source's folder, to which paths become relative.
    """

    def cut(found: re.Match[str]) -> str:
        return "…" if folder.startswith(found[1]) else found[0]

    text = _PASSING.sub("", json.dumps(seen, ensure_ascii=False))
    text = text.replace(f"{folder}/", "").replace(folder, ".")
    return json.loads(_CUT_SHORT.sub(cut, text))

"""What a fault is: something wrong that the library meets, and what it promises to do then."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from robots import RobotLayoutsError

REFUSED = "one clear error"
GOES_ON = "goes on"

COMMAND_SECONDS = 90.0


def sparse(path: Path) -> None:
    """Make a file of 5 GB of nothing."""
    path.touch()
    os.truncate(path, 5 << 30)


NO_FILES: dict[str, Callable[[Path], object]] = {
    "missing": lambda path: None,
    "a folder": Path.mkdir,
    "a FIFO": os.mkfifo,
    "/dev/zero": lambda path: path.symlink_to("/dev/zero"),
    "a link to itself": lambda path: path.symlink_to(path),
    "5 GB of nothing": sparse,
}
"""What is put to a path at which there is no file to read then."""


@dataclass(frozen=True)
class Fault:
    """Something wrong that the library meets.

    Attributes:
        area: Which part of the library meets it, in one or two words.
        what: What was tried, in a few words; unique in its area.
        run: Tries it, given an empty folder. If the promise is `REFUSED`, it must raise a
            `RobotLayoutsError`; if it is `GOES_ON`, it must return, after it has asserted that
            nothing was lost and that what came out is right. It may return a few words that say
            what happened.
        promise: `REFUSED` or `GOES_ON`.
    """

    area: str
    what: str
    run: Callable[[Path], str | None]
    promise: str = REFUSED


def each(
    area: str,
    what: str,
    run: Callable[[Path, Any], str | None],
    values: Mapping[str, Any],
    promise: str = REFUSED,
) -> Iterator[Fault]:
    """Go through faults of one kind: `run` tries each value, whose name is put into `what`."""
    for name, value in values.items():
        tried = what.replace("{}", name)
        yield Fault(area, tried, lambda folder, value=value: run(folder, value), promise)


def refused(
    area: str, calls: Mapping[str, tuple[Callable[[Any], object], Iterable[Any]]]
) -> Iterator[Fault]:
    """Go through calls that must refuse each of some values, which is put into what is tried."""
    for what, (call, values) in calls.items():
        for value in values:
            tried = what.replace("{}", shown(value))
            yield Fault(area, tried, lambda folder, call=call, value=value: _call(call, value))


def _call(call: Callable[[Any], object], value: Any) -> None:
    call(value)


def shown(value: Any) -> str:
    """Return a value as it is written, in one short line."""
    return " ".join(repr(value).replace(repr(10**400), "10**400").split())[:80]


def run_command(
    *words: str,
    cwd: Path | None = None,
    env: Mapping[str, str] | None = None,
    seconds: float = COMMAND_SECONDS,
) -> subprocess.CompletedProcess[str]:
    """Run ``python -m WORDS`` in a process of its own and return what it printed.

    A command that refuses, which is one that ends with status 1 or 2 and one line ``error: …``,
    raises that line as a `RobotLayoutsError`, as if it had been called here.

    Raises:
        RobotLayoutsError: If the command refuses.
        AssertionError: If it hangs, prints a traceback, or ends in another way than by itself.
    """
    try:
        done = subprocess.run(
            [sys.executable, "-m", *words],
            capture_output=True,
            text=True,
            errors="replace",
            check=False,
            cwd=cwd,
            env=env,
            timeout=seconds,
            stdin=subprocess.DEVNULL,
        )
    except subprocess.TimeoutExpired as error:
        raise AssertionError(f"hangs: no end after {seconds:g} s") from error
    printed = done.stdout + done.stderr
    assert "Traceback (most recent call last)" not in printed, f"a raw error: {printed[-2000:]}"
    assert done.returncode >= 0, f"died by signal {-done.returncode}: {printed[-2000:]}"
    if done.returncode:
        assert done.returncode in (1, 2), f"ended with {done.returncode}: {printed[-2000:]}"
        said = [line for line in done.stderr.splitlines() if "error: " in line]
        assert said, f"ended with {done.returncode} and says no reason: {printed[-2000:]}"
        raise RobotLayoutsError(said[-1].partition("error: ")[2])
    return done

"""How every command ends: by its exit code and at most one line, whatever becomes of its output."""

from __future__ import annotations

import errno
import io
import os
import signal
import sys
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from typing import Any, NoReturn, TextIO

from robot_layouts.core.errors import RobotLayoutsError, UnknownNameError

FAILED, MEANINGLESS, INTERRUPTED = 1, 2, 130  # exit codes; 130 is what shells have for Ctrl-C
LOOPBACK = "127.0.0.1"  # where a server is reached from this machine alone

_NOBODY_READS = (errno.EPIPE, errno.EIO)  # the end of a pipe, or of a terminal


class UsageError(RobotLayoutsError, ValueError):
    """Words of a command line that contradict each other."""


class OutputError(RobotLayoutsError, OSError):
    """What a command prints cannot be written, to a full disk, say."""


def exit_code(run: Callable[[], int | None], *, failed: int = FAILED) -> int:
    """Run a command; what it refuses is printed on stderr in one line.

    Args:
        run: The command; returns its exit code, or None for 0.
        failed: The exit code after an error of this library; that of a name which is in no
            catalogue is 2, and so is that of contradicting options.
    """
    try:
        return run() or 0
    except (UnknownNameError, UsageError) as error:
        print_error(error)
        return MEANINGLESS
    except RobotLayoutsError as error:
        print_error(error)
        return failed


def print_error(error: RobotLayoutsError) -> None:
    """Print an error on stderr; control characters, which files may bring along, are spelt out."""
    notice(f"error: {printable(str(error))}")


def printable(text: str) -> str:
    """Return a text in which no character but a line's end steers a terminal."""
    return "".join(c if c.isprintable() or c == "\n" else ascii(c)[1:-1] for c in text)


def notice(text: str) -> None:
    """Print a line on stderr, where there is one; it is never a reason to fail."""
    if sys.stderr is not None:  # pyright: ignore[reportUnnecessaryComparison]  # in a daemon
        with suppress(OSError, ValueError):  # its reader is gone, or it was closed
            print(text, file=sys.stderr, flush=True)


def print_table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Print a table on stdout; brackets in it are no markup."""
    from rich import box
    from rich.console import Console
    from rich.table import Table

    table = Table(*heads, box=box.SIMPLE_HEAD, pad_edge=False)
    for row in rows:
        table.add_row(*row)
    Console(markup=False, highlight=False).print(table)


def is_watched() -> bool:
    """Return whether stderr is a terminal."""
    return sys.stderr is not None and not sys.stderr.closed and sys.stderr.isatty()  # pyright: ignore[reportUnnecessaryComparison]


def start(main: Callable[[], int]) -> NoReturn:
    """Run a command as this process, and end it.

    Output whose reader is gone, or that was closed from the start, is dropped; the command
    goes on and ends with its own exit code. Ctrl-C ends it with 130.
    """
    while (descriptor := os.open(os.devnull, os.O_RDWR)) <= 2:  # closed ones, which others inherit
        os.set_inheritable(descriptor, True)
    os.close(descriptor)
    sys.stdin = sys.stdin or open(os.devnull, encoding="utf-8")  # noqa: SIM115
    sys.stdout, sys.stderr = _stream(sys.stdout, 1), _stream(sys.stderr, 2)
    try:
        code = main()
        code = exit_code(sys.stdout.flush) or code
    except KeyboardInterrupt:
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # another one while Python ends
        notice("interrupted")
        code = INTERRUPTED
    sys.exit(code)


def _stream(present: TextIO | None, descriptor: int) -> TextIO:
    if present is None:
        return open(os.devnull, "w", encoding="utf-8")
    present.flush()
    return io.TextIOWrapper(
        io.BufferedWriter(_Output(descriptor, "w", closefd=False)),
        encoding=present.encoding,
        errors="backslashreplace",  # where a terminal is not UTF-8
        line_buffering=descriptor == 2 or present.isatty(),
    )


class _Output(io.FileIO):
    """Stdout or stderr; what cannot be written there is dropped from then on."""

    def write(self, data: Any, /) -> int:
        try:
            return super().write(data)
        except OSError as error:
            os.dup2(os.open(os.devnull, os.O_WRONLY), self.fileno())
            if self.fileno() == 1 and error.errno not in _NOBODY_READS:
                words = f"cannot write the output: {error.strerror}"
                raise OutputError(words) from error
            return len(data)

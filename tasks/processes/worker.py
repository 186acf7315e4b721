"""A worker process from its start to its end, with the line over which it is talked to."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing, suppress
from typing import Any, Generic, Protocol, TypeVar

from tasks.processes import process as processes

FAREWELL_SECONDS = 2.0  # that a worker whose line is closed may take to end


class Line(Protocol):
    """One end of a connection."""

    def close(self) -> None:
        """Close it."""
        ...


AnyLine = TypeVar("AnyLine", bound=Line)


class Worker(Generic[AnyLine]):
    """A process of this machine that ends with this one.

    Attributes:
        line: This process's end of the line to it.
        pid: Its number.
        sentinel: What becomes readable when it ends, a file descriptor.
    """

    def __init__(
        self, ends: tuple[AnyLine, AnyLine], work: Callable[..., None], *arguments: Any
    ) -> None:
        """Start it.

        Args:
            ends: Both ends of a line; the second one is the process's and is closed here.
            work: What it runs, with its end of the line and the other arguments.
            arguments: They can be pickled.

        Raises:
            ProcessError: If it cannot be started; both ends are closed then.
        """
        self.line, theirs = ends
        self._process = processes.context.Process(
            target=work, args=(theirs, *arguments), daemon=True
        )
        try:
            with closing(theirs):
                processes.start(self._process)
        except BaseException:
            self.line.close()
            raise
        self.pid, self.sentinel = self._process.pid or 0, self._process.sentinel

    @property
    def exit_code(self) -> int | None:
        """Its exit code, negative if a signal ended it; None while it runs."""
        return self._process.exitcode

    def death(self, patience: float = FAREWELL_SECONDS) -> str:
        """Say how it ended, or that it closed the line if it runs on for so long (s)."""
        self._process.join(patience)
        return processes.ending(self._process.exitcode)

    def wait(self, patience: float) -> None:
        """Wait until it has ended by itself, no longer than so many seconds."""
        self._process.join(patience)

    def kill(self, patience: float | None = None) -> None:
        """End it at once, and wait so long until it is gone (s); None waits for ever."""
        self._process.kill()
        self._process.join(patience)

    def end(self, patience: float = 0.0) -> None:
        """Close its line and end it, after a while in which it may do so by itself (s).

        Doing so twice is allowed.
        """
        self.line.close()
        with suppress(ValueError):  # it was ended before
            if self._process.exitcode is None:
                self.wait(patience)
                self.kill()
            self._process.close()

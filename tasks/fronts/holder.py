"""One worker process of a vector, what it was asked for, and what it has answered."""

from __future__ import annotations

import pickle
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from tasks.fronts.batch import Part
from tasks.fronts.lost import WorkerError
from tasks.fronts.work import CallFailed, work
from tasks.processes.channel import Channel
from tasks.processes.worker import Worker


class Gone(Exception):
    """A worker that can answer no more; says why, and where if it was an error."""

    def __init__(self, reason: str, traceback: str = "") -> None:
        """Take the reason, in words, and the traceback of an error."""
        super().__init__(reason)
        self.reason, self.traceback = reason, traceback


@dataclass(eq=False, slots=True)
class Asked:
    """What a worker was asked for.

    Attributes:
        number: Of the call, among the worker's.
        method: Name of what was called.
        done: Whether it has been done.
        answer: What came back.
    """

    number: int
    method: str
    done: bool = False
    answer: Any = None


class Holder(Worker[Channel]):
    """A process that holds some parts of a vector and does one thing after the other.

    Attributes:
        begun: Its first answer, which tells what arrays its parts need.
        open: What it was asked for and has not answered yet, in order.
        descriptors: What becomes readable when there is something to hear.
    """

    def __init__(self, share: Sequence[Part], timeout: float | None) -> None:
        """Start it.

        Args:
            share: The parts that it holds.
            timeout: Seconds that sending may take; None waits for ever.

        Raises:
            WorkerError: If the task cannot be sent to it.
            ProcessError: If it cannot be started.
        """
        packed = _packed(share)
        super().__init__(Channel.pair(), work)
        self._count = 0
        self.open: list[Asked] = []
        if timeout is not None:
            self.line.limit_sending(timeout)
        # The end of the process is watched as well: a process that it forked may hold its end of
        # the line open.
        self.descriptors = self.line.fileno(), self.sentinel
        self.begun = self._send("__init__", packed)

    def ask(
        self,
        place: int | None,
        method: str,
        arguments: tuple[Any, ...],
        descriptors: Sequence[int] = (),
    ) -> Asked:
        """Let it do something, after what it was asked for before.

        Args:
            place: Which of its parts does it; None is the worker itself.
            method: A method of `Batch`, or one of `tasks.fronts.work`'s own.
            arguments: What the method is called with.
            descriptors: File descriptors that go with it.
        """
        return self._send(method, pickle.dumps((place, method, arguments)), descriptors)

    def hear(self) -> None:
        """Read what has arrived. An answer tells that all that was asked before is done as well.

        Raises:
            Gone: If it has ended, or failed.
            RobotLayoutsError: What it could not make its task for.
        """
        try:
            message = self.line.receive_now()
        except BlockingIOError:
            if self.exit_code is None:
                return
            raise Gone(self.death()) from None
        except (EOFError, OSError):
            raise Gone(self.death()) from None
        if message is not None:
            self._take(*message)

    # -- inside ------------------------------------------------------------------------------

    def _send(self, method: str, message: bytes, descriptors: Sequence[int] = ()) -> Asked:
        asked = Asked(self._count, method)
        self._count += 1
        self.open.append(asked)
        with suppress(OSError):  # it died: that is read from the line
            self.line.send(asked.number, message, descriptors)
        return asked

    def _take(self, number: int, message: bytes) -> None:
        answer, error = pickle.loads(message)
        if error is not None:
            raise self._failure(number, error)
        for asked in self.open:
            if asked.number == number:
                asked.answer = answer
            if asked.number <= number:
                asked.done = True
        self.open = [asked for asked in self.open if not asked.done]

    def _failure(self, number: int, error: Exception) -> Exception:
        method = next((asked.method for asked in self.open if asked.number == number), "")
        building = method == "__init__"
        if building and not isinstance(error, CallFailed):
            return error
        what = str(error) if isinstance(error, CallFailed) else f"{type(error).__name__}: {error}"
        call = "making its task" if building else f"{method}()"
        where = error.__cause__.args if error.__cause__ else ()
        return Gone(f"failed in {call} with {what}", *where)


def _packed(share: Sequence[Part]) -> bytes:
    try:
        return pickle.dumps(tuple(share))
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise WorkerError(
            f"the task cannot be sent to worker processes: {error}; define its class in a module"
            " that they can import, or take num_workers=0"
        ) from error

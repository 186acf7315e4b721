"""Worker processes that hold the environments of a vector, and what happens when one fails."""

from __future__ import annotations

import os
import pickle
import select
import time
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from robots import SimulationError
from tasks.fronts.batch import Part
from tasks.fronts.board import (
    Arrays,
    Shapes,
    board_size,
    lay_out,
    map_shared_memory,
    new_shared_memory,
)
from tasks.fronts.work import ATTACH, SETTLE, CallFailed, work
from tasks.processes import process as processes
from tasks.processes.channel import Channel
from tasks.processes.process import WorkerTraceback, enough
from tasks.processes.worker import FAREWELL_SECONDS, Worker

START_SECONDS = 300.0  # until all workers have built their worlds


@dataclass(frozen=True)
class Failure:
    """A worker that is gone.

    Attributes:
        worker: Its number.
        env_ids: The environments that are gone with it.
        reason: What happened to it, in words.
        traceback: Where an error came up in it; empty if there was none.
    """

    worker: int
    env_ids: range
    reason: str
    traceback: str = ""


class WorkerError(processes.WorkerError):
    """Workers of a vector that died, hung or failed; the others have done what they were asked.

    If tasks raised something in them, the ``__cause__`` says where.

    Attributes:
        failures: The workers that are gone.
        env_ids: The numbers of the environments that are gone with them.
        seeds: The last seed that each of them was given.
        results: What the call would have returned; the rows of ``env_ids`` mean nothing. None
            if there was nothing to return.
    """

    def __init__(
        self,
        message: str,
        failures: Iterable[Failure] = (),
        seeds: Iterable[int] = (),
        results: Any = None,
    ) -> None:
        """Take what is known of the failure."""
        super().__init__(message)
        self.failures = tuple(failures)
        self.env_ids = [i for failure in self.failures for i in failure.env_ids]
        self.seeds = list(seeds)
        self.results = results


class WorkersFailed(Exception):
    """Some workers failed; says which. The vector turns it into a `WorkerError`."""

    def __init__(self, failures: list[Failure]) -> None:
        """Take the failures, at least one."""
        super().__init__(failures)
        self.failures = failures

    @property
    def where(self) -> WorkerTraceback | None:
        """Where the errors came up; None if there were none."""
        texts = dict.fromkeys(failure.traceback for failure in self.failures if failure.traceback)
        return WorkerTraceback("\n\n".join(texts)) if texts else None


class Workers:
    """Processes that hold one part of a vector each and write to one shared board.

    Attributes:
        parts: Which part each worker holds.
        arrays: The board, with a row for every environment.
        failures: Workers that are gone, by number.
    """

    def __init__(self, parts: list[Part], timeout: float | None) -> None:
        """Start the processes and wait until their worlds are built.

        Args:
            parts: Which environments each worker holds.
            timeout: Seconds that workers may take for an answer; None waits for ever.

        Raises:
            WorkersFailed: If a worker ends before it is ready.
            RobotLayoutsError: What a worker could not make its task for, or what ran out.
        """
        self.parts, self._timeout = parts, timeout
        self.arrays: Arrays = {}
        self.failures: dict[int, Failure] = {}
        self._crew: dict[int, _Worker] = {}
        self._shapes: Shapes = {}
        self._descriptor = -1
        self._owner = os.getpid()
        try:
            self.start(range(len(parts)))
        except BaseException:
            self.close()
            raise

    def start(self, numbers: Iterable[int]) -> None:
        """Start workers, in the place of those that are gone.

        Raises:
            WorkersFailed: If one ends before it is ready.
            RobotLayoutsError: What a worker could not make its task for, or what ran out.
        """
        numbers = list(numbers)
        try:
            with enough():
                for i in numbers:
                    self._end(i)  # Ctrl-C may have come before that
                    self._crew[i] = _Worker(self.parts[i], self._timeout)
                shapes = self._collect(numbers, START_SECONDS)
                if self._descriptor < 0:
                    self._make_board(shapes[numbers[0]])
                board = (self._shapes, self.parts[-1].stop)
                for i in numbers:
                    self._crew[i].send(ATTACH, board, [self._descriptor])
                self._collect(numbers, START_SECONDS)
        except BaseException:
            for i in numbers:
                self._end(i)
            raise
        for i in numbers:
            self.failures.pop(i, None)

    def call(self, method: str, arguments: Mapping[int, tuple[Any, ...]]) -> dict[int, Any]:
        """Let workers do something, all at once, and return what they answer.

        Args:
            method: A method of `Batch`.
            arguments: Number of a worker → what it calls the method with.

        Raises:
            WorkersFailed: If workers die, hang or fail; the others have done it.
        """
        unsettled = {i: () for i, worker in self._crew.items() if not worker.settled}
        if unsettled:  # a call before was interrupted
            self._exchange(SETTLE, unsettled)
        return self._exchange(method, arguments)

    def expect_owner(self) -> None:
        """Refuse to go on in a fork, which would talk to the same processes.

        Raises:
            SimulationError: If this process is a fork of the one that started them.
        """
        if os.getpid() != self._owner:
            raise SimulationError(
                f"this vector belongs to process {self._owner}, of which this one is a fork; make"
                " one of its own here"
            )

    def close(self) -> None:
        """End all processes and let the memory go; closing twice is allowed.

        A fork only lets go of what it shares with the process that started them.
        """
        crew, self._crew = self._crew, {}
        for worker in crew.values():
            worker.line.close()
        deadline = time.monotonic() + FAREWELL_SECONDS
        for worker in crew.values():
            worker.end(max(0.0, deadline - time.monotonic()))
        self.arrays = {}
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1

    # -- inside ------------------------------------------------------------------------------

    def _make_board(self, shapes: Shapes) -> None:
        num_envs = self.parts[-1].stop
        size = board_size(shapes, num_envs)
        self._shapes, self._descriptor = shapes, new_shared_memory(size)
        memory = map_shared_memory(os.dup(self._descriptor), size)
        self.arrays = lay_out(memory, shapes, num_envs)

    def _exchange(self, method: str, arguments: Mapping[int, tuple[Any, ...]]) -> dict[int, Any]:
        for i, own in arguments.items():
            self._crew[i].send(method, own)
        return self._collect(list(arguments), self._timeout)

    def _collect(self, numbers: list[int], timeout: float | None) -> dict[int, Any]:
        """Wait until workers have answered, and return the answers of those that did."""
        deadline = None if timeout is None else time.monotonic() + timeout
        answers, failures = dict[int, Any](), list[Failure]()
        waiting = {i: self._crew[i].descriptors for i in numbers}
        senders = {descriptor: i for i, own in waiting.items() for descriptor in own}
        poller = select.poll()
        for descriptor in senders:
            poller.register(descriptor, select.POLLIN)
        while waiting:
            left = None if deadline is None else max(0.0, deadline - time.monotonic()) * 1000
            ready = {senders[descriptor] for descriptor, _ in poller.poll(left)}
            for i in ready:
                try:
                    if not self._crew[i].has_answered():
                        continue
                    answers[i] = self._crew[i].answer()
                except _Gone as gone:
                    failures.append(self._lose(i, gone.reason, gone.traceback))
                for descriptor in waiting.pop(i):
                    poller.unregister(descriptor)
            if not ready:
                failures.extend(
                    self._lose(i, f"did not answer within {timeout:g} s and was ended")
                    for i in waiting
                )
                break
        if failures:
            raise WorkersFailed(sorted(failures, key=lambda failure: failure.worker))
        return answers

    def _lose(self, number: int, reason: str, where: str = "") -> Failure:
        reason = f"process {self._crew[number].pid} {reason}"
        failure = Failure(number, self.parts[number].env_ids, reason, where)
        self.failures[number] = failure
        self._end(number)
        return failure

    def _end(self, number: int) -> None:
        if number in self._crew:
            self._crew[number].end(0.0)
            del self._crew[number]


class InProcess:
    """The same without processes, for debugging: one batch holds all environments.

    Attributes:
        parts: The only part.
        arrays: The board, with a row for every environment.
        failures: Nothing; what fails is raised as it is.
    """

    def __init__(self, part: Part) -> None:
        """Make the batch.

        Raises:
            RobotLayoutsError: If the task cannot be made.
        """
        from tasks.fronts.batch import Batch

        self.parts = [part]
        self.failures: dict[int, Failure] = {}
        self._batch = Batch(part)
        shapes = self._batch.shapes()
        memory = bytearray(board_size(shapes, part.stop))
        self.arrays = lay_out(memory, shapes, part.stop)
        self._batch.attach(self.arrays)

    def start(self, numbers: Iterable[int]) -> None:
        """Do nothing: nothing is ever gone."""

    def expect_owner(self) -> None:
        """Do nothing: a fork has worlds of its own."""

    def call(self, method: str, arguments: Mapping[int, tuple[Any, ...]]) -> dict[int, Any]:
        """Call a method of the batch; see `Workers.call`."""
        return {i: getattr(self._batch, method)(*own) for i, own in arguments.items()}

    def close(self) -> None:
        """Let the worlds go."""
        self._batch.close()
        self.arrays = {}


class _Gone(Exception):
    """A worker that can answer no more; says why, and where if it was an error."""

    def __init__(self, reason: str, traceback: str = "") -> None:
        super().__init__(reason)
        self.reason, self.traceback = reason, traceback


class _Worker(Worker[Channel]):
    """One process, which holds one part.

    Attributes:
        settled: Whether it has answered what it was asked last.
    """

    def __init__(self, part: Part, timeout: float | None) -> None:
        packed = _packed(part)
        super().__init__(Channel.pair(), work)
        self.settled, self._number = False, 0
        self._asked = "__init__"  # its first answer tells the shapes
        self._message = b""
        if timeout is not None:
            self.line.limit_sending(timeout)
        # The end of the process is watched as well: a process that it forked may hold its end of
        # the line open.
        self.descriptors = self.line.fileno(), self.sentinel
        with suppress(OSError):  # it died: that is read from the line
            self.line.send(self._number, packed)

    def send(
        self, method: str, arguments: tuple[Any, ...], descriptors: Sequence[int] = ()
    ) -> None:
        """Let it do something."""
        self.settled = False
        self._asked, self._number = method, self._number + 1
        with suppress(OSError):
            self.line.send(self._number, pickle.dumps((method, arguments)), descriptors)

    def has_answered(self) -> bool:
        """Read what has arrived; returns whether that is its answer to what it was asked last."""
        try:
            message = self.line.receive_now()
        except BlockingIOError:
            if self.exit_code is None:
                return False
            raise _Gone(self.death()) from None
        except (EOFError, OSError):
            raise _Gone(self.death()) from None
        if message is None or message[0] != self._number:
            return False
        _, self._message = message
        self.settled = True
        return True

    def answer(self) -> Any:
        """Return its answer.

        Raises:
            RobotLayoutsError: What it could not make its task for.
        """
        answer, error = pickle.loads(self._message)
        if error is None:
            return answer
        if self._asked == "__init__" and not isinstance(error, CallFailed):
            raise error
        what = str(error) if isinstance(error, CallFailed) else f"{type(error).__name__}: {error}"
        call = "making its task" if self._asked == "__init__" else f"{self._asked}()"
        where = error.__cause__.args if error.__cause__ else ()
        raise _Gone(f"failed in {call} with {what}", *where)


def _packed(part: Part) -> bytes:
    try:
        return pickle.dumps(part)
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise WorkerError(
            f"the task cannot be sent to worker processes: {error}; define its class in a module"
            " that they can import, or take num_workers=0"
        ) from error

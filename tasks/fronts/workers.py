"""Worker processes that hold the environments of a vector, and what happens when one fails."""

from __future__ import annotations

import os
import select
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
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
from tasks.fronts.holder import Asked, Gone, Holder
from tasks.fronts.lost import Failure, WorkerError, WorkersFailed
from tasks.fronts.steps import Steps
from tasks.fronts.work import ATTACH, SETTLE
from tasks.processes.process import enough
from tasks.processes.worker import FAREWELL_SECONDS

__all__ = ["Failure", "WorkerError", "Workers", "WorkersFailed"]

START_SECONDS = 300.0  # until all workers have built their worlds


class Workers:
    """Processes that hold parts of a vector and write to one shared board.

    Attributes:
        parts: All parts, in the order of their environments.
        arrays: The board, with a row for every environment.
        failures: Workers that are gone, by number.
        steps: Steps of environments that were begun and not taken yet.
    """

    def __init__(self, shares: Sequence[Sequence[Part]], timeout: float | None) -> None:
        """Start the processes and wait until their worlds are built.

        Args:
            shares: The parts that each worker holds, the environments in order.
            timeout: Seconds that workers may take for an answer; None waits for ever.

        Raises:
            WorkersFailed: If a worker ends before it is ready.
            RobotLayoutsError: What a worker could not make its task for, or what ran out.
        """
        self.parts = [part for share in shares for part in share]
        self.arrays: Arrays = {}
        self.failures: dict[int, Failure] = {}
        self.steps: Steps[Asked] = Steps()
        self._shares, self._timeout = shares, timeout
        self._places = [(i, k) for i, share in enumerate(shares) for k in range(len(share))]
        self._crew: dict[int, Holder] = {}
        self._poller = select.poll()
        self._senders: dict[int, int] = {}  # file descriptor → whose it is
        self._shapes: Shapes = {}
        self._descriptor = -1
        self._owner = os.getpid()
        self._torn = False  # whether what was waited for last may have been missed
        try:
            self.start(range(len(shares)))
        except BaseException:
            self.close()
            raise

    def env_ids(self, worker: int) -> range:
        """Return the numbers of the environments that a worker holds."""
        share = self._shares[worker]
        return range(share[0].start, share[-1].stop)

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
                    self._crew[i] = Holder(self._shares[i], self._timeout)
                    for descriptor in self._crew[i].descriptors:
                        self._senders[descriptor] = i
                        self._poller.register(descriptor, select.POLLIN)
                begun = {i: self._crew[i].begun for i in numbers}
                shapes = self._answers(begun, START_SECONDS)
                if self._descriptor < 0:
                    self._make_board(shapes[numbers[0]])
                board = (self._shapes, self.parts[-1].stop)
                attached = {
                    i: self._crew[i].ask(None, ATTACH, board, [self._descriptor]) for i in numbers
                }
                self._answers(attached, START_SECONDS)
        except BaseException:
            for i in numbers:
                self._end(i)
            raise
        for i in numbers:
            self.failures.pop(i, None)

    def call(self, method: str, arguments: Mapping[int, tuple[Any, ...]]) -> dict[int, Any]:
        """Let parts do something, all at once, and return what they answer.

        Each does it after the steps that it was sent before.

        Args:
            method: A method of `Batch`.
            arguments: Number of a part → what it calls the method with.

        Raises:
            WorkersFailed: If workers die, hang or fail; the others have done it.
        """
        asked: dict[int, Asked] = {}
        for number, own in arguments.items():
            worker, place = self._places[number]
            asked[number] = self._crew[worker].ask(place, method, own)
        return self._answers(asked, self._timeout)

    def send(self, number: int, env_ids: Sequence[int]) -> None:
        """Let a part step some of its environments, and do not wait for it.

        Args:
            number: The part's number.
            env_ids: The environments' numbers in the vector; their actions are on the board.
        """
        worker, place = self._places[number]
        part = self.parts[number]
        some = () if len(env_ids) == len(part.env_ids) else ([i - part.start for i in env_ids],)
        self.steps.add(env_ids, lambda: self._crew[worker].ask(place, "step", some))

    def take(self, count: int) -> list[int]:
        """Wait until so many environments have been stepped, and return which.

        Those that were sent first come first. The others stay, until they are taken.

        Raises:
            WorkersFailed: If workers die, hang or fail before.
        """
        self._settle()
        self._wait(lambda: bool(self.failures) or self.steps.ready >= count, self._timeout)
        return self.steps.take(count)

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

    def _settle(self) -> None:
        """Learn what was answered while an interrupt ended the wait for it."""
        if self._torn:
            open_ = [worker for worker in self._crew.values() if worker.open]
            asked = [worker.ask(None, SETTLE, ()) for worker in open_]
            self._wait(lambda: all(one.done for one in asked), self._timeout)

    def _answers(self, asked: Mapping[int, Asked], timeout: float | None) -> dict[int, Any]:
        self._wait(lambda: all(one.done for one in asked.values()), timeout)
        return {i: one.answer for i, one in asked.items()}

    def _wait(self, over: Callable[[], bool], timeout: float | None) -> None:
        """Hear workers until something is so, or nobody is left who could change it.

        Raises:
            WorkersFailed: If workers died, hung or failed meanwhile.
        """
        deadline = None if timeout is None else time.monotonic() + timeout
        failures: list[Failure] = []
        self._torn = True
        while not over():
            waiting = [i for i, worker in self._crew.items() if worker.open]
            if not waiting:
                break
            left = None if deadline is None else max(0.0, deadline - time.monotonic()) * 1000
            ready = {self._senders[descriptor] for descriptor, _ in self._poller.poll(left)}
            for i in ready:
                try:
                    self._crew[i].hear()
                except Gone as gone:
                    failures.append(self._lose(i, gone.reason, gone.traceback))
            if not ready:
                failures += [
                    self._lose(i, f"did not answer within {timeout:g} s and was ended")
                    for i in waiting
                ]
        self._torn = False
        if failures:
            raise WorkersFailed(sorted(failures, key=lambda failure: failure.worker))

    def _lose(self, number: int, reason: str, where: str = "") -> Failure:
        reason = f"process {self._crew[number].pid} {reason}"
        failure = Failure(number, self.env_ids(number), reason, where)
        self.failures[number] = failure
        self.steps.forget(self.env_ids(number))
        self._end(number)
        return failure

    def _end(self, number: int) -> None:
        for descriptor in [d for d, i in self._senders.items() if i == number]:
            self._poller.unregister(descriptor)
            del self._senders[descriptor]
        if number in self._crew:
            self._crew[number].end(0.0)
            del self._crew[number]

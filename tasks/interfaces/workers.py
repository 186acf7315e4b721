"""Where the environments of a vector are: in worker processes, or in this one."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from robot_layouts.core.processes.start import WorkerError, enough, preload
from robot_layouts.core.processes.transport import RemoteError, WorkerTraceback, packed
from robot_layouts.core.processes.worker import (
    MAKE,
    Pool,
    Reply,
    Status,
    Worker,
    receive_descriptor,
)
from tasks.interfaces.batch import (
    Arrays,
    Batch,
    BatchPart,
    Shapes,
    lay_out,
    map_memory,
    memory_size,
    new_shared_memory,
)

preload(__name__)

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


class VectorWorkerError(WorkerError):
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
        self, failures: Sequence[Failure], seeds: Sequence[int] = (), hint: str = ""
    ) -> None:
        """Take what is known of the failures.

        Args:
            failures: The workers that are gone, at least one.
            seeds: The last seed of every environment of the vector.
            hint: What can be done about it.
        """
        self.failures = tuple(failures)
        self.env_ids = [i for failure in failures for i in failure.env_ids]
        self.seeds = [seeds[i] for i in self.env_ids]
        self.results: Any = None
        lines = [
            f"worker {failure.worker} with environments {list(failure.env_ids)} of seeds"
            f" {[seeds[i] for i in failure.env_ids]}: {failure.reason}"
            for failure in failures
        ]
        super().__init__("; ".join([*lines, hint]))
        texts = dict.fromkeys(failure.traceback for failure in failures if failure.traceback)
        self.__cause__ = WorkerTraceback("\n\n".join(texts)) if texts else None


@dataclass(eq=False, slots=True)
class Request:
    """What a part was asked for.

    Attributes:
        number: Of the request, among its worker's.
        method: Name of what was called.
        done: Whether it has been done.
        result: What came back.
    """

    number: int
    method: str
    done: bool = False
    result: Any = None


class Pending:
    """Steps of environments that were begun and not taken yet, in the order of their beginning."""

    def __init__(self) -> None:
        """Begin without any."""
        self._steps: list[tuple[Request, list[int]]] = []

    def add(self, request: Request, env_ids: Iterable[int]) -> None:
        """Add a step of some environments."""
        self._steps.append((request, list(env_ids)))

    @property
    def env_ids(self) -> list[int]:
        """The environments whose results were not taken yet."""
        return [i for _, env_ids in self._steps for i in env_ids]

    @property
    def ready(self) -> int:
        """How many of them can be taken now."""
        return sum(len(env_ids) for request, env_ids in self._steps if request.done)

    def take(self, count: int) -> list[int]:
        """Return so many environments that are ready, those begun first, in ascending order."""
        taken: list[int] = []
        left: list[tuple[Request, list[int]]] = []
        for request, env_ids in self._steps:
            room = count - len(taken) if request.done else 0
            taken += env_ids[:room]
            if env_ids[room:]:
                left.append((request, env_ids[room:]))
        self._steps = left  # at once: an interrupt before leaves all where it was
        return sorted(taken)

    def forget(self, env_ids: Iterable[int]) -> None:
        """Drop the steps of some environments."""
        gone = set(env_ids)
        left = [(request, [i for i in own if i not in gone]) for request, own in self._steps]
        self._steps = [(request, own) for request, own in left if own]


def partition(num_envs: int, num_workers: int, batch_size: int) -> list[list[range]]:
    """Return, for each worker, the environments of each of its parts.

    Every worker holds some consecutive ones, in parts no larger than what `recv` returns. A worker
    with several parts goes on with the next one while the results of the last are looked at. Parts
    are as large as that allows: what a step costs beside its physics, most of it once per part.

    Args:
        num_envs: How many environments there are.
        num_workers: Worker processes; 0 is this process.
        batch_size: How many environments are received at once.
    """
    count = max(num_workers, 1)
    bounds = [(i * num_envs) // count for i in range(count + 1)]
    return [
        [range(i, min(i + batch_size, stop)) for i in range(start, stop, batch_size)]
        for start, stop in zip(bounds, bounds[1:], strict=False)
    ]


def batch_arguments(part: BatchPart, env_ids: Sequence[int]) -> tuple[list[int], ...]:
    """Return what `Batch.step` is called with to step some environments of a part."""
    return () if len(env_ids) == len(part.env_ids) else ([i - part.start for i in env_ids],)


class InProcess:
    """This process in the place of `Workers`, for debugging and for few environments.

    What fails is raised as it is.
    """

    def __init__(self, parts: Sequence[BatchPart]) -> None:
        """Make the batches.

        Raises:
            RobotLayoutsError: If the task cannot be made.
        """
        self.parts = list(parts)
        self.failures: dict[int, Failure] = {}
        self.pending = Pending()
        self.batches = [Batch(part) for part in parts]
        shapes, count = self.batches[0].shapes(), parts[-1].stop
        self.arrays = lay_out(bytearray(memory_size(shapes, count)), shapes, count)
        for batch in self.batches:
            batch.attach(self.arrays)

    def env_ids(self, worker: int) -> range:
        """Return nothing: there are no workers."""
        return range(0)

    def restart(self, numbers: Sequence[int]) -> None:
        """Do nothing: nothing is ever gone."""

    def call(self, method: str, arguments: Mapping[int, tuple[Any, ...]]) -> dict[int, Any]:
        """Call a method of some batches."""
        return {i: getattr(self.batches[i], method)(*own) for i, own in arguments.items()}

    def send(self, number: int, env_ids: list[int]) -> None:
        """Step environments at once."""
        self.batches[number].step(*batch_arguments(self.parts[number], env_ids))
        self.pending.add(Request(0, "step", done=True), env_ids)

    def take(self, count: int) -> list[int]:
        """Return environments that were stepped."""
        return self.pending.take(count)

    def close(self) -> None:
        """Let the worlds go."""
        for batch in self.batches:
            batch.close()
        self.arrays = {}


class Workers:
    """Worker processes that hold parts of a vector and write to memory that all share.

    Attributes:
        parts: All parts, in the order of their environments.
        arrays: What they write to, with a row for every environment.
        failures: Workers that are gone, by number.
        pending: Steps of environments that were begun and not taken yet.
        timeout: Seconds that workers may take for a reply; None waits for ever.
    """

    def __init__(
        self, by_worker: Sequence[Sequence[BatchPart]], timeout: float | None, seeds: Sequence[int]
    ) -> None:
        """Start the processes and wait until their worlds are built.

        Args:
            by_worker: The parts that each worker holds, the environments in order.
            timeout: Seconds that workers may take for a reply; None waits for ever.
            seeds: The last seed of every environment, which errors name.

        Raises:
            VectorWorkerError: If a worker ends before it is ready.
            RobotLayoutsError: What a worker could not make its task for, or what ran out.
        """
        self.parts = [part for own in by_worker for part in own]
        self.arrays: Arrays = {}
        self.failures: dict[int, Failure] = {}
        self.pending = Pending()
        self.pool, self.workers = Pool(), dict[int, Worker]()
        self.timeout = timeout
        self._by_worker, self._seeds = by_worker, seeds
        self._places = [(i, k) for i, own in enumerate(by_worker) for k in range(len(own))]
        self._open: dict[int, list[Request]] = {}  # not replied to yet, in order
        self._shapes: Shapes = {}
        self._descriptor = -1
        self._made = False
        self._interrupted = False  # a reply that was waited for may have been missed
        try:
            self.restart(range(len(by_worker)))
        except BaseException:
            self.close()
            raise
        self._made = True

    def env_ids(self, worker: int) -> range:
        """Return the numbers of the environments that a worker holds."""
        own = self._by_worker[worker]
        return range(own[0].start, own[-1].stop)

    def restart(self, numbers: Sequence[int]) -> None:
        """Start workers, in the place of those that are gone.

        Raises:
            VectorWorkerError: If one ends before it is ready.
            RobotLayoutsError: What a worker could not make its task for, or what ran out.
        """
        try:
            with enough():
                begun = {i: self._spawn(i) for i in numbers}
                shapes = self._results(begun, START_SECONDS)
                if self._descriptor < 0:
                    self._make_memory(shapes[numbers[0]])
                attached = {i: self._attach(i) for i in numbers}
                self._results(attached, START_SECONDS)
        except BaseException:
            for i in numbers:
                self._remove(i)
            raise
        for i in numbers:
            self.failures.pop(i, None)

    def call(self, method: str, arguments: Mapping[int, tuple[Any, ...]]) -> dict[int, Any]:
        """Let parts do something, all at once, and return their results.

        Each does it after the steps that it was sent before.

        Args:
            method: A method of `Batch`.
            arguments: Number of a part → what it calls the method with.

        Raises:
            VectorWorkerError: If workers die, hang or fail; the others have done it.
        """
        requests = {i: self._request(i, method, own) for i, own in arguments.items()}
        return self._results(requests, self.timeout)

    def send(self, number: int, env_ids: list[int]) -> None:
        """Let a part step some of its environments, and do not wait for it.

        Args:
            number: The part's number.
            env_ids: The environments' numbers in the vector; their actions are in the arrays.
        """
        arguments = batch_arguments(self.parts[number], env_ids)
        self.pending.add(self._request(number, "step", arguments), env_ids)

    def take(self, count: int) -> list[int]:
        """Wait until so many environments have been stepped, and return which.

        Those that were sent first come first. The others stay, until they are taken.

        Raises:
            VectorWorkerError: If workers die, hang or fail before.
        """
        if self._interrupted:  # a reply says that all that was asked for before is done, too
            asked = [self._ask(i, None, "wait", ()) for i, open_ in self._open.items() if open_]
            self._wait(lambda: all(request.done for request in asked), self.timeout)
        self._wait(lambda: bool(self.failures) or self.pending.ready >= count, self.timeout)
        return self.pending.take(count)

    def close(self) -> None:
        """End all processes and let the memory go; closing twice is allowed.

        A fork only lets go of what it shares with the process that started them.
        """
        self.pool.shutdown()
        self.workers, self._open, self.arrays = {}, {}, {}
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1

    # -- inside ------------------------------------------------------------------------------

    def _spawn(self, number: int) -> Request:
        self._remove(number)  # Ctrl-C may have come before that
        made = _Batches(self._by_worker[number])
        self.workers[number] = self.pool.spawn(packed(made), self.timeout)
        self._open[number] = [Request(MAKE, "")]
        return self._ask(number, None, "shapes", ())

    def _make_memory(self, shapes: Shapes) -> None:
        num_envs = self.parts[-1].stop
        size = memory_size(shapes, num_envs)
        self._shapes, self._descriptor = shapes, new_shared_memory(size)
        self.arrays = lay_out(map_memory(os.dup(self._descriptor), size), shapes, num_envs)

    def _attach(self, number: int) -> Request:
        """Let a worker take the memory, whose file descriptor comes after the request."""
        request = self._ask(number, None, "attach", (self._shapes, self.parts[-1].stop))
        self.workers[number].send_descriptor(self._descriptor)
        return request

    def _request(self, part: int, method: str, arguments: tuple[Any, ...]) -> Request:
        worker, place = self._places[part]
        return self._ask(worker, place, method, arguments)

    def _ask(self, worker: int, place: int | None, method: str, arguments: Any) -> Request:
        number = self.workers[worker].request(place, method, arguments)
        request = Request(number, method)
        self._open[worker].append(request)
        return request

    def _results(self, requests: Mapping[int, Request], timeout: float | None) -> dict[int, Any]:
        self._wait(lambda: all(request.done for request in requests.values()), timeout)
        return {i: request.result for i, request in requests.items()}

    def _wait(self, over: Callable[[], bool], timeout: float | None) -> None:
        """Read replies until a condition holds, or no worker is left that could change it.

        Raises:
            VectorWorkerError: If workers died, hung or failed meanwhile.
            RobotLayoutsError: What a worker could not make its task for.
        """
        deadline = None if timeout is None else time.monotonic() + timeout
        failures: list[Failure] = []
        self._interrupted = True
        while not over() and any(self._open.values()):
            left = None if deadline is None else max(0.0, deadline - time.monotonic())
            numbers = {worker: i for i, worker in self.workers.items()}
            replies = self.pool.wait(left)
            failures += [f for w, r in replies if (f := self._handle(numbers[w], r)) is not None]
            if not replies and left == 0.0:
                late = f"did not reply within {timeout:g} s and was ended"
                failures += [self._drop(i, late) for i, open_ in self._open.items() if open_]
        self._interrupted = False
        if failures:
            raise self.error(sorted(failures, key=lambda failure: failure.worker))

    def error(self, failures: Sequence[Failure]) -> VectorWorkerError:
        """Return what to raise for workers that are gone."""
        way = "restart() replaces what is gone; the other environments are untouched"
        return VectorWorkerError(failures, self._seeds, way if self._made else "no vector was made")

    def _handle(self, number: int, reply: Reply) -> Failure | None:
        """Note what a worker replied; returns a failure if it can go on no more.

        Raises:
            RobotLayoutsError: What it could not make its task for.
        """
        if reply.status is Status.DIED:
            return self._drop(number, reply.value)
        if reply.status is Status.FAILED:
            return self._handle_error(number, reply)
        for request in self._open[number]:
            if request.number == reply.request:
                request.result = reply.value
            request.done = request.number <= reply.request
        self._open[number] = [request for request in self._open[number] if not request.done]
        return None

    def _handle_error(self, number: int, reply: Reply) -> Failure:
        error, methods = reply.value, {r.number: r.method for r in self._open[number]}
        ours = not isinstance(error, RemoteError)
        if reply.request == MAKE and ours:
            raise error
        what = f"{type(error).__name__}: {error}" if ours else str(error)
        method = methods.get(reply.request, "an earlier call")
        call = "making its task" if reply.request == MAKE else f"{method}()"
        where = error.__cause__.args if error.__cause__ else ()
        return self._drop(number, f"failed in {call} with {what}", *where)

    def _drop(self, number: int, reason: str, where: str = "") -> Failure:
        reason = f"{self.workers[number].name} {reason}"
        failure = Failure(number, self.env_ids(number), reason, where)
        self.failures[number] = failure
        self.pending.forget(self.env_ids(number))
        self._remove(number)
        return failure

    def _remove(self, number: int) -> None:
        if number in self.workers:
            self._open[number] = []
            self.pool.remove(self.workers[number])
            del self.workers[number]


# -- in a worker ---------------------------------------------------------------------------------


class _Batches:
    """Makes the parts that a worker holds, and calls them."""

    def __init__(self, parts: Sequence[BatchPart]) -> None:
        self._parts = tuple(parts)

    def __call__(self) -> Callable[..., Any]:
        import torch

        torch.set_num_threads(1)
        self._batches = [Batch(part) for part in self._parts]
        self._error: BaseException | None = None
        return self._call

    def _call(self, place: int | None, method: str, arguments: tuple[Any, ...]) -> Any:
        """Call a method of a batch, or one of this object where there is no place.

        After an error, all further calls end with that error: its reply may have been missed.
        """
        if self._error is not None:
            raise self._error
        try:
            owner = self if place is None else self._batches[place]
            return getattr(owner, method)(*arguments)
        except BaseException as error:
            self._error = error
            raise

    def shapes(self) -> Shapes:
        """Return which arrays the batches need."""
        return self._batches[0].shapes()

    def wait(self) -> None:
        """Do nothing: the reply says that what was asked for before is done."""

    def attach(self, shapes: Shapes, num_envs: int) -> None:
        """Take the memory that all share."""
        memory = map_memory(receive_descriptor(), memory_size(shapes, num_envs))
        arrays = lay_out(memory, shapes, num_envs)
        for batch in self._batches:
            batch.attach(arrays)

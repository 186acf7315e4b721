"""A worker process, what it is asked for and what it replies, and the pool that it is in."""

from __future__ import annotations

import pickle
import select
import signal
import socket
import struct
import time
from collections.abc import Callable, Iterable
from contextlib import closing, suppress
from dataclasses import dataclass
from enum import Enum, auto
from multiprocessing.connection import wait
from typing import Any

from robot_layouts.core.processes.start import (
    WorkerError,
    enough,
    exit_code,
    expect_workers,
    start,
)
from robot_layouts.core.processes.transport import SentError, described, loaded

SHUTDOWN_SECONDS = 2.0  # that a worker may take to end by itself
MAKE = 0  # the request that a worker begins with

_HEAD = struct.Struct("!QII")  # the message's number, the packet's, and how many there are
_PIECE = 2**15  # bytes of a message in one packet; well below Linux's default buffer of a socket
_LOST_SERVER = 255  # multiprocessing's exit code of a process whose server has ended
_IMPORT_FAILED = 1  # exit code of a worker that could not import the main module


class Status(Enum):
    """What a reply says of a request.

    Attributes:
        DONE: It was carried out; the value is its result.
        FAILED: It raised an error, which is the value.
        NOTE: It goes on, and the value says how far it is.
        DIED: The worker has ended; the value says how, in words.
        LOST: Its machine is out of reach, as the value says, which is no fault of the request.
    """

    DONE = auto()
    FAILED = auto()
    NOTE = auto()
    DIED = auto()
    LOST = auto()


@dataclass(frozen=True)
class Reply:
    """What a worker says.

    Attributes:
        request: Number of the request that it is about, the last one if it died.
        status: What became of that.
        value: See `Status`.
    """

    request: int
    status: Status
    value: Any


class Channel:
    """One end of a connection over which numbered messages go, which no interrupt can cut in two.

    Ctrl-C may end a call at any moment: half of a message would then be read as the next one. Here
    a message is one or more packets, each of which the kernel takes and gives as a whole.
    """

    def __init__(self, end: socket.socket) -> None:
        """Take an end of a pair of sockets that keep packets apart."""
        self.socket = end
        self._number, self._pieces = -1, list[bytes]()

    def send(self, number: int, message: bytes) -> None:
        """Send a message.

        Raises:
            OSError: If the other end is gone, or does not read for too long.
        """
        count = max(1, -(-len(message) // _PIECE))
        for i in range(count):
            piece = message[i * _PIECE : (i + 1) * _PIECE]
            self.socket.send(_HEAD.pack(number, i, count) + piece)

    def read(self, flags: int = 0) -> tuple[int, bytes] | None:
        """Read one packet; returns the number and the message that it completes, else None.

        Raises:
            EOFError: If the other end is gone.
            BlockingIOError: If nothing has arrived, with ``socket.MSG_DONTWAIT``.
        """
        packet = self.socket.recv(_HEAD.size + _PIECE, flags)
        if not packet:
            raise EOFError("the other end is closed")
        number, i, count = _HEAD.unpack_from(packet)
        if i == 0:
            self._number, self._pieces = number, []
        if number != self._number or i != len(self._pieces):  # the rest of one that was cut off
            return None
        self._pieces.append(packet[_HEAD.size :])
        return (number, b"".join(self._pieces)) if i == count - 1 else None

    def receive(self) -> tuple[int, bytes]:
        """Wait for the next message; returns its number and itself.

        Raises:
            EOFError: If the other end is gone.
        """
        while (message := self.read()) is None:
            pass
        return message


class Worker:
    """A process of this machine that carries out one request after the other.

    It ends with this process, whatever ends that.

    Attributes:
        pid: Its number.
        name: What it is called in messages.
        begun: When it was started, by the monotonic clock (s).
        sentinel: What becomes readable when it ends, a file descriptor.
        socket: This process's end of the connection.
        ready: Whether it has made what carries out requests.
        last: Number of its last request.
    """

    def __init__(
        self, make: bytes, timeout: float | None = None, *, with_main: bool = True
    ) -> None:
        """Start it.

        Args:
            make: A `packed` function without arguments, which returns what carries out requests.
            timeout: Seconds that sending may take; None waits for ever.
            with_main: Whether it imports the main module; see `start`.

        Raises:
            ProcessError: If it cannot be started.
        """
        with enough():
            self.socket, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with closing(theirs):
            try:
                self._process = start(_serve, theirs, with_main=with_main)
            except BaseException:
                self.socket.close()
                raise
        if timeout is not None:  # of a worker that is stopped
            whole = int(timeout)
            limit = struct.pack("ll", whole, int((timeout - whole) * 1e6))
            self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, limit)
        self.pid, self.sentinel = self._process.pid or 0, self._process.sentinel
        self.name = f"process {self.pid}"
        self.begun: float | None = time.monotonic()
        self.ready, self.last = False, MAKE
        self._channel = Channel(self.socket)
        self._send(make)

    def request(self, *arguments: Any) -> int:
        """Let it do something, after what it was asked for before.

        Args:
            arguments: What the function that carries out requests is called with.

        Returns:
            The request's number; `MAKE` and those before are smaller.
        """
        self.last += 1
        self._send(pickle.dumps(arguments))
        return self.last

    def send_descriptor(self, descriptor: int) -> None:
        """Send a file descriptor, which the last request takes by `receive_descriptor`."""
        with suppress(OSError):  # it died
            socket.send_fds(self.socket, [b"descriptor"], [descriptor])

    def receive(self) -> Reply | None:
        """Read what has arrived; returns a reply if it is whole."""
        try:
            while (message := self._channel.read(socket.MSG_DONTWAIT)) is None:
                pass
        except BlockingIOError:
            return None if exit_code(self._process) is None else self._died()
        except (EOFError, OSError):
            return self._died()
        try:
            status, value = pickle.loads(message[1])
        except Exception as error:  # of a class that cannot be loaded here
            text = f"what a worker replied cannot be read: {described(error)}"
            status, value = Status.FAILED, WorkerError(text)
        self.ready = self.ready or status is Status.DONE
        return Reply(message[0], status, value)

    def kill(self) -> None:
        """End it at once, even if it is stopped; doing so twice is allowed."""
        self.shutdown(0.0)

    def shutdown(self, patience: float = SHUTDOWN_SECONDS) -> None:
        """End it, after a while in which it may do so by itself (s)."""
        self.socket.close()
        with suppress(ValueError):  # it was ended before
            self._ends_within(patience)
            if exit_code(self._process) is None:
                self._process.kill()
                self._ends_within(None)
                exit_code(self._process)
            self._process.close()

    # -- inside ------------------------------------------------------------------------------

    def _send(self, message: bytes) -> None:
        with suppress(OSError):  # it died: that is read from the connection
            self._channel.send(self.last, message)

    def _ends_within(self, seconds: float | None) -> None:
        if exit_code(self._process) is None:
            wait([self.sentinel], seconds)

    def _died(self) -> Reply:
        self._ends_within(SHUTDOWN_SECONDS)
        return Reply(self.last, Status.DIED, self._ending(exit_code(self._process)))

    def _ending(self, code: int | None) -> str:
        if code is None:
            return "closed its connection"
        if code == _LOST_SERVER:
            return "died with the process that forks workers"
        if code == _IMPORT_FAILED and not self.ready:
            return (
                "could not import the main module, for the reason that it printed; what a script"
                " runs belongs under `if __name__ == '__main__':`"
            )
        return f"died by {signal.Signals(-code).name}" if code < 0 else f"ended with code {code}"


class Pool:
    """Workers, and which of them has something to say."""

    def __init__(self) -> None:
        """Begin without any.

        Raises:
            ProcessError: If none can start on this operating system.
        """
        expect_workers()
        self.workers: list[Worker] = []
        self._poller = select.poll()
        self._owners: dict[int, Worker] = {}  # file descriptor → whose it is

    def spawn(self, make: bytes, timeout: float | None = None, *, with_main: bool = True) -> Worker:
        """Start a worker; see `Worker`."""
        worker = Worker(make, timeout, with_main=with_main)
        self.workers.append(worker)
        # The end of the process is watched as well: a process that it forked may hold its end of
        # the connection open.
        for descriptor in (worker.socket.fileno(), worker.sentinel):
            self._owners[descriptor] = worker
            self._poller.register(descriptor, select.POLLIN)
        return worker

    def wait(self, seconds: float | None) -> list[tuple[Worker, Reply]]:
        """Wait until something arrives, for a while (s) or for ever; returns replies, if any."""
        ready = self._poller.poll(None if seconds is None else seconds * 1000)
        workers = {self._owners[descriptor] for descriptor, _ in ready}
        replies = [(worker, worker.receive()) for worker in workers]
        return [(worker, reply) for worker, reply in replies if reply is not None]

    def results(self, workers: Iterable[Worker]) -> list[Any]:
        """Wait for the results of the last requests of workers that report nothing.

        Raises:
            WorkerError: If a worker died.
            RobotLayoutsError: What a request raised, a `RemoteError` if that was another's.
        """
        results: dict[Worker, Any] = {}
        asked = list(workers)
        while any(worker not in results for worker in asked):
            for worker, reply in self.wait(None):
                if reply.status is Status.FAILED:
                    raise reply.value
                if reply.status is Status.DIED:
                    raise WorkerError(f"{worker.name} {reply.value}")
                if reply.request == worker.last:
                    results[worker] = reply.value
        return [results[worker] for worker in asked]

    def remove(self, worker: Worker, patience: float = 0.0) -> None:
        """End a worker, after a while in which it may do so by itself (s)."""
        for descriptor in [d for d, owner in self._owners.items() if owner is worker]:
            self._poller.unregister(descriptor)
            del self._owners[descriptor]
        if worker in self.workers:
            self.workers.remove(worker)
        worker.shutdown(patience)

    def shutdown(self) -> None:
        """End all of them; those that carry out nothing end by themselves."""
        deadline = time.monotonic() + SHUTDOWN_SECONDS
        for worker in self.workers:
            worker.socket.close()
        for worker in list(self.workers):
            self.remove(worker, max(0.0, deadline - time.monotonic()))


def report(note: Any) -> None:
    """Say how far a request is, from within it; nothing happens outside a worker's request."""
    if _connection is not None:
        channel, number = _connection
        channel.send(number, pickle.dumps((Status.NOTE, note)))


def receive_descriptor() -> int:
    """Return the file descriptor that was sent after a request, from within it."""
    assert _connection is not None
    return socket.recv_fds(_connection[0].socket, 16, 1)[1][0]


# -- in the process ------------------------------------------------------------------------------


_connection: tuple[Channel, int] | None = None


def _serve(end: socket.socket) -> None:
    """Make what carries out requests, then carry out each until the main process is gone."""
    global _connection
    channel = Channel(end)
    with suppress(EOFError, OSError):
        number, job = channel.receive()
        made: list[Callable[..., Any]] = []
        channel.send(number, _reply(lambda: made.append(loaded(job)())))
        while made:
            number, call = channel.receive()
            _connection = channel, number
            channel.send(number, _reply(made[0], *pickle.loads(call)))
            _connection = None


def _reply(function: Callable[..., Any], *arguments: Any) -> bytes:
    try:
        return pickle.dumps((Status.DONE, function(*arguments)))
    except BaseException as error:  # an exit() as well: the worker goes on
        return pickle.dumps((Status.FAILED, SentError(error)))

"""Asks a policy server for actions: its messages, the connection, and chunks of actions.

Messages are msgpack. In openpi's, an array is a map whose keys are bytes (source: the package
openpi-client 0.1.2, ``msgpack_numpy`` and ``websocket_client_policy``); in vla-eval's, the keys are
texts (the package vla-eval 0.8.0, ``protocol`` and ``connection``).
"""

from __future__ import annotations

import math
import socket
import struct
from contextlib import suppress
from time import perf_counter, sleep, time
from typing import Any, cast

import msgspec
import numpy as np
from numpy.typing import NDArray

from robot_layouts.core.importing import optional
from robot_layouts.core.pages import plural
from robot_layouts.core.quoting import cut, shown
from robot_layouts.data.playing.served.keys import Keys
from robots import RobotLayoutsError

ATTEMPTS = 3  # connections, until a server that closes each counts as gone
PAUSE = 1.0  # s before the next of them
MOST_BYTES = 2**26  # of a message: a chunk of actions takes some kilobytes
OPENING_SECONDS = 10.0
_SHOWN = 300  # characters of a text that a server sent
_ARRAY, _NUMBER = b"__ndarray__", b"__npgeneric__"
_HELLO, _START, _OBSERVATION, _ACTION, _ERROR = (
    *("hello", "episode_start", "observation", "action", "error"),
)  # messages of vla-eval's
_VLA_EVAL_PROTOCOL = 1
_KINDS = "biuf"  # of NumPy's types: flags and numbers


class PolicyServerError(RobotLayoutsError, RuntimeError):
    """A policy server that cannot be reached, is silent, or answers what is not an answer."""


class Connection:
    """Asks one policy server, one question after the other; connects when it is first asked.

    The server sends its metadata first, a mapping, and then an answer to each observation, as
    openpi's ``WebsocketPolicyServer`` does. Where it closes the connection without an answer, the
    observation is sent once more, over the next one, `ATTEMPTS` times in all.

    Attributes:
        name: The server's address, for messages.
    """

    def __init__(self, address: str, name: str, seconds: float) -> None:
        """Keep where the server is.

        Args:
            address: ``ws://HOST:PORT``.
            name: The same without secrets.
            seconds: Within which each message has to arrive (s).

        Raises:
            MissingPackageError: If websockets is not installed.
        """
        self.name, self._address, self._seconds = name, address, seconds
        what = "a policy behind a socket needs websockets"
        self._client = optional("websockets.sync.client", what, "served")
        self._errors = optional("websockets.exceptions", what, "served")
        self._socket: Any = None

    def episode(self) -> Connection:
        """Return what asks during another episode, which may go on beside this one."""
        return self

    def ask(self, observation: dict[str, Any]) -> tuple[dict[Any, Any], float]:
        """Return the answer to an observation, and how long that took (s).

        Raises:
            PolicyServerError: If there is none, or it is no mapping.
        """
        began, reason = perf_counter(), ""
        for attempt in range(ATTEMPTS):
            if attempt:
                sleep(PAUSE)
            try:
                if self._socket is None:
                    self._open()
                    self._greet()
                self._expect_silence()
                return self._answer(observation), perf_counter() - began
            except self._errors.ConnectionClosed as error:
                self.close()
                reason = self._reason(error)
            except ConnectionRefusedError:
                reason = "nothing listens there"
            except PolicyServerError:
                self.close()
                raise
        raise PolicyServerError(
            f"the policy server {self.name} gave no answer in {plural(ATTEMPTS, 'attempt')}:"
            f" {reason}"
        )

    def close(self) -> None:
        """Close the connection, if one is open; the next question opens another."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _open(self) -> None:
        try:
            self._socket = self._client.connect(
                self._address,
                compression=None,
                max_size=MOST_BYTES,
                open_timeout=OPENING_SECONDS,
                close_timeout=1.0,
                ping_interval=None,  # a server that computes actions need not answer pings
            )
        except ConnectionRefusedError:
            raise
        except TimeoutError:
            raise self._error(f"did not answer within {OPENING_SECONDS:g} s") from None
        except (OSError, self._errors.InvalidHandshake, self._errors.InvalidURI, EOFError) as error:
            raise self._error(f"is no websocket that can be opened: {_words(error)}") from error
        # Else what is sent to a server that reads nothing would wait for ever.
        limit = struct.pack("ll", int(self._seconds), int(self._seconds % 1 * 1e6))
        self._socket.socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, limit)

    def _greet(self) -> None:
        """Do what comes before the first question over a connection."""
        self._mapping("its metadata")

    def _expect_silence(self) -> None:
        """Refuse a message that was not asked for, and would be taken for an answer."""
        with suppress(TimeoutError):
            self._socket.recv(timeout=0)
            raise self._error("sent a message that was not asked for")

    def _answer(self, observation: dict[str, Any]) -> dict[Any, Any]:
        self._socket.send(pack(observation))
        return self._mapping("an answer")

    def _mapping(self, what: str) -> dict[Any, Any]:
        try:
            data: Any = self._socket.recv(timeout=self._seconds)
        except TimeoutError:
            raise self._error(f"sent nothing within {self._seconds:g} s, not {what}") from None
        try:
            return mapping_of(data, what)
        except ValueError as error:
            raise self._error(str(error)) from None

    def _reason(self, error: Any) -> str:
        if error.sent is not None and error.sent.code == 1009:
            raise self._error(f"sent a message of more than {MOST_BYTES / 1e6:.0f} MB") from error
        if isinstance(error.__cause__, BlockingIOError):
            raise self._error(f"read nothing of what was sent for {self._seconds:g} s") from error
        return f"it closed the connection ({_words(error)})"

    def _error(self, what: str) -> PolicyServerError:
        return PolicyServerError(f"the policy server {self.name} {what}")


class VlaEvalConnection(Connection):
    """Asks one of vla-eval's model servers, which is told when an episode begins.

    A connection is a session there, with a chunk of actions of its own, so that each episode takes
    another one. Where it is lost, the episode begins anew over the next one.
    """

    _asked = 0

    def __init__(self, address: str, name: str, seconds: float, task: str) -> None:
        """Keep where the server is; see `Connection`.

        Args:
            address: Likewise.
            name: Likewise.
            seconds: Likewise.
            task: Id of the task, which the server is told.
        """
        super().__init__(address, name, seconds)
        self._task = task
        self._copied = address, name, seconds, task

    def __del__(self) -> None:
        """Close the connection."""
        with suppress(Exception):  # at the end of the process
            self.close()

    def episode(self) -> VlaEvalConnection:
        """Return what asks during another episode."""
        return VlaEvalConnection(*self._copied)

    def _greet(self) -> None:
        self._tell(_HELLO, {"harness_version": "", "protocol_version": _VLA_EVAL_PROTOCOL})
        self._told(_HELLO)
        self._tell(_START, {"task": {"name": self._task, "suite": "robot-layouts"}})

    def _answer(self, observation: dict[str, Any]) -> dict[Any, Any]:
        self._tell(_OBSERVATION, observation)
        answer = self._told(_ACTION)
        named = {key: part for key, part in answer.items() if isinstance(part, np.ndarray)}
        return {**answer, **{key: np.atleast_2d(part) for key, part in named.items()}}

    def _tell(self, kind: str, payload: dict[str, Any]) -> None:
        self._asked += 1
        message = {"type": kind, "payload": payload, "seq": self._asked, "timestamp": time()}
        self._socket.send(msgspec.msgpack.encode(message, enc_hook=_encoded_with_texts))

    def _told(self, kind: str) -> dict[Any, Any]:
        """Return what the server says in a message of a kind."""
        message = self._mapping(f"a message of the kind {kind!r}")
        payload, found = message.get("payload"), message.get("type")
        if found == _ERROR:
            said = payload.get("error") if isinstance(payload, dict) else payload
            raise self._error(f"says: {cut(str(said), _SHOWN)}")
        if found != kind:
            raise self._error(f"sent a message of the kind {shown(found)}; {kind!r} is due")
        if not isinstance(payload, dict):
            raise self._error(f"sent {type(payload).__name__} in a message of the kind {kind!r}")
        if message.get("seq") != self._asked:
            raise self._error(
                f"answered message {shown(message.get('seq'))}, not {self._asked}, the last one"
            )
        return cast("dict[Any, Any]", payload)


class PolicyClient:
    """Asks a policy server for a chunk of actions, carries it out, and asks for the next.

    A copy begins a new episode.

    Attributes:
        waits: How long each answer took (s).
    """

    def __init__(self, keys: Keys, connection: Connection, seed: int = 0) -> None:
        """Begin an episode.

        Args:
            keys: What is sent and received.
            connection: To the server.
            seed: Of the episode, which chooses among several instructions.
        """
        self._keys, self._connection, self._seed = keys, connection, seed
        self._ahead: list[NDArray[np.float32]] = []
        self.waits: list[float] = []

    def __deepcopy__(self, memo: Any) -> PolicyClient:
        """Return what plays another episode of the same seed."""
        return self.episode(self._seed)

    def episode(self, seed: int) -> PolicyClient:
        """Return what plays the episode of a seed."""
        return PolicyClient(self._keys, self._connection.episode(), seed)

    def __call__(self, observation: Any) -> NDArray[np.float32]:
        """Return the action for an observation of one environment, (A,).

        Raises:
            PolicyServerError: If the server gives none.
        """
        if not self._ahead:
            answer, seconds = self._connection.ask(self._keys.sent(observation, self._seed))
            try:
                chunk = self._keys.chunk(answer)
            except ValueError as error:
                name = self._connection.name
                raise PolicyServerError(f"the policy server {name} {error}") from None
            self._ahead = [*self._keys.carried_out(chunk)]
            self.waits.append(seconds)
        return self._ahead.pop(0)

    def close(self) -> None:
        """Close the connection."""
        self._connection.close()


def pack(message: Any) -> bytes:
    """Return a message of texts, numbers, lists, mappings and arrays as bytes."""
    return msgspec.msgpack.encode(message, enc_hook=_encoded)


def unpack(data: bytes) -> Any:
    """Return the message that bytes hold; its arrays cannot be written to.

    Raises:
        ValueError: If they hold none.
    """
    try:
        return _decoded(msgspec.msgpack.decode(data))
    except msgspec.DecodeError as error:
        raise ValueError(f"it is not msgpack: {error}") from None
    except RecursionError:
        raise ValueError("it is nested too deeply") from None


def mapping_of(data: bytes | str, what: str) -> dict[Any, Any]:
    """Return the mapping that a server sent.

    Args:
        data: What it sent.
        what: What that should be, for the message.

    Raises:
        ValueError: If it is no mapping; the message goes on from the server's name.
    """
    if isinstance(data, str):
        raise ValueError(f"sent a text, not {what}: {cut(_last_line(data), _SHOWN)}")
    try:
        message = unpack(data)
    except ValueError as error:
        raise ValueError(f"sent what is not {what}: {error}") from None
    if not isinstance(message, dict):
        raise ValueError(f"sent {shown(message)}, not {what}, which is a mapping")
    return cast("dict[Any, Any]", message)


def _encoded(value: Any) -> Any:
    if not isinstance(value, np.ndarray):
        raise TypeError(f"{type(value).__name__} cannot be sent")
    return {
        _ARRAY: True,
        b"data": value.tobytes(),
        b"dtype": value.dtype.str,
        b"shape": value.shape,
    }


def _encoded_with_texts(value: Any) -> Any:
    return {key.decode(): part for key, part in _encoded(value).items()}


def _decoded(value: Any) -> Any:
    if isinstance(value, list):
        return [_decoded(part) for part in cast("list[Any]", value)]
    if not isinstance(value, dict):
        return value
    named = cast("dict[Any, Any]", value)
    if _ARRAY in named:
        return _array(named.get(b"data"), named.get(b"dtype"), named.get(b"shape"))
    if _ARRAY.decode() in named:
        return _array(named.get("data"), named.get("dtype"), named.get("shape"))
    if _NUMBER in named:
        return named.get(b"data")
    return {key: _decoded(part) for key, part in named.items()}


def _array(data: Any, dtype: Any, shape: Any) -> Any:
    try:
        kind = np.dtype(dtype)
    except (TypeError, ValueError):
        raise ValueError(
            f"it holds an array of the type {shown(dtype)}, which NumPy lacks"
        ) from None
    if kind.kind not in _KINDS:
        raise ValueError(f"it holds an array of the type {kind}; numbers are needed")
    sizes = cast("list[int]", shape)
    if not isinstance(shape, list) or not all(type(n) is int and n >= 0 for n in sizes):
        raise ValueError(f"it holds an array of the shape {shown(shape)}")
    length, count = len(data) if isinstance(data, bytes) else 0, math.prod(sizes)
    if length != count * kind.itemsize:
        raise ValueError(
            f"it holds an array of the shape {tuple(sizes)} and the type {kind}, which takes"
            f" {count * kind.itemsize} bytes, in {length} bytes"
        )
    return np.frombuffer(data, kind).reshape(sizes)


def _last_line(text: str) -> str:
    """Return the last line, which is the error's own in a traceback."""
    return (text.strip().splitlines() or ["an empty one"])[-1]


def _words(error: Exception) -> str:
    return cut(f"{type(error).__name__}: {error}".rstrip(": "), _SHOWN)

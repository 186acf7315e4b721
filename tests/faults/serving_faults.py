"""Served environments: what clients send, where they listen, and servers that are none."""

from __future__ import annotations

import functools
import math
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import closing, suppress
from pathlib import Path
from queue import Queue
from typing import Any

import numpy as np
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect
from websockets.sync.server import ServerConnection

from layouts.commands import Server
from robot_layouts.data.serving.client import RemoteEnv
from robot_layouts.data.serving.server import Admission
from robot_layouts.data.serving.server import serve as serve_task
from robots import RobotLayoutsError
from tests.data.policy_server import pack, unpack
from tests.faults.fault import GOES_ON, Fault, each, run_command
from tests.faults.policy_servers_faults import BYTES, TEXTS, array, server

AREA = "serving"
TASK, ACTIONS = "PushT-v1", 7
STILL = np.zeros(ACTIONS, np.float32)


def _with(value: float) -> Any:
    action = np.zeros(ACTIONS)
    action[3] = value
    return action


ACTIONS_SENT: dict[str, Any] = {
    "nothing": None,
    "a text": "left",
    "a list of texts": ["left"] * ACTIONS,
    "a mapping of an unknown place": {"amr": STILL},
    "a mapping of too few numbers": {"arm": STILL[:-1]},
    "too few numbers": STILL[:-1],
    "actions of two worlds": np.zeros((2, ACTIONS)),
    "NaN": _with(math.nan),
    "what single precision cannot hold": _with(1e300),
    "an array of objects": array((ACTIONS,), "|O", b"\0" * 8 * ACTIONS),
    "an array without data": array((ACTIONS,), "<f4", b""),
    "an array of a negative size": array((-1,), "<f4", b"\0" * 28),
    "an array of 2⁶⁰ rows": array((2**60, ACTIONS), "<f4", b"\0" * 28),
    "a megabyte and more": np.zeros(2**18 + 1, np.float32),
}
SEEDS: dict[str, Any] = {
    "negative": -1,
    "of 33 bits": 2**32,
    "a fraction": 1.5,
    "NaN": math.nan,
}
CALLS: dict[str, Any] = {
    "an unknown call": {"call": "rest"},
    "a call that is a number": {"call": 5},
    "a call of the class's own": {"call": "__init__"},
    "a part too many": {"call": "step", "action": STILL, "actoin": 1},
    "a seed with a step": {"call": "step", "action": STILL, "seed": 1},
    "a list": ["reset"],
    "nothing": None,
    "an array": STILL,
}


def faults() -> Iterator[Fault]:
    """Go through this area's faults."""
    messages = {
        **{f"an action that is {w}": _step(a) for w, a in ACTIONS_SENT.items()},
        **{f"a seed that is {w}": {"call": "reset", "seed": s} for w, s in SEEDS.items()},
        **CALLS,
    }
    sent: dict[str, bytes | str] = {w: pack(m) for w, m in messages.items()}
    yield from each(AREA, "a client sends {}", _answered, {**sent, **BYTES, **TEXTS})
    yield from each(AREA, "a client comes {}", _not_let_in, ADDRESSES)
    yield from each(AREA, "a client {}", _others_go_on, VISITS, GOES_ON)
    yield Fault(AREA, "a web page connects", _web_page)
    yield Fault(AREA, "a client more than the server takes", _one_too_many)
    yield from each(AREA, "{}", _command, COMMANDS)
    yield Fault(AREA, "its port is taken", _taken)
    first = {what: pack(message) for what, message in METADATA.items()} | BYTES | TEXTS
    yield from each(AREA, "a server greets with {}", _greeted, first)
    for what, message in {**BYTES, **TEXTS, **{w: pack(m) for w, m in ANSWERS.items()}}.items():
        run = functools.partial(_greeted, first=pack(GREETING), answer=message)
        yield Fault(AREA, f"a server answers {what}", run)
    yield Fault(AREA, "a server greets nobody", functools.partial(_greeted, first=None))
    yield Fault(AREA, "a server stays silent", functools.partial(_greeted, first=pack(GREETING)))
    yield Fault(AREA, "nothing listens there", _nobody)


def _step(action: Any) -> dict[str, Any]:
    return {"call": "step", "action": action}


# -- clients --------------------------------------------------------------------------------------


@functools.cache
def _served(clients: int = 8) -> str:
    """Serve the task in a thread of this process, for as long as that lasts."""
    ready: Queue[str] = Queue()
    settings = {
        "server": Server(port=0),
        "on_ready": ready.put,
        "admission": Admission(clients=clients),
    }
    threading.Thread(target=serve_task, args=(TASK,), kwargs=settings, daemon=True).start()
    return ready.get(timeout=60)


def _ask(client: Any, message: bytes | str) -> Any:
    client.send(message)
    return unpack(client.recv(timeout=60))


def _reset(client: Any, seed: int = 3) -> bytes:
    return _ask(client, pack({"call": "reset", "seed": seed}))["observation"].tobytes()


def _stepped(client: Any) -> bytes:
    return _ask(client, pack(_step(STILL + 0.25)))["observation"].tobytes()


@functools.cache
def _expected() -> tuple[bytes, bytes]:
    """Return what is observed after the reset and the first step."""
    with connect(_served(), max_size=None) as client:
        client.recv(timeout=60)
        return _reset(client), _stepped(client)


def _answered(folder: Path, data: bytes | str) -> None:
    """An invalid message is answered, and the world stays as it was."""
    expected = _expected()
    with connect(_served(), max_size=None) as client:
        client.recv(timeout=60)
        assert _reset(client) == expected[0]
        answer = _ask(client, data)
        assert _stepped(client) == expected[1], "the world is another"
    assert set(answer) == {"error"}, f"it was taken: {answer}"
    raise RobotLayoutsError(answer["error"])


ADDRESSES: dict[str, Callable[[str], str]] = {
    "without a token": lambda address: address.partition("?")[0],
    "with another token": lambda address: f"{address}x",
    "with a token that is no ASCII": lambda address: f"{address.partition('=')[0]}=%C3%A4%FF",
    "with a wrong token and the right one": lambda address: address.replace("?", "?token=x&"),
}


def _not_let_in(folder: Path, change: Callable[[str], str]) -> None:
    RemoteEnv(change(_served())).close()


def _web_page(folder: Path) -> None:
    try:
        connect(_served(), origin="http://127.0.0.1").close()
    except InvalidStatus as error:
        raise RobotLayoutsError(f"status {error.response.status_code}") from error


def _one_too_many(folder: Path) -> None:
    address = _served(clients=1)
    with closing(RemoteEnv(address)):
        RemoteEnv(address).close()


def _port() -> tuple[str, int]:
    host, _, port = _served().removeprefix("ws://").partition("/")[0].rpartition(":")
    return host, int(port)


def _raw(*parts: bytes) -> None:
    """Say something that is no websocket, and go away without a goodbye."""
    with socket.create_connection(_port()) as client:
        client.settimeout(1.0)
        for part in parts:
            client.sendall(part)
        with suppress(OSError):
            client.recv(100)


def _vanishes(*messages: bytes) -> None:
    """Send messages, and go away without waiting for the answers or a goodbye."""
    client = connect(_served(), max_size=None)
    for message in messages:
        client.send(message)
    client.socket.shutdown(socket.SHUT_RDWR)
    client.close()


VISITS: dict[str, Callable[[], None]] = {
    "says what is no HTTP": lambda: _raw(b"\x16\x03\x01\x02\x00\x01\x00"),
    "says half a request": lambda: _raw(b"GET / HTTP/1.1\r\nHost: x\r\nUpg"),
    "says a megabyte of headers": lambda: _raw(b"GET / HTTP/1.1\r\n", b"X: y\r\n" * 150_000),
    "asks for a page": lambda: _raw(b"GET / HTTP/1.1\r\nHost: x\r\n\r\n"),
    "goes away during a reset": lambda: _vanishes(pack({"call": "reset", "seed": 5})),
    "goes away during steps": lambda: _vanishes(
        pack({"call": "reset", "seed": 5}), *[pack(_step(STILL))] * 5
    ),
    "sends 20 MB and is cut off": lambda: _too_long(),
}


def _too_long() -> None:
    with connect(_served(), max_size=None) as client, suppress(ConnectionClosed):
        client.recv(timeout=60)
        client.send(bytes(20 * 10**6))
        client.recv(timeout=60)


def _others_go_on(folder: Path, do: Callable[[], None]) -> None:
    expected = _expected()
    with connect(_served(), max_size=None) as client:
        client.recv(timeout=60)
        assert _reset(client) == expected[0]
        do()
        assert _stepped(client) == expected[1], "the world of another client is another"


# -- the command ----------------------------------------------------------------------------------


COMMANDS: dict[str, tuple[str, ...]] = {
    "an unknown task": ("PushTee-v1",),
    "port 99999": (TASK, "--port", "99999"),
    "a host that is not here": (TASK, "--host", "192.0.2.1"),
    "no clients": (TASK, "--clients", "0"),
    "an unknown control mode": (TASK, "--control-mode", "pd_ee_dance"),
}


def _command(folder: Path, words: tuple[str, ...]) -> None:
    run_command("robot_layouts", "serve", *words, cwd=folder)


def _taken(folder: Path) -> None:
    host, port = _port()
    _command(folder, (TASK, "--host", host, "--port", str(port)))


# -- servers that are none ------------------------------------------------------------------------


BOUND = np.zeros(2, np.float32)
SPACE = {"low": BOUND - 1, "high": BOUND + 1, "shape": [2]}
GREETING = {"task": "x", "action_space": SPACE, "observation_space": SPACE}
NO_ANSWERS: dict[str, Any] = {
    "a list": [1, 2],
    "a number": 5,
    "nothing": None,
    "an array": BOUND,
    "an empty mapping": {},
}
METADATA: dict[str, Any] = {
    **NO_ANSWERS,
    "no spaces": {"task": "x"},
    "a space without bounds": {**GREETING, "action_space": {"shape": [2]}},
    "bounds of another shape": {**GREETING, "action_space": {**SPACE, "shape": [3]}},
    "a shape that is a text": {**GREETING, "action_space": {**SPACE, "shape": "two"}},
    "bounds the wrong way round": {**GREETING, "action_space": {**SPACE, "low": BOUND + 2}},
    "parts that are a list": {**GREETING, "observation_space": {"parts": [SPACE]}},
    "an error": {"error": "out of memory"},
}
ANSWERS: dict[str, Any] = {
    **NO_ANSWERS,
    "an observation without info": {"observation": BOUND},
    "an error": {"error": "out of memory"},
}


def _greeted(folder: Path, first: bytes | str | None, answer: bytes | str | None = None) -> None:
    """Connect to a server that greets, and answers everything the same, or nothing."""

    def behave(client: ServerConnection) -> None:
        if first is not None:
            client.send(first)
        for _ in client:
            if answer is not None:
                client.send(answer)

    with server(behave) as address, closing(RemoteEnv(address, seconds=1.0)) as env:
        env.reset(seed=0)


def _nobody(folder: Path) -> None:
    RemoteEnv("ws://127.0.0.1:9/?token=secret").close()

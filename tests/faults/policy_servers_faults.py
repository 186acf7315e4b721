"""Policy servers: what they do wrong, on every level from the socket to the numbers of actions."""

from __future__ import annotations

import math
import re
import socket
import struct
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from threading import Event, Thread
from typing import Any

import numpy as np
import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.server import ServerConnection, serve
from websockets.utils import accept_key

from robot_layouts.data import evaluate, record
from robot_layouts.data.playing.served import client as asking
from robots import RobotLayoutsError
from tests.data.policy_server import from_texts, pack, unpack, with_texts
from tests.faults.fault import GOES_ON, Fault, run_command

AREA = "policy servers"
TASK, ACTIONS = "PushT-v1", 7
SHORT: dict[str, Any] = {"workers": 0, "max_episode_steps": 4}
KEYS = "observation: {state: {entry: state}}\ntimeout: 0.5\n"

Behaviour = Callable[[ServerConnection], None]

GOOD = {"actions": np.zeros((2, ACTIONS), np.float32)}


def array(shape: Any, dtype: Any, data: bytes) -> dict[bytes, Any]:
    return {b"__ndarray__": True, b"data": data, b"dtype": dtype, b"shape": shape}


def _with(value: Any, dtype: Any = np.float32) -> dict[str, Any]:
    actions = np.zeros((2, ACTIONS), dtype)
    actions[1, 3] = value
    return {"actions": actions}


ANSWERS: dict[str, Any] = {
    "without actions": {"action": GOOD["actions"]},
    "that is a list": [GOOD["actions"]],
    "that is nothing": None,
    "whose actions are a text": {"actions": "left"},
    "whose actions are a list": {"actions": [[0.0] * ACTIONS]},
    "of one action without a horizon": {"actions": np.zeros(ACTIONS, np.float32)},
    "of no action": {"actions": np.zeros((0, ACTIONS), np.float32)},
    "of too few numbers": {"actions": np.zeros((2, ACTIONS - 1), np.float32)},
    "with NaN": _with(math.nan),
    "with infinity": _with(math.inf),
    "with what single precision cannot hold": _with(1e300, np.float64),
    "of an array of texts": {"actions": array((1, 1), "<U4", b"\0" * 16)},
    "of an array of objects": {"actions": array((1,), "|O", b"\0" * 8)},
    "of an array of an unknown type": {"actions": array((1,), "bfloat16", b"\0" * 2)},
    "of an array without data": {"actions": array((2, ACTIONS), "<f4", b"")},
    "of an array of a negative size": {"actions": array((-1, ACTIONS), "<f4", b"\0" * 28)},
    "of an array of 2⁶⁰ rows": {"actions": array((2**60, ACTIONS), "<f4", b"\0" * 28)},
    "of an array without a shape": {"actions": array(None, "<f4", b"\0" * 28)},
    "of an array whose data are a text": {
        "actions": array((1,), "<f4", b"").copy() | {b"data": "x"}
    },
}

BYTES: dict[str, bytes] = {
    "no bytes": b"",
    "a byte that msgpack lacks": b"\xc1",
    "two messages in one": pack(GOOD) * 2,
    "a pickle": b"\x80\x04\x95\x0b\x00\x00\x00\x00\x00\x00\x00}\x94.",
    "a list that says it has 4 billion entries": b"\xdd\xff\xff\xff\xff",
    "100,000 lists in each other": b"\x91" * 100_000 + b"\x01",
    "a mapping whose key is a mapping": b"\x81\x81\x01\x01\x01",
}

TEXTS: dict[str, str] = {
    "a traceback": 'Traceback (most recent call last):\n  File "a.py"\nKeyError: "state"\n',
    "a text of a megabyte": "x" * 10**6,
    "a text that steers terminals": "\x1b[2Jgone",
}


def faults() -> Iterator[Fault]:
    """Go through this area's faults."""
    sent = {
        **{f"an answer {what}": pack(message) for what, message in ANSWERS.items()},
        **BYTES,
        **TEXTS,
    }
    for what, message in sent.items():
        yield Fault(AREA, f"it sends {what}", partial(_refused, _answers(message)))
        late = _answers(pack(GOOD), message)
        yield Fault(AREA, f"its second answer is {what}", partial(_refused, late))
        yield Fault(AREA, f"a recording meets {what}", partial(_not_recorded, late))
    metadata = {what: pack(message) for what, message in METADATA.items()} | BYTES | TEXTS
    for what, message in metadata.items():
        yield Fault(AREA, f"its metadata are {what}", partial(_refused, _greets(message)))
    for what, behaviour in BEHAVIOURS.items():
        yield Fault(AREA, what, partial(_refused, behaviour))
    for what, said in RAW.items():
        yield Fault(AREA, what, partial(_no_websocket, said))
    for what, message in SESSION_ANSWERS.items():
        yield Fault(AREA, f"a model server of vla-eval sends {what}", partial(_session, message))
    yield Fault(AREA, "it reads nothing", _reads_nothing)
    yield Fault(AREA, "a command meets NaN", _command)
    yield Fault(AREA, "nothing listens at its port", _nobody)
    yield Fault(AREA, "its host does not exist", _no_host)
    yield Fault(AREA, "it closes each connection after an answer", _closes_each, GOES_ON)
    yield Fault(AREA, "it restarts in the middle of an episode", _restarts, GOES_ON)
    yield Fault(AREA, "a recording goes on once it answers again", _goes_on, GOES_ON)


SESSION_ANSWERS: dict[str, dict[str, Any]] = {
    "an error": {"type": "error", "payload": {"error": "observation_failed: no such image"}},
    "a message of another kind": {"type": "hello", "payload": {}},
    "a message without a kind": {"payload": GOOD},
    "an answer that is a list": {"type": "action", "payload": [GOOD["actions"]]},
    "an answer without actions": {"type": "action", "payload": {}},
    "an answer of too few numbers": {
        "type": "action",
        "payload": {"actions": np.zeros(ACTIONS - 1, np.float32)},
    },
    "an answer with NaN": {"type": "action", "payload": _with(math.nan)},
    "an answer to another question": {"type": "action", "payload": GOOD, "seq": 1},
    "an answer that nothing numbers": {"type": "action", "payload": GOOD, "seq": None},
}

METADATA: dict[str, Any] = {
    "a number": 5,
    "an array": np.zeros(3),
}


def _answers(*messages: bytes | str) -> Behaviour:
    """Return a server that gives these answers, then none."""

    def behave(client: ServerConnection) -> None:
        client.send(pack({}))
        for message in messages:
            client.recv()
            client.send(message)
        client.recv()

    return behave


def _greets(*first: bytes | str, answers: int = 1) -> Behaviour:
    """Return a server that greets with some messages, and gives each question so many answers."""

    def behave(client: ServerConnection) -> None:
        for message in first:
            client.send(message)
        for _ in client:
            for _ in range(answers):
                client.send(pack(GOOD))

    return behave


def _closes_at_once(client: ServerConnection) -> None:
    client.close(1013, "try again later")


def _answers_raw(data: bytes, ends: bool = False) -> Behaviour:
    """Return a server that sends bytes that are no whole message, and waits or cuts the line."""

    def behave(client: ServerConnection) -> None:
        client.send(pack({}))
        client.recv()
        with suppress(OSError):
            client.socket.sendall(data)
        if ends:
            client.socket.shutdown(socket.SHUT_RDWR)
        with suppress(ConnectionClosed):
            client.recv()

    return behave


def _fragments(client: ServerConnection) -> None:
    """Send a message in ever more fragments."""
    client.send(pack({}))
    client.recv()
    with suppress(ConnectionClosed, OSError):
        client.send(bytes(2**20) for _ in range(200))


HALF = b"\x82\x7e\x10\x00\x81"  # the beginning of a message of 4,096 bytes
GIGABYTE = b"\x82\x7f" + struct.pack(">Q", 2**30) + bytes(2**20)
BEHAVIOURS: dict[str, Behaviour] = {
    "it is silent": _greets(pack({}), answers=0),
    "it closes the connection at once": _closes_at_once,
    "it drops the line in the middle of an answer": _answers_raw(HALF, ends=True),
    "it stops in the middle of an answer": _answers_raw(HALF),
    "it sends a message of a gigabyte": _answers_raw(GIGABYTE),
    "it sends 200 MB in fragments": _fragments,
    "it answers before it is asked": _greets(pack({}), pack(GOOD)),
    "it answers twice": _greets(pack({}), answers=2),
}


def _http(status: str, *headers: str) -> bytes:
    return "\r\n".join([f"HTTP/1.1 {status}", *headers, "", ""]).encode()


RAW: dict[str, bytes] = {
    "it is a page of the web": _http("200 OK", "Content-Length: 0"),
    "it has no room": _http("503 Service Unavailable", "Content-Length: 0"),
    "it sends elsewhere without an address": _http("302 Found", "Content-Length: 0"),
    "it speaks another protocol": b"SSH-2.0-OpenSSH_9.6\r\n",
    "it hangs up": b"",
    "it accepts with a wrong key": _http(
        "101 Switching Protocols",
        "Upgrade: websocket",
        "Connection: Upgrade",
        "Sec-WebSocket-Accept: AAAAAAAAAAAAAAAAAAAAAAAAAAA=",
    ),
}


@contextmanager
def server(behave: Behaviour, port: int = 0) -> Iterator[str]:
    """Serve in a thread, and yield the address."""

    def handle(client: ServerConnection) -> None:
        with suppress(ConnectionClosed):
            behave(client)

    with serve(handle, "127.0.0.1", port, compression=None, max_size=None) as listening:
        thread = Thread(target=listening.serve_forever, daemon=True)
        thread.start()
        yield f"ws://127.0.0.1:{listening.socket.getsockname()[1]}"
        listening.shutdown()
        thread.join()


@contextmanager
def _soon() -> Iterator[None]:
    """Let pauses between attempts be short."""
    before, asking.PAUSE = asking.PAUSE, 0.05
    yield
    asking.PAUSE = before


def _with_keys(address: str, folder: Path) -> str:
    (folder / "keys.yaml").write_text(KEYS)
    return f"{address}#{folder / 'keys.yaml'}"


def _play(address: str, folder: Path) -> Any:
    with _soon():
        return evaluate(_with_keys(address, folder), TASK, [0], **SHORT)


def _refused(behave: Behaviour, folder: Path) -> None:
    with server(behave) as address:
        _named(address, folder)


def _named(address: str, folder: Path) -> None:
    """Play, and see that the error names the server, and nothing but one line of its own."""
    with pytest.raises(RobotLayoutsError) as caught:
        _play(address, folder)
    assert address in str(caught.value)
    assert len(str(caught.value)) < 1000
    raise caught.value


def _session(message: dict[str, Any], folder: Path) -> None:
    """Greet as vla-eval's model servers do, and answer an observation with a message."""

    def behave(client: ServerConnection) -> None:
        for data in client:
            asked = from_texts(data)
            answers = {"hello": {"type": "hello", "payload": {}}, "observation": message}
            if (answer := answers.get(asked["type"])) is not None:
                client.send(pack(with_texts({"seq": asked["seq"], **answer})))

    with server(behave) as address:
        _named(f"vla-eval+{address}", folder)


def _not_recorded(behave: Behaviour, folder: Path) -> None:
    """Nothing of an episode that the server spoils is recorded."""
    with server(behave) as address, _soon():
        policy = _with_keys(address, folder)
        summary = record(TASK, [0], folder / "recorded", policy=policy, **SHORT)
    assert summary.recorded == 0
    raise summary.failed[0]


def _no_websocket(said: bytes, folder: Path) -> None:
    def talk(client: socket.socket) -> None:
        client.recv(4096)
        client.sendall(said)

    with _raw(talk) as address:
        _named(address, folder)


@contextmanager
def _raw(talk: Callable[[socket.socket], None]) -> Iterator[str]:
    """Talk to each client on a socket, in a thread, and yield the address."""
    with socket.create_server(("127.0.0.1", 0)) as listening:

        def accept() -> None:
            with suppress(OSError):
                while True:
                    client, _ = listening.accept()
                    with client:
                        talk(client)

        thread = Thread(target=accept, daemon=True)
        thread.start()
        try:
            yield f"ws://127.0.0.1:{listening.getsockname()[1]}"
        finally:
            listening.shutdown(socket.SHUT_RDWR)
            thread.join()


def _reads_nothing(folder: Path) -> None:
    """It greets, and leaves 50 MB of pictures where they are."""
    done = Event()

    def talk(client: socket.socket) -> None:
        key = re.search(r"(?i)sec-websocket-key: (.*)\r", client.recv(4096).decode())
        assert key is not None
        accepted = f"Sec-WebSocket-Accept: {accept_key(key[1])}"
        upgrade = ("Upgrade: websocket", "Connection: Upgrade")
        client.sendall(_http("101 Switching Protocols", *upgrade, accepted) + b"\x82\x01\x80")
        done.wait()

    with _raw(talk) as address:
        try:
            question = {"image": np.zeros((50, 1000, 1000), np.uint8)}
            asking.Connection(address, address, 0.5).ask(question)
        finally:
            done.set()


def _command(folder: Path) -> None:
    with server(_answers(pack(_with(math.nan)))) as address:
        words = ("--task", TASK, "--episodes", "1", "--workers", "1", "--policy", address)
        run_command("robot_layouts", "evaluate", *words)


def _nobody(folder: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as listening:
        port = listening.getsockname()[1]
    _named(f"ws://127.0.0.1:{port}", folder)


def _no_host(folder: Path) -> None:
    _named("ws://no.such.host.invalid:8000", folder)


def _counts(behaved: list[Any], client: ServerConnection) -> None:
    client.send(pack({}))
    behaved.append(unpack(client.recv()))
    client.send(pack(GOOD))


def _closes_each(folder: Path) -> str:
    asked: list[Any] = []
    with server(partial(_counts, asked)) as address:
        found = _play(address, folder)
    assert found.lengths == {0: 4}
    assert len(asked) == len(found.waits) == 2
    return "a new connection for each answer"


def _restarts(folder: Path) -> str:
    """Refuse the first connection that comes after the first answer."""
    asked: list[Any] = []

    def behave(client: ServerConnection) -> None:
        asked.append(None)
        if len(asked) == 2:
            return
        _answers(pack(GOOD))(client)

    with server(behave) as address:
        found = _play(address, folder)
    assert found.lengths == {0: 4}
    assert len(asked) == 3
    return "the observation is sent again"


def _goes_on(folder: Path) -> str:
    with server(_answers(pack(GOOD), "out of memory")) as address:
        with _soon():
            policy = _with_keys(address, folder)
            first = record(TASK, [0, 1], folder / "recorded", policy=policy, **SHORT)
        port = int(address.rpartition(":")[2])
    assert [*first.failed] == [0, 1]
    with server(_greets(pack({})), port):
        again = record(TASK, [0, 1], folder / "recorded", policy=policy, **SHORT)
    assert again.recorded == 2
    return "episodes that failed are recorded by the next command"

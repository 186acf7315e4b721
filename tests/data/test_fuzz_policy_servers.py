"""Whatever a policy server sends: what msgpack itself reads of it, or one clear error."""

import itertools
import math
import struct
from collections import Counter
from contextlib import closing, contextmanager, suppress
from threading import Thread

import msgpack
import numpy as np
import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.server import serve

import tasks
from robot_layouts.data.playing.served import client as asking
from robot_layouts.data.playing.served.client import Connection, PolicyClient, PolicyServerError
from robot_layouts.data.playing.served.keys import Keys
from tests.data.policy_server import pack

TASK, ACTIONS = "PushT-v1", 7
TYPES = ("<f4", ">f4", "<f8", "<f2", "<i4", "|u1", "|b1", "<c8", "<U3", "|O", "<M8[s]", "bfloat16")
SHAPES = ((2, ACTIONS), (1, ACTIONS), (ACTIONS,), (2, ACTIONS, 1), (0, ACTIONS), (2, 6), (-2, -7))
PLACEHOLDERS = (None, 0, -1, 2**63, math.nan, "left", b"", [], [[0.0] * ACTIONS], {}, {1: 2}, True)
KINDS = ("bytes", "numbers", "text", "frame", "metadata")  # what of a message is wrong
ODD = (math.nan, math.inf, -math.inf, 1e300, 3.4e38, 5e-324, -0.0)


class Server:
    """Greets each client, and answers whatever it asks, with messages that tests choose."""

    def __init__(self):
        self.greeting, self.answer, self.raw = pack({}), b"", False

    def __call__(self, connection):
        with suppress(ConnectionClosed, OSError):
            connection.send(self.greeting)
            for _ in connection:
                if not self.raw:
                    connection.send(self.answer)
                    continue
                connection.socket.sendall(self.answer)
                connection.socket.close()
                return

    @contextmanager
    def listening(self):
        with serve(self, "127.0.0.1", 0, compression=None, max_size=None) as server:
            thread = Thread(target=server.serve_forever, daemon=True)
            thread.start()
            yield f"ws://127.0.0.1:{server.socket.getsockname()[1]}"
            server.shutdown()
            thread.join()


def damaged(rng, data):
    """Return bytes in which a few places are other ones, missing, or more than they were."""
    for _ in range(rng.integers(1, 4)):
        at = int(rng.integers(0, len(data) + 1))
        size = int(rng.integers(1, 9))
        some = rng.integers(0, 256, size, np.uint8).tobytes()
        head, tail = data[:at], data[at:]
        odd = bytes([rng.integers(0xC0, 0xE0)])  # where msgpack's types are
        data = (
            *(head, head + tail[size:], head + some + tail, head + some + tail[size:]),
            *(head + odd + tail[1:], head + head[-size:] + tail),
        )[rng.integers(6)]
    return data


def wrong(rng):
    """Return an answer that msgpack can hold, and of which something is mostly wrong."""
    shape, kind = SHAPES[rng.integers(len(SHAPES))], TYPES[rng.integers(len(TYPES))]
    sizes = {"bfloat16": 2, "|O": 8}
    size = sizes.get(kind) or np.dtype(kind).itemsize
    count = math.prod(shape) + int(rng.integers(-1, 2)) * bool(rng.integers(2))
    array = {
        b"__ndarray__": True,
        b"data": rng.integers(0, 64, max(0, count * size), np.uint8).tobytes(),
        b"dtype": kind,
        b"shape": shape,
    }
    if rng.integers(3) == 0:
        array[[*array][rng.integers(4)]] = PLACEHOLDERS[rng.integers(len(PLACEHOLDERS))]
    actions = np.zeros((2, ACTIONS), (np.float32, np.float64)[rng.integers(2)])
    with np.errstate(over="ignore"):
        actions[rng.integers(2), rng.integers(ACTIONS)] = ODD[rng.integers(len(ODD))]
    chosen = (array, actions, PLACEHOLDERS[rng.integers(len(PLACEHOLDERS))])[rng.integers(3)]
    key = ("action", b"actions", 1, *("actions",) * 12)[rng.integers(15)]
    return pack({key: chosen} if rng.integers(8) else chosen)


def framed(rng, data):
    """Return a frame of WebSocket's that is damaged."""
    return damaged(rng, b"\x82\x7e" + struct.pack(">H", len(data)) + data)


def read(data):
    """Return the actions that msgpack itself and NumPy find in an answer; None: it is wrong."""

    def decoded(found):
        if b"__ndarray__" not in found and "__ndarray__" not in found:
            return found.get(b"data") if b"__npgeneric__" in found else found
        names = {key if isinstance(key, bytes) else str(key).encode(): found[key] for key in found}
        kind = np.dtype(names[b"dtype"])
        if kind.kind not in "biuf":
            raise ValueError(kind)
        return np.frombuffer(names[b"data"], kind).reshape(names[b"shape"])

    try:
        found = msgpack.unpackb(data, object_hook=decoded, strict_map_key=False)["actions"]
        with np.errstate(all="ignore"):
            finite = np.isfinite(found.astype(np.float32)).all() and found.dtype.kind != "b"
    except Exception:
        return None
    return (
        found if found.ndim == 2 and found.shape[1] == ACTIONS and len(found) and finite else None
    )


def sent(server, kind, rng, good):
    """Let the server send something wrong, mostly."""
    server.greeting, server.answer, server.raw = pack({}), good, kind == "frame"
    if kind == "metadata":
        server.greeting = damaged(rng, pack({"served": "x", "n": 1}))
    elif kind == "text":
        server.answer = damaged(rng, good).decode("latin-1")
    elif kind == "numbers":
        server.answer = wrong(rng)
    elif kind == "bytes":
        server.answer = damaged(rng, good)
    else:
        server.answer = framed(rng, good)


def carried_out(keys, address, observation, steps):
    """Return the first actions of a chunk, or the error in place of them."""
    policy = PolicyClient(keys, Connection(address, address, keys.seconds))
    try:
        return np.array([policy(observation) for _ in range(steps)])
    except PolicyServerError as error:
        return error
    finally:
        policy.close()


@pytest.mark.parametrize("count", [150, pytest.param(1000, marks=pytest.mark.long)])
def test_no_fault_of_a_server_is_silent(count, monkeypatch):
    """An answer that is one is carried out as it is; all else is an error that names the server."""
    monkeypatch.setattr(asking, "PAUSE", 0.0)
    good, server, faults = (
        pack({"actions": np.zeros((2, ACTIONS), np.float32)}),
        Server(),
        Counter(),
    )
    numbers = itertools.count()
    with closing(tasks.make(TASK)) as env, server.listening() as address:
        keys = Keys({"observation": {"state": {"text": "here"}}, "timeout": 0.3}, env)
        observation, _ = env.reset(seed=0)
        while faults.total() < count:
            number = next(numbers)
            kind = KINDS[number % len(KINDS)]
            sent(server, kind, np.random.default_rng(number), good)
            expected = read(server.answer) if kind in ("bytes", "numbers") else None
            steps = 1 if expected is None else len(expected)
            found = carried_out(keys, address, observation, steps)
            if isinstance(found, Exception):
                assert expected is None, number
                assert address in str(found), number
                assert len(str(found)) < 1000, number
                faults[kind] += 1
            elif kind in ("bytes", "numbers"):
                assert np.array_equal(found, np.float32(expected)), number
    assert min(faults.values()) > count / 50, faults
    assert set(faults) == set(KINDS)

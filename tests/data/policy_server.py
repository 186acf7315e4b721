"""Policy servers as openpi and vla-eval have them, in processes of their own, by msgpack itself.

``python -m tests.data.policy_server MODULE:NAME [vla-eval]`` prints its port. What it serves is
called with each observation, and returns the answer.
"""

import os
import subprocess
import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib import import_module
from pathlib import Path
from typing import Any

import msgpack
import numpy as np
from websockets.exceptions import ConnectionClosed
from websockets.sync.server import ServerConnection, serve

ROOT = Path(__file__).parents[2]


def pack(message: Any) -> bytes:
    def encoded(value: Any) -> Any:
        if isinstance(value, np.ndarray):
            return {
                b"__ndarray__": True,
                b"data": value.tobytes(),
                b"dtype": value.dtype.str,
                b"shape": value.shape,
            }
        return {b"__npgeneric__": True, b"data": value.item(), b"dtype": value.dtype.str}

    return msgpack.packb(message, default=encoded)


def unpack(data: bytes) -> Any:
    def decoded(found: dict[Any, Any]) -> Any:
        if b"__ndarray__" in found:
            return np.ndarray(found[b"shape"], np.dtype(found[b"dtype"]), found[b"data"])
        return found

    return msgpack.unpackb(data, object_hook=decoded)


def answer_all(connection: ServerConnection, policy: Any) -> None:
    """Serve one client: metadata first, then an answer to each observation, or a traceback."""
    connection.send(pack({"served": type(policy).__name__}))
    while True:
        try:
            observation = unpack(connection.recv())
            connection.send(pack({**policy(observation), "server_timing": np.float64(0.0)}))
        except ConnectionClosed:
            return
        except Exception:
            connection.send(traceback.format_exc())
            connection.close(1011, "internal error")
            return


def with_texts(message: Any) -> Any:
    """Return a message whose arrays are as vla-eval has them, ready for `pack`."""
    if isinstance(message, dict):
        return {key: with_texts(part) for key, part in message.items()}
    if not isinstance(message, np.ndarray):
        return message
    about = {"dtype": message.dtype.str, "shape": list(message.shape)}
    return {"__ndarray__": True, "data": message.tobytes(), **about}


def from_texts(data: bytes) -> Any:
    """Return the message that bytes of vla-eval's hold."""

    def decoded(found: dict[Any, Any]) -> Any:
        if "__ndarray__" in found:
            return np.frombuffer(found["data"], found["dtype"]).reshape(found["shape"])
        return found

    return msgpack.unpackb(data, object_hook=decoded)


def answer_sessions(connection: ServerConnection, policy: Any) -> None:
    """Serve one client as vla-eval does: hello, a task, then an answer to each observation."""
    begun = False
    with suppress(ConnectionClosed):
        while True:
            message = from_texts(connection.recv())
            kind, payload = message["type"], message["payload"]
            assert isinstance(message["timestamp"], float)
            if kind == "episode_start":
                begun = payload["task"]["suite"] == "robot-layouts"
                continue
            if kind == "hello":
                assert payload["protocol_version"] == 1
                answer = {"type": "hello", "payload": {"model_server": "Test"}}
            else:
                assert (kind, begun) == ("observation", True)
                answer = {"type": "action", "payload": policy(payload)}
            connection.send(pack(with_texts({**answer, "seq": message["seq"], "timestamp": 0.0})))


PROTOCOLS = {"openpi": answer_all, "vla-eval": answer_sessions}


@contextmanager
def server(policy: str, protocol: str = "openpi") -> Iterator[str]:
    """Serve ``MODULE:NAME`` in another process, and yield its address."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    process = subprocess.Popen(
        [sys.executable, "-m", "tests.data.policy_server", policy, protocol],
        stdout=subprocess.PIPE,
        text=True,
        env=environment,
        cwd=ROOT,
    )
    try:
        assert process.stdout is not None
        scheme = "ws" if protocol == "openpi" else f"{protocol}+ws"
        yield f"{scheme}://127.0.0.1:{int(process.stdout.readline())}"
    finally:
        process.kill()
        process.communicate()


def main(name: str, protocol: str) -> None:
    module, _, attribute = name.partition(":")
    policy = getattr(import_module(module), attribute)

    def answer(connection: ServerConnection) -> None:
        PROTOCOLS[protocol](connection, policy() if isinstance(policy, type) else policy)

    with serve(answer, "127.0.0.1", 0, compression=None, max_size=None) as listening:
        print(listening.socket.getsockname()[1], flush=True)
        listening.serve_forever()


if __name__ == "__main__":
    main(*sys.argv[1:])

"""Clusters that are not there."""

from __future__ import annotations

import functools
import os
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from unittest.mock import patch

from robot_layouts.data.playing.ray_executor import RayExecutor
from tests.faults.fault import Fault
from tests.faults.players import AREA, Mischief, fault_of, ray_executor

NO_ADDRESS = (
    *("", "local", "head", "head:", ":6379", "head:0", "head:99999", "head:6379x"),
    *("ray://head:10001", "a b:6379", "[]:6379", "head:6379\n", None, 6379, ("head", 6379)),
)
SILENT_SECONDS = 2.0  # that a cluster may take to answer here


def faults() -> Iterator[Fault]:
    """Go through this area's faults."""
    for value in NO_ADDRESS:
        yield fault_of(f"RayExecutor({value!r})", ray_executor, address=value)
    yield Fault(AREA, "a port that refuses", lambda folder: _join("127.0.0.77:1"))
    yield Fault(AREA, "a host that does not exist", lambda folder: _join("no-such.invalid:6379"))
    yield Fault(AREA, "RAY_ADDRESS names a port that refuses", _stale_environment)
    for what, answer in (
        ("is silent", b""),
        ("speaks HTTP", b"HTTP/1.1 400 Bad Request\r\n\r\n"),
        ("sends random bytes", bytes(range(256)) * 64),
    ):
        run = functools.partial(_port_that_is_no_head, answer)
        yield Fault(AREA, f"a port that accepts and {what}", run)


def _join(address: str) -> None:
    next(RayExecutor(address).run(Mischief(Path(), "", ""), [0]))


def _stale_environment(folder: Path) -> None:
    with patch.dict(os.environ, {"RAY_ADDRESS": "127.0.0.77:1"}):
        _join("auto")


def _port_that_is_no_head(answer: bytes, folder: Path) -> None:
    with (
        patch("robot_layouts.data.playing.ray_cluster._JOIN_SECONDS", SILENT_SECONDS),
        _answering_port(answer) as port,
    ):
        _join(f"127.0.0.77:{port}")


@contextmanager
def _answering_port(answer: bytes) -> Iterator[int]:
    with socket.create_server(("127.0.0.77", 0)) as server:

        def serve() -> None:
            kept = []
            while True:
                try:
                    connection, _ = server.accept()
                except OSError:
                    return
                kept.append(connection)
                connection.sendall(answer)

        threading.Thread(target=serve, daemon=True).start()
        yield server.getsockname()[1]
        server.shutdown(socket.SHUT_RDWR)

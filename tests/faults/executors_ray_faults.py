"""Clusters that are not there, and actors that die."""

from __future__ import annotations

import atexit
import functools
import os
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import patch

from robot_layouts.data.playing.ray_executor import RayExecutor
from tests.data.clusters import running_cluster
from tests.faults.fault import GOES_ON, Fault
from tests.faults.players import (
    AREA,
    Elsewhere,
    Mischief,
    expect_squares,
    fault_of,
    ray_executor,
)


def faults() -> Iterator[Fault]:
    """Go through this area's faults."""
    yield from _wrong_addresses()
    yield from _clusters()


NO_ADDRESS = (
    *("", "local", "head", "head:", ":6379", "head:0", "head:99999", "head:6379x"),
    *("ray://head:10001", "a b:6379", "[]:6379", "head:6379\n", None, 6379, ("head", 6379)),
)
SILENT_SECONDS = 2.0  # that a cluster may take to answer here


def _wrong_addresses() -> Iterator[Fault]:
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


# -- actors ---------------------------------------------------------------------------------------


def _clusters() -> Iterator[Fault]:
    for what in ("signal SIGKILL", "signal SIGSTOP", "exit 0", "busy"):
        run = functools.partial(_plays_again_on_ray, what)
        yield Fault(AREA, f"an actor's episode: {what}", run, GOES_ON)
    yield Fault(AREA, "every actor at one seed: exit 5", _gives_up_on_ray)
    yield Fault(AREA, "no actor can load what is to be played", _unloadable_on_ray)


@functools.cache
def _cluster() -> Any:
    """Return a cluster of one node with a CPU, which lives as long as this process."""
    manager = running_cluster()
    nodes = manager.__enter__()
    atexit.register(manager.__exit__, None, None, None)
    nodes.grow(1)
    return nodes


def _on_ray(**more: Any) -> Any:
    modules = ["tests.faults.players"]
    return RayExecutor(_cluster().address, 1, modules=modules, episode_timeout=2.0, **more)


def _plays_again_on_ray(what: str, folder: Path) -> str:
    happened = expect_squares(_on_ray(), Mischief(folder, what, "play"))
    _cluster().wait_for_no_player()
    return happened


def _gives_up_on_ray(folder: Path) -> None:
    prepare = Mischief(folder, "exit 5", "play", again=True)
    for event in _on_ray(attempts=2).run(prepare, range(3)):
        if event.error is not None:
            assert "seed 1" in str(event.error)
            raise event.error


def _unloadable_on_ray(folder: Path) -> None:
    list(_on_ray().run(Elsewhere(), range(3)))


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

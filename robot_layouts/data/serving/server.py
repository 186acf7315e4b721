"""Serves the environments of a task over a websocket: each client has a world of its own."""

from __future__ import annotations

import asyncio
import hmac
import logging
import secrets
from collections.abc import Callable
from contextlib import closing, suppress
from dataclasses import dataclass
from functools import partial
from http import HTTPStatus
from typing import Any
from urllib.parse import parse_qs

import torch

from layouts.commands import Server
from robot_layouts.core.cli import Count
from robot_layouts.core.importing import optional
from robot_layouts.data.playing.command_options import ControlMode, Observing, stop_signals
from robot_layouts.data.playing.served.client import pack
from robot_layouts.data.serving.world import ClientWorld, about
from robots import TaskError
from tasks import make
from tasks.cell_options import CellOptions

MOST_BYTES = 2**24  # of a client's message, else the connection ends
CLIENTS = 8
_TOKEN_BYTES = 32
_REFUSED = "The token is missing or another: connect to the address that the command printed.\n"
_CROWDED = "As many clients as the server takes have worlds here; see --clients.\n"


@dataclass(frozen=True, kw_only=True)
class Admission:
    """Who may connect.

    Attributes:
        token: Ask for no token: everything that reaches the port may step worlds.
        clients: How many clients have worlds at once, each one of its own.
    """

    token: bool = True
    clients: Count = CLIENTS


def serve(
    task: str,
    *,
    server: Server,
    admission: Admission | None = None,
    on_ready: Callable[[str], None],
    **making: Any,
) -> None:
    """Serve a task until this is interrupted.

    All worlds are stepped in this thread, one message after the other, so that what one client gets
    does not depend on the others.

    Args:
        task: Task id; ``module:Id`` for one of a module that no package lists.
        server: Where it listens.
        admission: Who may connect; by default 8 clients with the token.
        on_ready: Called with the address, token and all, once it listens.
        making: Other arguments of `tasks.make`.

    Raises:
        TaskError: If the task cannot be made like that, or the port not be used.
        MissingPackageError: If websockets is not installed.
    """
    websockets = optional("websockets.asyncio.server", "serving needs websockets", "served")
    torch.set_num_threads(1)  # sums are the same everywhere
    world = partial(make, task, **making)
    with closing(world()) as env:
        first = pack(about(env))
    service = _Service(world, first, admission or Admission())
    asyncio.run(service.run(websockets, server, on_ready))


class _Service:
    def __init__(self, make: Callable[[], Any], first: bytes, admission: Admission) -> None:
        self._make, self._first, self._most = make, first, admission.clients
        self._token = secrets.token_urlsafe(_TOKEN_BYTES) if admission.token else None

    async def run(self, websockets: Any, server: Server, on_ready: Callable[[str], None]) -> None:
        quiet = logging.getLogger(f"{__name__}.websockets")
        quiet.disabled = True  # a client that goes away is no news
        settings = {
            "process_request": self._admit,
            "origins": [None],  # no web page
            "compression": None,
            "max_size": MOST_BYTES,
            "ping_interval": None,  # a world that is being made answers none
            "logger": quiet,
        }
        try:
            listening = await websockets.serve(self._attend, server.host, server.port, **settings)
        except (OSError, OverflowError) as error:
            where = f"{server.host}:{server.port}"
            raise TaskError(f"cannot listen at {where}: {error}; choose --host or --port") from None
        async with listening:
            port = listening.sockets[0].getsockname()[1]
            host = f"[{server.host}]" if ":" in server.host else server.host
            on_ready(f"ws://{host}:{port}" + (f"/?token={self._token}" if self._token else ""))
            await listening.serve_forever()

    def _admit(self, connection: Any, request: Any) -> Any:
        given = parse_qs(request.path.partition("?")[2]).get("token", [""])[0]
        if self._token and not hmac.compare_digest(given.encode(), self._token.encode()):
            return connection.respond(HTTPStatus.FORBIDDEN, _REFUSED)
        if len(connection.server.connections) >= self._most:
            return connection.respond(HTTPStatus.SERVICE_UNAVAILABLE, _CROWDED)
        return None

    async def _attend(self, connection: Any) -> None:
        from websockets.exceptions import ConnectionClosed

        with closing(ClientWorld(self._make)) as world, suppress(ConnectionClosed):
            await connection.send(self._first)
            async for message in connection:
                await connection.send(world.answer(message))


def serve_command(
    task: str,
    *,
    server: Server,
    admission: Admission,
    observing: Observing,
    cell: CellOptions,
    control_mode: ControlMode | None = None,
) -> None:
    """Offer a task's environments over a websocket, for programs of other packages or machines.

    Prints the address, and serves until Ctrl-C. Every client has a world of its own; an episode
    is that of its seed, to the last bit. Exit code: 0 if it served, 1 if not, 2 for bad usage.

    Args:
        task: Task id; MODULE:ID for one of your own.
        server: Where it listens.
        admission: Who may connect.
        observing: What is observed.
        cell: The task's robots, and what varies.
        control_mode: What actions ask for (as the layout says, else pd_joint_delta_pos).

    Raises:
        RobotLayoutsError: If the task cannot be made, or not be served there.
    """

    def show(address: str) -> None:
        print(f"{task}: {address}", flush=True)

    making = {**observing.observing(), **cell.making(), "control_mode": control_mode}
    with stop_signals(), suppress(KeyboardInterrupt):
        serve(task, server=server, admission=admission, on_ready=show, **making)

"""Serves the environments of a task over a websocket: each client has a world of its own."""

from __future__ import annotations

import asyncio
import hmac
import logging
import secrets
from collections.abc import Callable, Mapping
from contextlib import closing, suppress
from dataclasses import dataclass
from functools import partial
from http import HTTPStatus
from importlib import metadata
from typing import Any
from urllib.parse import parse_qs

import numpy as np
import torch

from layouts.commands import Server
from robot_layouts.core.cli import Count
from robot_layouts.core.importing import optional
from robot_layouts.core.processes.transport import as_ours
from robot_layouts.core.quoting import shown
from robot_layouts.data.playing.command_options import ControlMode, Observing, stop_signals
from robot_layouts.data.playing.served.client import pack, unpack
from robot_layouts.data.serving.client import CALL, ERROR, written_space
from robots import TaskError, UnknownNameError
from robots.control_modes import plain_mode
from tasks import TaskEnv, make
from tasks.cell_options import CellOptions
from tasks.description import instruction_of
from tasks.engine.checks import RECONFIGURE
from tasks.interfaces.gymnasium import info_row, row

MOST_BYTES = 2**24  # of a client's message, else the connection ends
MOST_READ = 2**20  # bytes of a client's message: an action takes some hundred
CLIENTS = 8
_RESET, _STEP = "reset", "step"
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


class ClientWorld:
    """The world of one client; it is made when an episode first begins."""

    def __init__(self, make: Callable[[], TaskEnv]) -> None:
        """Keep how it is made."""
        self._make = make
        self._env: TaskEnv | None = None

    def answer(self, data: bytes | str) -> bytes:
        """Return the answer to a message; to one that is invalid, why, and nothing has changed."""
        try:
            return pack(self._answer(data))
        except Exception as error:  # also of a user's own task: others go on
            return pack({ERROR: str(as_ours(error))})

    def close(self) -> None:
        """Let the world go."""
        if self._env is not None:
            self._env.close()

    def _answer(self, data: bytes | str) -> dict[str, Any]:
        if isinstance(data, str):
            raise TaskError(f"a text was sent, {shown(data)}; a message is a mapping in msgpack")
        if len(data) > MOST_READ:
            raise TaskError(
                f"a message of {len(data):,} bytes was sent; {MOST_READ:,} are most, and an action"
                " takes some hundred"
            )
        message = unpack(data)
        if not isinstance(message, Mapping):
            raise TaskError(f"{shown(message)} was sent; a message is a mapping")
        call, given = message.get(CALL), {k: v for k, v in message.items() if k != CALL}
        if call == _RESET:
            return self._reset(**_only(given, "seed"))
        if call == _STEP:
            return self._step(**_only(given, "action"))
        raise UnknownNameError("call", call, (_RESET, _STEP))

    def _reset(self, seed: Any = None) -> dict[str, Any]:
        if self._env is None:
            self._env = self._make()
        obs, info = self._env.reset(seed, {RECONFIGURE: True})
        return {"observation": row(obs), "info": info_row(info, self._env.seeds[0])}

    def _step(self, action: Any = None) -> dict[str, Any]:
        if self._env is None:
            raise TaskError("no episode has begun; reset first")
        parts = isinstance(action, Mapping)
        own = {name: np.array(part) for name, part in action.items()} if parts else np.array(action)
        obs, reward, terminated, truncated, info = self._env.step(own)
        return {
            "observation": row(obs),
            "reward": reward[0].item(),
            "terminated": bool(terminated[0]),
            "truncated": bool(truncated[0]),
            "info": info_row(info, self._env.seeds[0]),
        }


def _only(given: Mapping[Any, Any], name: str) -> dict[str, Any]:
    for key in given:
        if key != name:
            raise UnknownNameError("part of the message", key, (CALL, name))
    return {name: given[name]} if name in given else {}


def about(env: TaskEnv) -> dict[str, Any]:
    """Return what clients are told first: what is to be done, by which arms, and the spaces."""
    layout = env.layout
    return {
        "task": env.task_id,
        "instruction": instruction_of(env.task_class),
        "robots": {place: placed.robot.name for place, placed in layout.items()},
        "arms": list(layout.arms),
        "action_split": {name: [s.start, s.stop] for name, s in env.action_split.items()},
        "control_mode": plain_mode(env.control_mode),
        "control_frequency": env.scenario.control_frequency,
        "max_episode_steps": env.max_episode_steps,
        "obs_mode": env.obs_mode,
        "action_space": written_space(env.single_action_space),
        "observation_space": written_space(env.single_observation_space),
        "version": metadata.version("robot-layouts"),
    }


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

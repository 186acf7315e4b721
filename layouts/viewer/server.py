"""The web server behind a page: where it listens, whom it lets in, and how it ends."""

from __future__ import annotations

import asyncio
import errno
import io
import logging
import socket
import threading
from collections.abc import Callable, Generator
from contextlib import contextmanager, redirect_stdout
from typing import Any, NamedTuple

from layouts.viewer.guard import MESSAGE_BYTES, Guard, fits
from robot_layouts.core.importing import optional
from robots import RobotLayoutsError

LAST_PORT = 65535
REST = 0.002  # s between two messages of a browser, which sends 120 in a second of dragging
# Requests without the token are not logged on the terminal; to see them, add a handler.
LOG = logging.getLogger(__name__)
LOG.addHandler(logging.NullHandler())
_STARTING = threading.Lock()


class ViewerError(RobotLayoutsError, OSError):
    """A page that cannot be served or saved as asked."""


class PageServer(NamedTuple):
    """A web server that runs.

    Attributes:
        server: The viser server.
        address: What to open in a browser, with the token.
    """

    server: Any
    address: str


@contextmanager
def serving(host: str, port: int, title: str) -> Generator[PageServer, None, None]:
    """Start a viser server that accepts only requests with its token, and stop it at the end.

    Args:
        host: Address to listen at; ``0.0.0.0`` is every one of this machine's.
        port: Port to listen at; 0 takes a free one.
        title: What the page calls itself.

    Raises:
        MissingPackageError: If viser is not installed.
        ViewerError: If the port is in use, the address is none of this machine's, or this version
            of viser would accept any client.
    """
    viser = import_viser()
    port = _free_port(host, port)
    guard = Guard.of(host, port)
    started: list[Any] = []
    with redirect_stdout(io.StringIO()), _guarded(guard, started) as guarded:  # without a banner
        server: Any = viser.ViserServer(host=host, port=port, label=title, verbose=False)
    started.append(server)
    try:
        if server.get_port() != port:  # viser goes on to the next one without a word
            raise ViewerError(_in_use(host, port))
        if not guarded or not hasattr(server.gui, "_gui_input_handle_from_uuid"):
            raise ViewerError(
                f"viser {viser.__version__} would accept any client, so no page is served:"
                " pip install 'viser>=1.1.1,<1.2'"
            )
        yield PageServer(server, guard.address(host))
    finally:
        with redirect_stdout(io.StringIO()):
            server.stop()


def import_viser() -> Any:
    """Return the viser package.

    Raises:
        MissingPackageError: If it is not installed.
    """
    return optional("viser", "a page needs viser", "view")


@contextmanager
def _guarded(guard: Guard, started: list[Any]) -> Generator[list[object], None, None]:
    """Let the guard see what comes to the server that viser starts meanwhile, before viser does.

    viser has no option for that, but the `websockets` package on which it stands has: viser's call
    of its ``serve`` is completed with them.

    Args:
        guard: Answers every request.
        started: Will hold the viser server; until then no message is taken.

    Yields:
        What viser handles connections with, if it came by here: nothing before, nor if it is a
        version that serves in another way.
    """
    from websockets.asyncio import server as websockets

    serve = websockets.serve
    guarded: list[object] = []

    def serve_guarded(handler: Callable[..., Any], *where: Any, **options: Any) -> Any:
        if not handler.__module__.startswith("viser."):  # of another thread, and none of ours
            return serve(handler, *where, **options)
        guarded.append(handler)
        page = options.get("process_request")

        def answer(connection: Any, request: Any) -> Any:
            return guard.answer(connection, request, page)

        options |= {"process_request": answer, "max_size": MESSAGE_BYTES, "logger": LOG}
        return serve(_sifted(handler, started), *where, **options)

    with _STARTING:
        websockets.serve = serve_guarded  # pyright: ignore[reportAttributeAccessIssue]
        try:
            yield guarded
        finally:
            websockets.serve = serve


def _sifted(handler: Callable[..., Any], started: list[Any]) -> Callable[..., Any]:
    """Return a handler of connections that receives only messages which `fits` lets through.

    It receives at most one in `REST` seconds, so that a flood of messages does not keep this
    process from everything else.
    """

    async def handle(connection: Any) -> None:
        receive = connection.recv

        async def receive_fitting() -> Any:
            while True:
                await asyncio.sleep(REST)
                data = await receive()
                if started and fits(started[0], data):
                    return data

        connection.recv = receive_fitting
        await handler(connection)

    return handle


def _free_port(host: str, port: int) -> int:
    if not host:
        raise ViewerError("--host is empty; 127.0.0.1 is this machine alone, 0.0.0.0 the network")
    if not 0 <= port <= LAST_PORT:
        raise ViewerError(f"port {port} does not exist; ports are 0 … {LAST_PORT}")
    try:
        family, kind, protocol, _, place = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        with socket.socket(family, kind, protocol) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(place)
            return int(probe.getsockname()[1])
    except (socket.gaierror, UnicodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "not a name"
        raise ViewerError(f"there is no address {host!r}: {reason}") from error
    except PermissionError as error:
        raise ViewerError(
            f"port {port} may not be used by this user; ports from 1024 on may"
        ) from error
    except OSError as error:
        if error.errno == errno.EADDRINUSE:
            raise ViewerError(_in_use(host, port)) from error
        raise ViewerError(f"cannot listen at {host!r}, port {port}: {error.strerror}") from error


def _in_use(host: str, port: int) -> str:
    return (
        f"port {port} of {host} is in use, perhaps by another page; --port {port + 1} or another"
        " number chooses one, --port 0 any that is free"
    )

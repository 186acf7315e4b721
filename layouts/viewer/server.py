"""The web server behind a page: where it listens, and how it ends."""

from __future__ import annotations

import errno
import io
import socket
from collections.abc import Generator
from contextlib import contextmanager, redirect_stdout
from typing import Any

from robots import MissingPackageError, RobotLayoutsError

LAST_PORT = 65535


class ViewerError(RobotLayoutsError, OSError):
    """A page that cannot be served or saved as asked."""


@contextmanager
def serving(host: str, port: int, title: str) -> Generator[Any, None, None]:
    """Start a viser server, and stop it at the end.

    Args:
        host: Address to listen at; ``0.0.0.0`` is every one of this machine's.
        port: Port to listen at; 0 takes a free one.
        title: What the page calls itself.

    Raises:
        MissingPackageError: If viser is not installed.
        ViewerError: If the port is in use, or the address is none of this machine's.
    """
    viser = import_viser()
    port = _free_port(host, port)
    with redirect_stdout(io.StringIO()):  # of viser's own banner
        server: Any = viser.ViserServer(host=host, port=port, label=title, verbose=False)
    try:
        if server.get_port() != port:  # viser goes on to the next one without a word
            raise ViewerError(_in_use(host, port))
        yield server
    finally:
        with redirect_stdout(io.StringIO()):
            server.stop()


def import_viser() -> Any:
    """Return the viser package.

    Raises:
        MissingPackageError: If it is not installed.
    """
    try:
        import viser
    except ImportError as error:
        raise MissingPackageError(
            "a page needs viser: pip install 'robot-layouts[view]'"
        ) from error
    return viser


def address(host: str, port: int) -> str:
    """Return what to open in a browser."""
    if host in ("0.0.0.0", "::"):
        host = "localhost"
    return f"http://{f'[{host}]' if ':' in host else host}:{port}"


def _free_port(host: str, port: int) -> int:
    if not 0 <= port <= LAST_PORT:
        raise ViewerError(f"port {port} is none; ports are 0 … {LAST_PORT}")
    try:
        family, kind, protocol, _, place = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        with socket.socket(family, kind, protocol) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(place)
            return int(probe.getsockname()[1])
    except socket.gaierror as error:
        raise ViewerError(f"there is no address {host!r}: {error.strerror}") from error
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

"""Who may open a page, what a browser may do with it, and what it may send back."""

from __future__ import annotations

import dataclasses
import hmac
import ipaddress
import math
import secrets
import socket
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from http import HTTPStatus
from typing import Any
from urllib.parse import parse_qs, quote

from robot_layouts.core.bounds import UNIT_TOLERANCE

MOST_CLIENTS = 32  # tabs that show a page at the same time
HTTP_PORT = 80  # which browsers leave out of an address
TOKEN_BYTES = 32
MESSAGE_BYTES = 1 << 14  # of the largest that is read; a camera's takes some hundred
REFUSAL = (
    "This page opens only at the address that the command printed: open that one, token and all.\n"
    "If it reaches you through a tunnel, forward it to the same port number of localhost.\n"
)
CROWDED = f"{MOST_CLIENTS} tabs show this page already; close one of them.\n"
# A browser loads nothing from elsewhere, shows the page in no frame, and does not pass its address
# on. viser's page is one file: a script that unpacks workers, WebAssembly, fonts and pictures.
POLICY = {
    "default-src": "'none'",
    "script-src": "'unsafe-inline' 'unsafe-eval' blob:",
    "worker-src": "blob:",
    "style-src": "'unsafe-inline'",
    "img-src": "data: blob:",
    "font-src": "data:",
    "connect-src": "data: blob:",
    "base-uri": "'none'",
    "form-action": "'none'",
}


@dataclass(frozen=True)
class Guard:
    """Accepts requests with the token, from the page itself, under a name of this machine.

    A page of another origin can make a browser ask for this one, or connect to it: it does not have
    the token, and the browser says in ``Origin`` where it comes from. A name on the internet can be
    made to lead to this machine (DNS rebinding): the browser says in ``Host`` what it was. The
    token is never a cookie, which browsers would send to servers at every port of this machine.

    Attributes:
        port: Where the server listens.
        names: Names of this machine, in lower case, that may stand in ``Host``. So may the address
            at which a request arrives and, if that is a loopback address, ``localhost``.
        token: What every request must hold as ``?token=…``.
    """

    port: int
    names: frozenset[str] = frozenset()
    token: str = field(default_factory=lambda: secrets.token_urlsafe(TOKEN_BYTES), repr=False)

    @classmethod
    def of(cls, host: str, port: int) -> Guard:
        """Make the guard of a server.

        Args:
            host: Address or name at which it listens. If the network can reach it there, this
                machine's own host name leads to it, too.
            port: Its port.
        """
        names = {host.lower()} if _literal(host) is None else set[str]()
        if not is_loopback(host):
            own = socket.gethostname().lower()
            names |= {own, f"{own}.local"}
        return cls(port, frozenset(names))

    def address(self, host: str) -> str:
        """Return what to open in a browser.

        Args:
            host: Address or name at which the server listens.
        """
        name = host
        if is_wildcard(host):
            name = "::1" if ":" in host else "localhost"
        return f"http://{f'[{name}]' if ':' in name else name}:{self.port}/?token={self.token}"

    def answer(
        self, connection: Any, request: Any, page: Callable[[Any, Any], Any] | None
    ) -> Any | None:
        """Answer a request, or let a WebSocket open by answering None.

        Args:
            connection: The connection of the `websockets` package.
            request: Its request.
            page: Answers requests that are let in and are of no WebSocket.
        """
        path, _, query = request.path.partition("?")
        words = parse_qs(query, keep_blank_values=True)
        if not self._admits(request.headers, words, connection.local_address[0]):
            return _plain(connection, HTTPStatus.FORBIDDEN, REFUSAL)
        if path != "/":
            return _plain(connection, HTTPStatus.NOT_FOUND, "There is one page here, at /.\n")
        if "websocket" in map(str.lower, request.headers.get_all("Upgrade")):
            full = len(connection.server.connections) >= MOST_CLIENTS
            return _plain(connection, HTTPStatus.SERVICE_UNAVAILABLE, CROWDED) if full else None
        host = request.headers["Host"]
        stream = f"ws://{host}/?token={self.token}"
        if words.get("websocket") != [stream]:
            return self._redirect(connection, stream)
        response = page(connection, request) if page is not None else None
        return response and _secured(response, f"ws://{host}")

    def _admits(self, headers: Any, words: Mapping[str, list[str]], arrived_at: str) -> bool:
        hosts, origins = headers.get_all("Host"), headers.get_all("Origin")
        given = words.get("token", [])
        return (
            len(hosts) == len(given) == 1
            and self._names_us(hosts[0].lower(), arrived_at)
            and {origin.lower() for origin in origins} <= {f"http://{hosts[0].lower()}"}
            and hmac.compare_digest(given[0].encode(errors="replace"), self.token.encode())
        )

    def _names_us(self, host: str, arrived_at: str) -> bool:
        name, colon, port = host.rpartition(":")
        if not colon or port.endswith("]"):  # no port, though perhaps an IPv6 address
            name, port = host, str(HTTP_PORT)
        if port != str(self.port):
            return False
        here = ipaddress.ip_address(arrived_at.partition("%")[0])
        if name == "localhost":
            return here.is_loopback
        return name in self.names or name == (f"[{here}]" if here.version == 6 else str(here))

    def _redirect(self, connection: Any, stream: str) -> Any:
        """Lead a browser to the address that says where viser's client finds its WebSocket.

        By itself it would connect to the page's address without the token.
        """
        response = _plain(connection, HTTPStatus.FOUND, "")
        response.headers["Location"] = f"/?token={self.token}&websocket={quote(stream, safe='')}"
        return response


def is_wildcard(host: str) -> bool:
    """Return whether a host stands for every address of this machine."""
    address = _literal(host)
    return address is not None and address.is_unspecified


def is_loopback(host: str) -> bool:
    """Return whether a host can be reached from this machine alone."""
    address = _literal(host)
    return host.lower() == "localhost" or (address is not None and address.is_loopback)


def policy(sources: str = "") -> str:
    """Return the ``Content-Security-Policy`` of a page.

    Args:
        sources: What it may connect to besides itself.
    """
    rules = {**POLICY, "connect-src": f"{POLICY['connect-src']} {sources}".strip()}
    return "; ".join(f"{name} {value}" for name, value in rules.items())


def _literal(host: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
    try:
        return ipaddress.ip_address(host.partition("%")[0])
    except ValueError:
        return None


def _plain(connection: Any, status: HTTPStatus, text: str) -> Any:
    return _secured(connection.respond(status, text))


def _secured(response: Any, sources: str = "") -> Any:
    """Add what a browser must observe to a response."""
    response.headers["Content-Security-Policy"] = f"{policy(sources)}; frame-ancestors 'none'"
    response.headers["X-Frame-Options"] = "DENY"
    response.headers["X-Content-Type-Options"] = "nosniff"
    response.headers["Referrer-Policy"] = "no-referrer"
    response.headers["Cross-Origin-Opener-Policy"] = "same-origin"
    response.headers["Cross-Origin-Resource-Policy"] = "same-origin"
    response.headers["Cache-Control"] = "no-store"
    return response


# -- messages -------------------------------------------------------------------------------


def fits(server: Any, data: str | bytes) -> bool:
    """Return whether a message is one that the controls of a page send.

    viser takes much more: requests for a share tunnel, files, values of any type for any attribute
    of a control. Whoever has the token may steer, and nothing else. A page with controls of other
    kinds adds them to `_takes`. The kinds of messages have no public name in viser, and neither has
    the way from a message to its control.

    Args:
        server: The viser server.
        data: What came over the WebSocket.
    """
    from viser import _messages as kinds

    taken = (
        kinds.ViewerCameraMessage,
        kinds.GuiUpdateMessage,
        kinds.CommandTriggerMessage,
        kinds.TransformControlsDragStartMessage,
        kinds.TransformControlsUpdateMessage,
        kinds.TransformControlsDragEndMessage,
    )
    try:
        message = _decoded(data, taken)
    except (ValueError, RecursionError):
        return False
    match message:
        case kinds.ViewerCameraMessage():
            return True
        case kinds.GuiUpdateMessage():
            control = server.gui._gui_input_handle_from_uuid.get(message.uuid)
            return set(message.updates) == {"value"} and _takes(control, message.updates["value"])
        case kinds.CommandTriggerMessage():
            command = server.gui._command_handle_from_uuid.get(message.uuid)
            return command is not None and not command.disabled
        case _:
            return _drags(server, message)


def _drags(server: Any, message: Any) -> bool:
    """Return whether a message drags a gizmo of the page that is shown to a pose in its reach."""
    gizmo = server.scene._handle_from_transform_controls_name.get(message.name)
    if gizmo is None or not gizmo.visible or message.owner:
        return False
    if not hasattr(message, "position"):  # it only takes the gizmo, or lets go of it
        return True
    limits = zip(gizmo.translation_limits, message.position, strict=True)
    length = math.hypot(*message.wxyz)
    return all(low <= x <= high for (low, high), x in limits) and abs(length - 1) < UNIT_TOLERANCE


def _decoded(data: str | bytes, kinds: tuple[type, ...]) -> Any:
    """Decode a message of one of some kinds.

    Raises:
        ValueError: If it is none of them, or its fields are not as they should be.
        RecursionError: If it is nested without end.
    """
    import msgspec

    if isinstance(data, str):
        raise ValueError("viser's messages are bytes")
    fields = msgspec.msgpack.decode(data, type=dict[str, Any])
    called = fields.pop("type", None)
    for kind in kinds:
        if called == kind.__name__ and set(fields) == {f.name for f in dataclasses.fields(kind)}:
            return msgspec.convert(fields, kind)
    raise ValueError(f"no message of kind {called!r} is taken")


def _takes(control: Any, value: Any) -> bool:
    """Return whether a control can be brought to a value by hand."""
    import viser

    match control:
        case viser.GuiSliderHandle():
            low, high = control.min - control.step, control.max + control.step  # rounded to steps
            return type(value) in (int, float) and low <= value <= high
        case viser.GuiCheckboxHandle():
            return isinstance(value, bool)
        case viser.GuiDropdownHandle():
            return value in control.options
        case viser.GuiButtonHandle():
            return value is True
        case _:
            return False

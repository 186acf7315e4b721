"""Whoever asks for a page: browsers' requests byte by byte, and clients that steer or mean harm."""

import socket
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

import msgspec
import numpy as np
import viser
import zstandard
from websockets.sync.client import connect

from layouts import single
from layouts.viewer import ShownCell
from layouts.viewer.page import CellPage
from layouts.viewer.server import serving
from robots import RobotDescriptor
from tests.layouts.small_robots import FOLDING, robot

PATIENCE = 60.0  # s
WEBSOCKET = {
    "Connection": "Upgrade",
    "Upgrade": "websocket",
    "Sec-WebSocket-Version": "13",
    "Sec-WebSocket-Key": "AAAAAAAAAAAAAAAAAAAAAA==",
    "Sec-WebSocket-Protocol": f"viser-v{viser.__version__}",
}
CAMERA = {
    "type": "ViewerCameraMessage",
    "wxyz": [1, 0, 0, 0],
    "position": [2.0, 0, 1],
    "fov": 1.0,
    "near": 0.01,
    "far": 1000,
    "image_height": 480,
    "image_width": 640,
    "look_at": [0, 0, 0],
    "up_direction": [0, 0, 1],
}


@dataclass(frozen=True)
class Site:
    """A page served in this process.

    Attributes:
        page: The page.
        server: Its viser server.
        address: What to open.
    """

    page: CellPage
    server: Any
    address: str

    @property
    def port(self) -> int:
        port = urlsplit(self.address).port
        assert port is not None
        return port

    @property
    def token(self) -> str:
        return parse_qs(urlsplit(self.address).query)["token"][0]


@contextmanager
def site(cell: ShownCell, host: str = "127.0.0.1") -> Iterator[Site]:
    with serving(host, 0, cell.title) as (server, address):
        page = CellPage(server, cell)
        page.tick(0.0)
        yield Site(page, server, address)


def small_cell(folder: Path, title: str = "cell", **changes: Any) -> ShownCell:
    """Return a cell of one small robot that touches itself, called ``arm``."""
    return ShownCell(title, single({"arm": named_robot(folder, **changes)}))


def named_robot(folder: Path, upper="upper", lower="lower", elbow="elbow") -> RobotDescriptor:
    """Describe a robot folded onto itself, whose links and joint have any names."""
    text = FOLDING
    for old, new in (("upper", upper), ("lower", lower), ("elbow", elbow)):
        quoted = "".join(letter if letter.isalnum() else f"&#{ord(letter)};" for letter in new)
        text = text.replace(f'name="{old}"', f'name="{quoted}"')
        text = text.replace(f'link="{old}"', f'link="{quoted}"')
    return robot(folder, text, ["shoulder", elbow], rest=[0.0, np.pi], tcp=lower)


def ask(
    port: int, headers: dict[str, str] | list[tuple[str, str]], path: str = "/", verb: str = "GET"
) -> tuple[int, bytes]:
    """Send a request as it is; return the status and the answer, as `talk` does."""
    pairs = headers.items() if isinstance(headers, dict) else headers
    lines = [f"{verb} {path} HTTP/1.1", *(f"{name}: {value}" for name, value in pairs), "", ""]
    return talk(port, "\r\n".join(lines).encode("latin-1"))


def talk(port: int, sent: bytes, *, ends: bool = False) -> tuple[int, bytes]:
    """Send bytes, and perhaps say that no more will follow.

    Returns:
        Status of the answer, 0 if there is none, and the answer; of a WebSocket, its beginning.
    """
    with socket.create_connection(("127.0.0.1", port), timeout=PATIENCE) as connection:
        connection.sendall(sent)
        if ends:
            connection.shutdown(socket.SHUT_WR)
        answer = b""
        while not answer.startswith(b"HTTP/1.1 101"):
            try:
                more = connection.recv(1 << 16)
            except ConnectionError:
                break
            if not more:
                break
            answer += more
    words = answer.split(b" ", 2)
    return (int(words[1]) if len(words) > 2 else 0), answer


class Guest:
    """A WebSocket client that speaks viser's protocol.

    Attributes:
        socket: The connection.
        received: Messages that have come, in order.
    """

    def __init__(self, address: str, **options: Any) -> None:
        options = {"max_size": None, "open_timeout": PATIENCE, "close_timeout": 1, **options}
        protocol = [f"viser-v{viser.__version__}"]
        where = address.replace("http://", "ws://", 1)
        self.socket = connect(where, subprotocols=protocol, **options)
        self.received: list[dict[str, Any]] = []

    def __enter__(self) -> "Guest":
        return self

    def __exit__(self, *_: object) -> None:
        self.socket.close()

    def send(self, message: object) -> None:
        self.socket.send(message if isinstance(message, bytes) else msgspec.msgpack.encode(message))

    def enter(self) -> None:
        """Do what a browser does first: say where its camera is."""
        self.send(CAMERA)

    def set(self, uuid: str, value: object) -> None:
        self.send({"type": "GuiUpdateMessage", "uuid": uuid, "updates": {"value": value}})

    def wait_for(self, kind: str, **fields: Any) -> dict[str, Any]:
        """Return the first message of a kind that has some fields, or properties, or updates."""
        seen = 0
        while True:
            for message in self.received[seen:]:
                shown = {**message, **message.get("props", {}), **message.get("updates", {})}
                if message["type"] == kind and fields.items() <= shown.items():
                    return message
            seen = len(self.received)
            self.listen()

    def listen(self) -> None:
        """Wait for more messages."""
        self.received += _messages(self.socket.recv(timeout=PATIENCE))


def _messages(frame: bytes | str) -> list[dict[str, Any]]:
    assert isinstance(frame, bytes)
    size = int.from_bytes(frame[8:16], "little")
    return msgspec.msgpack.decode(zstandard.decompress(frame[16 : 16 + size]))["messages"]

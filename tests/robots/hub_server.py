"""A small stand-in for the Hugging Face Hub on the loopback address, with faults on request."""

from __future__ import annotations

import hashlib
import json
import re
import socket
import struct
import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any, ClassVar
from urllib.parse import unquote, urlsplit

DATASET = "RoboVerseOrg/roboverse_data"
COMMIT = hashlib.sha1(b"the only commit").hexdigest()

# What a rule does to a request instead of answering it properly.
Fault = Callable[["Handler", bytes], None]


@dataclass
class Rule:
    """Applies a fault to the first `times` requests that match."""

    method: str
    part: str
    fault: Fault
    times: int


@dataclass
class HubServer:
    """One dataset with one commit; use it as a context manager."""

    handler: ClassVar[type[BaseHTTPRequestHandler]]

    files: dict[str, bytes]
    requests: list[tuple[str, str]] = field(default_factory=list)
    authorizations: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.dead = False
        self._rules: list[Rule] = []
        self._lock = threading.Lock()
        self._server = _Server(("127.0.0.1", 0), self.handler)
        self._server.hub = self

    def __enter__(self) -> HubServer:
        # The short poll lets a test end without waiting half a second for the server.
        serve = threading.Thread(target=self._server.serve_forever, args=(0.02,), daemon=True)
        serve.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._server.shutdown()
        self._server.server_close()

    @property
    def endpoint(self) -> str:
        return f"http://127.0.0.1:{self._server.server_address[1]}"

    def fail(self, method: str, part: str, fault: Fault, times: int = 1_000_000) -> None:
        """Make requests of a method whose path contains `part` go wrong."""
        self._rules.append(Rule(method, part, fault, times))

    def downloads(self) -> list[str]:
        """Paths of the files whose contents were asked for."""
        return [path for method, path in self.requests if method == "GET" and "/resolve/" in path]

    def fault_for(self, method: str, path: str) -> Fault | None:
        with self._lock:
            for rule in self._rules:
                if rule.method == method and rule.part in path and rule.times > 0:
                    rule.times -= 1
                    return rule.fault
        return None


class _Server(ThreadingHTTPServer):
    hub: HubServer
    daemon_threads = True

    def handle_error(self, request: object, client_address: object) -> None:
        """Say nothing: clients are killed and connections reset on purpose here."""


class Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    server: Any

    def do_GET(self) -> None:
        self._answer("GET")

    def do_HEAD(self) -> None:
        self._answer("HEAD")

    def log_message(self, *_: object) -> None:
        pass

    def _answer(self, method: str) -> None:
        hub: HubServer = self.server.hub
        if hub.dead:
            self.reset()
            return
        path = unquote(urlsplit(self.path).path)
        hub.requests.append((method, path))
        if "Authorization" in self.headers:
            hub.authorizations.append(path)
        found = re.fullmatch(rf"/datasets/{DATASET}/resolve/([^/]+)/(.+)", path)
        body = hub.files.get(found[2]) if found and found[1] in (COMMIT, "main") else None
        fault = hub.fault_for(method, path)
        if fault is not None:
            fault(self, body or b"")
        elif body is not None:
            self.send_file(body)
        elif found:
            self.send_error_code(404, "EntryNotFound")
        elif path == f"/api/datasets/{DATASET}/revision/main":
            self.send_json({"id": DATASET, "sha": COMMIT})
        elif path == f"/api/datasets/{DATASET}/tree/{COMMIT}":
            self.send_json([_tree_entry(p, data) for p, data in sorted(hub.files.items())])
        elif path.startswith(f"/api/datasets/{DATASET}/revision/"):
            self.send_error_code(404, "RevisionNotFound")
        else:
            self.send_error_code(404, "RepoNotFound")

    def send_json(self, value: object) -> None:
        self._send(200, json.dumps(value).encode(), {"Content-Type": "application/json"})

    def send_error_code(self, status: int, code: str | None) -> None:
        self._send(status, b"", {"X-Error-Code": code} if code else {})

    def send_file(self, body: bytes, etag_of: bytes | None = None) -> None:
        headers = _file_headers(body if etag_of is None else etag_of)
        start = re.fullmatch(r"bytes=(\d+)-", self.headers.get("Range", ""))
        if start is None:
            self._send(200, body, headers)
        else:
            first = int(start[1])
            headers["Content-Range"] = f"bytes {first}-{len(body) - 1}/{len(body)}"
            self._send(206, body[first:], headers)

    def send_half(self, body: bytes) -> None:
        """Announce the whole body and send half of it."""
        self._send_head(200, len(body), _file_headers(body))
        self.wfile.write(body[: len(body) // 2])
        self.wfile.flush()
        self.close_connection = True

    def send_page(self, status: int, text: str, headers: dict[str, str]) -> None:
        self._send(status, text.encode(), {"Content-Type": "text/html", **headers})

    def reset(self) -> None:
        """Drop the connection without a goodbye."""
        linger = struct.pack("ii", 1, 0)
        self.connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, linger)
        self.connection.close()
        self.close_connection = True

    def _send(self, status: int, body: bytes, headers: dict[str, str]) -> None:
        self._send_head(status, len(body), headers)
        if self.command != "HEAD":
            self.wfile.write(body)

    def _send_head(self, status: int, length: int, headers: dict[str, str]) -> None:
        self.send_response(status)
        for name, value in {"Content-Length": str(length), **headers}.items():
            self.send_header(name, value)
        self.end_headers()


HubServer.handler = Handler


def status(code: int, error_code: str | None = None) -> Fault:
    """Answer with an HTTP error."""
    return lambda handler, body: handler.send_error_code(code, error_code)


def corrupt(handler: Handler, body: bytes) -> None:
    """Send bytes of the right size, some of them wrong."""
    handler.send_file(bytes(byte ^ 1 for byte in body), etag_of=body)


def truncate(handler: Handler, body: bytes) -> None:
    """Send half of the file and close the connection."""
    handler.send_half(body)


def die(handler: Handler, body: bytes) -> None:
    """Send half of the file, reset the connection, and never answer anyone again."""
    handler.server.hub.dead = True
    handler.send_half(body)
    handler.reset()


def stall(reached: threading.Event) -> Fault:
    """Send half of the file, tell that this happened, and then nothing more."""

    def fault(handler: Handler, body: bytes) -> None:
        handler.send_half(body)
        reached.set()
        handler.rfile.read(1)  # returns when the client goes away

    return fault


def reset(handler: Handler, body: bytes) -> None:
    """Reset the connection without an answer."""
    handler.reset()


def nonsense(handler: Handler, body: bytes) -> None:
    """Answer in no HTTP."""
    handler.wfile.write(b"\x16\x03\x01 this is no HTTP\r\n\r\n")
    handler.close_connection = True


def login_page(handler: Handler, body: bytes) -> None:
    """Answer as a hotel's network does before one has paid."""
    handler.send_page(200, "<html><form>Welcome! Your room number?</form></html>", {})


def redirect(address: str) -> Fault:
    """Send the client somewhere else."""
    return lambda handler, body: handler.send_page(302, "", {"Location": address})


def headers(**changes: str) -> Fault:
    """Send the file with other headers than it should have."""
    changed = {name.replace("_", "-"): value for name, value in changes.items()}
    return lambda handler, body: handler._send(200, body, {**_file_headers(body), **changed})


def page(status: int, text: str) -> Fault:
    """Answer with some text, which an API is not to do."""
    return lambda handler, body: handler.send_page(status, text, {})


def _file_headers(body: bytes) -> dict[str, str]:
    return {
        "ETag": f'"{hashlib.sha1(body).hexdigest()}"',
        "X-Repo-Commit": COMMIT,
        "Accept-Ranges": "bytes",
        "Content-Type": "application/octet-stream",
    }


def _tree_entry(path: str, data: bytes) -> dict[str, object]:
    return {"type": "file", "path": path, "size": len(data), "oid": hashlib.sha1(data).hexdigest()}

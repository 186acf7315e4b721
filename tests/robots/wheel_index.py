"""A small package index on the loopback address that holds one wheel, with faults on request."""

from __future__ import annotations

import io
import threading
import zipfile
from collections.abc import Callable, Iterable, Mapping
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from unittest import mock

from robots.assets.manifest import AssetFile

WHEEL = "mani_skill-3.0.1-py3-none-any.whl"
INFO = "mani_skill-3.0.1.dist-info"

Fault = Callable[["_Handler", bytes], None]


def build_wheel(contents: Mapping[str, bytes]) -> bytes:
    """Return a wheel of mani_skill with some members, which pip accepts."""
    members = {
        f"{INFO}/METADATA": b"Metadata-Version: 2.1\nName: mani_skill\nVersion: 3.0.1\n",
        f"{INFO}/WHEEL": b"Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
        f"{INFO}/RECORD": b"",
        "mani_skill/__init__.py": b"raise ImportError('not meant to be imported')",
        **contents,
    }
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as wheel:
        for name, data in members.items():
            wheel.writestr(name, data)
    return archive.getvalue()


def members(files: Iterable[AssetFile], contents: Callable[[AssetFile], bytes]) -> dict[str, bytes]:
    """Return what a wheel holds of some robot files."""
    return {f"{f.origin.folder}/{f.path}": contents(f) for f in files}


class WheelIndex:
    """An index with one project; use it as a context manager."""

    def __init__(self, wheel: bytes, filename: str = WHEEL) -> None:
        self.wheel, self.filename = wheel, filename
        self.requests: list[str] = []
        self.page_fault: Fault | None = None
        self.wheel_fault: Fault | None = None
        self._server = _Server(("127.0.0.1", 0), _Handler)
        self._server.index = self

    def __enter__(self) -> WheelIndex:
        serve = threading.Thread(target=self._server.serve_forever, args=(0.02,), daemon=True)
        serve.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._server.shutdown()
        self._server.server_close()

    @property
    def downloads(self) -> int:
        """How often the wheel was asked for."""
        return sum(path.endswith(self.filename) for path in self.requests)

    def settings(self) -> dict[str, str]:
        """Return what makes pip use this index and nothing else."""
        return {
            "PIP_CONFIG_FILE": "/dev/null",
            "PIP_INDEX_URL": f"http://127.0.0.1:{self._server.server_address[1]}/simple",
            "PIP_TRUSTED_HOST": "127.0.0.1",
            "PIP_RETRIES": "0",
            "PIP_TIMEOUT": "20",
            "PIP_NO_CACHE_DIR": "1",
            "NO_PROXY": "127.0.0.1",
        }


class _Server(ThreadingHTTPServer):
    index: WheelIndex
    daemon_threads = True

    def handle_error(self, request: object, client_address: object) -> None:
        """Say nothing: clients are killed on purpose here."""


class _Handler(BaseHTTPRequestHandler):
    server: Any

    def do_GET(self) -> None:
        index: WheelIndex = self.server.index
        index.requests.append(self.path)
        is_wheel = self.path.endswith(index.filename)
        body = (
            index.wheel
            if is_wheel
            else f'<a href="/files/{index.filename}">{index.filename}</a>'.encode()
        )
        fault = index.wheel_fault if is_wheel else index.page_fault
        if fault is not None:
            fault(self, body)
        else:
            self.send(200, body, "application/octet-stream" if is_wheel else "text/html")

    def log_message(self, *_: object) -> None:
        pass

    def send(self, status: int, body: bytes, kind: str) -> None:
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)


def without_pip_settings() -> mock._patch_dict:
    """Forget the settings of pip that this process has; a context manager."""
    import os

    kept = {name: value for name, value in os.environ.items() if not name.startswith("PIP_")}
    return mock.patch.dict(os.environ, kept, clear=True)

"""The Hugging Face Hub as a source of robot files: without a token, and with a deadline."""

from __future__ import annotations

import json
import os
import queue
import subprocess
import sys
import tempfile
import threading
import time
from collections import deque
from collections.abc import Generator, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

from robots.asset_sources import Contents, SourceError
from robots.manifest import AssetFile
from robots.progress import download_bar

ENDPOINT_VARIABLE = "HF_ENDPOINT"
REVISION_VARIABLE = "ROBOT_LAYOUTS_HF_REVISION"
PATIENCE_VARIABLE = "ROBOT_LAYOUTS_HF_PATIENCE"

_DEFAULT_REVISION = "main"
_DEFAULT_PATIENCE = 8.0  # s; with starting and ending a process, under ten are lost
# The child sees the packages that this process sees, wherever it runs.
_BOOT = "import sys; _, job, *sys.path[:] = sys.argv; import robots.hub_client as c; c.main(job)"


class HubSource:
    """A dataset on the Hugging Face Hub, read without a token.

    Attributes:
        endpoint: Address of the Hub, ``HF_ENDPOINT`` at the time of construction; None is the
            public one.
        revision: Branch, tag or commit; a commit already in the Hub's cache asks nothing.
    """

    name = "hf"

    def __init__(self, *, revision: str | None = None, patience: float | None = None) -> None:
        """Take settings from arguments, else from the environment.

        Args:
            revision: Else ``ROBOT_LAYOUTS_HF_REVISION``, else ``main``.
            patience: How long nothing may arrive before the Hub is given up (s), else
                ``ROBOT_LAYOUTS_HF_PATIENCE``, else 8.

        """
        self.endpoint = os.environ.get(ENDPOINT_VARIABLE) or None
        self.revision = revision or os.environ.get(REVISION_VARIABLE) or _DEFAULT_REVISION
        self._patience = patience

    @property
    def title(self) -> str:
        """Name in messages."""
        return f"Hugging Face Hub at {self.endpoint}" if self.endpoint else "Hugging Face Hub"

    def fetch(self, files: Sequence[AssetFile], scratch: Path, *, again: bool) -> Contents:
        """Yield files as they arrive; see `robots.asset_sources.AssetSource`."""
        for dataset in sorted({file.origin.hub_dataset for file in files}):
            wanted = {_hub_path(f): f for f in files if f.origin.hub_dataset == dataset}
            job = {
                "dataset": dataset,
                "revision": self.revision,
                "endpoint": self.endpoint,
                "files": list(wanted),
                "again": again,
            }
            yield from self._download(job, wanted, scratch)

    def _download(
        self, job: dict[str, Any], wanted: dict[str, AssetFile], scratch: Path
    ) -> Contents:
        absent: list[str] = []
        total = sum(file.bytes for file in wanted.values())
        with download_bar(job["dataset"], total) as advance:
            for message in self._messages(job, scratch):
                if "bytes" in message:
                    advance(message["bytes"])
                elif "file" in message:
                    yield wanted[message["file"]], _read(message["at"])
                elif "absent" in message:
                    absent.append(message["absent"])
                elif "failed" in message:
                    raise SourceError(f"{job['dataset']} at {job['revision']}: {message['failed']}")
        if absent:
            raise SourceError(
                f"{job['dataset']} at {job['revision']} lacks {len(absent)} files (404):"
                f" {', '.join(sorted(absent))}"
            )

    def _messages(self, job: dict[str, Any], scratch: Path) -> Iterator[dict[str, Any]]:
        """Yield what the client tells, until it is done or out of patience."""
        warnings: deque[str] = deque(maxlen=2)
        patience = _patience_from_environment() if self._patience is None else self._patience
        with tempfile.TemporaryFile(dir=scratch) as errors, _client(job, errors) as lines:
            deadline = time.monotonic() + patience
            while True:
                try:
                    line = lines.get(timeout=max(0.0, deadline - time.monotonic()))
                except queue.Empty:
                    raise SourceError(
                        f"nothing arrived for {patience:g} s{_quote(warnings)}"
                        f"; {PATIENCE_VARIABLE} sets how long to wait"
                    ) from None
                if line is None:
                    errors.seek(0)
                    said = errors.read().decode(errors="replace").strip().split("\n")[-1]
                    raise SourceError(f"the client ended unexpectedly{_quote(warnings)}: {said}")
                message = json.loads(line)
                if "done" in message:
                    return
                if "warning" in message:
                    warnings.append(message["warning"])
                else:
                    deadline = time.monotonic() + patience
                    yield message


@contextmanager
def _client(job: dict[str, Any], errors: IO[bytes]) -> Generator[queue.Queue[str | None]]:
    """Run the client process; its lines come in a queue, None at the end."""
    process = subprocess.Popen(
        [sys.executable, "-c", _BOOT, json.dumps(job), *sys.path],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=errors,
        env={**os.environ, "HF_HUB_DISABLE_TELEMETRY": "1"},
        text=True,
        encoding="utf-8",
    )
    lines: queue.Queue[str | None] = queue.Queue()
    with process:
        pump = threading.Thread(target=_pump, args=(process.stdout, lines), daemon=True)
        pump.start()
        try:
            yield lines
        finally:
            process.kill()
            pump.join()


def _quote(warnings: Iterable[str]) -> str:
    text = "; ".join(warnings)
    return f" (it warned: {text})" if text else ""


def _pump(stream: IO[str], lines: queue.Queue[str | None]) -> None:
    for line in stream:
        lines.put(line)
    lines.put(None)


def _read(path: str) -> bytes:
    try:
        return Path(path).read_bytes()
    except OSError as error:
        raise SourceError(f"cannot read {path} in the Hub's cache: {error.strerror}") from error


def _hub_path(file: AssetFile) -> str:
    return f"{file.origin.hub_folder}/{file.path}"


def _patience_from_environment() -> float:
    text = os.environ.get(PATIENCE_VARIABLE) or str(_DEFAULT_PATIENCE)
    try:
        return float(text)
    except ValueError:
        raise SourceError(f"{PATIENCE_VARIABLE} is {text!r}; it is a number of seconds") from None

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
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import IO, Any

from robots.assets.manifest import AssetFile
from robots.assets.packages import SourceError
from robots.assets.progress import download_bar, listing
from robots.assets.sources import Contents, read_bounded
from robots.common.child_process import end, running
from robots.common.errors import UnreadableFileError

ENDPOINT_VARIABLE = "HF_ENDPOINT"
REVISION_VARIABLE = "ROBOT_LAYOUTS_HF_REVISION"
PATIENCE_VARIABLE = "ROBOT_LAYOUTS_HF_PATIENCE"

_DEFAULT_REVISION = "main"
_DEFAULT_PATIENCE = 8.0  # s; with starting and ending a process, under ten are lost
# The child sees the packages that this process sees, wherever it runs.
_BOOT = "import sys; _, *sys.path[:] = sys.argv; import robots.assets.hub_client as c; c.main()"
_LARGEST_PATIENCE = 86400.0  # s
_LEAST_RATE = 1000  # bytes per second; slower ones would hold a fetch for hours


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
            patience: How long next to nothing may arrive before the Hub is given up (s), else
                ``ROBOT_LAYOUTS_HF_PATIENCE``, else 8.
        """
        self.endpoint = os.environ.get(ENDPOINT_VARIABLE) or None
        self.revision = revision or os.environ.get(REVISION_VARIABLE) or _DEFAULT_REVISION
        self._patience = patience

    @property
    def title(self) -> str:
        """Name in messages."""
        return f"Hugging Face Hub at {self.endpoint}" if self.endpoint else "Hugging Face Hub"

    def holds(self, file: AssetFile) -> bool:
        """Tell whether a dataset on the Hub has a copy of a file."""
        return file.origin.hub_dataset is not None

    def fetch(
        self, files: Sequence[AssetFile], scratch: Path, *, again: bool, trust: bool
    ) -> Contents:
        """Yield files as they arrive; see `robots.assets.sources.AssetSource`."""
        for dataset in sorted({f.origin.hub_dataset for f in files if f.origin.hub_dataset}):
            wanted = {_hub_path(f): f for f in files if f.origin.hub_dataset == dataset}
            job = {
                "dataset": dataset,
                "revision": self.revision,
                "endpoint": self.endpoint,
                "files": {path: file.limit(trust=trust) for path, file in wanted.items()},
                "again": again,
            }
            yield from self._download(job, wanted, scratch)

    def _download(
        self, job: dict[str, Any], wanted: dict[str, AssetFile], scratch: Path
    ) -> Contents:
        dataset = f"{job['dataset']} at {job['revision']:.80}"
        absent: list[str] = []
        total = sum(file.bytes for file in wanted.values())
        with download_bar(job["dataset"], total) as advance:
            for message in self._messages(job, scratch):
                if "bytes" in message:
                    advance(message["bytes"])
                elif "file" in message:
                    path = message["file"]
                    yield wanted[path], _read(Path(message["at"]), job["files"][path], job["again"])
                elif "absent" in message:
                    absent.append(message["absent"])
                elif "too_large" in message:
                    yield wanted[message["too_large"]], None
                elif "failed" in message:
                    raise SourceError(f"{dataset}: {message['failed']}")
        if absent:
            raise SourceError(
                f"{dataset} lacks {len(absent)} files (404): {listing(sorted(absent))}"
            )

    def _messages(self, job: dict[str, Any], scratch: Path) -> Iterator[dict[str, Any]]:
        """Yield what the client reports, until it is done or out of patience."""
        warnings: deque[str] = deque(maxlen=2)
        patience = _patience_from_environment() if self._patience is None else self._patience
        with _client(job, scratch) as (lines, errors):
            deadline, arrived = time.monotonic() + patience, 0
            while True:
                try:
                    line = lines.get(timeout=max(0.0, deadline - time.monotonic()))
                except queue.Empty:
                    raise SourceError(
                        f"{'next to ' if arrived else ''}nothing arrived for {patience:g} s"
                        f"{_quote(warnings)}; {PATIENCE_VARIABLE} sets how long to wait"
                    ) from None
                if line is None:
                    errors.seek(0)
                    last = errors.read().decode(errors="replace").strip().split("\n")[-1]
                    last = last or "it was killed, or has no memory left"
                    raise SourceError(f"the client ended unexpectedly{_quote(warnings)}: {last}")
                message = json.loads(line)
                if "done" in message:
                    return
                if "warning" in message:
                    warnings.append(message["warning"])
                    continue
                arrived += max(0, message.get("bytes", 0))
                if "bytes" not in message or arrived >= _LEAST_RATE * patience:
                    deadline, arrived = time.monotonic() + patience, 0
                yield message


@contextmanager
def _client(
    job: dict[str, Any], scratch: Path
) -> Generator[tuple[queue.Queue[str | None], IO[bytes]]]:
    """Run the client process; its lines come in a queue, None at the end, its errors in a file.

    Raises:
        SourceError: If no process can be started.
    """
    environment = {**os.environ, "HF_HUB_DISABLE_TELEMETRY": "1", "HF_HUB_DISABLE_XET": "1"}
    lines: queue.Queue[str | None] = queue.Queue()
    with ExitStack() as stack:
        try:
            errors = stack.enter_context(tempfile.TemporaryFile(dir=scratch))
            work = stack.enter_context(tempfile.TemporaryFile(dir=scratch))
            work.write(json.dumps(job).encode())
            work.seek(0)
            process = stack.enter_context(
                running(
                    [sys.executable, "-c", _BOOT, *sys.path],
                    stdin=work,
                    stdout=subprocess.PIPE,
                    stderr=errors,
                    env=environment,
                )
            )
        except OSError as error:
            raise SourceError(f"cannot start the Hub's client: {error.strerror}") from error
        pump = threading.Thread(target=_pump, args=(process.stdout, lines), daemon=True)
        pump.start()
        try:
            yield lines, errors
        finally:
            end(process)
            pump.join()


def _quote(warnings: Iterable[str]) -> str:
    text = "; ".join(warnings)
    return f" (it warned: {text})" if text else ""


def _pump(stream: IO[bytes], lines: queue.Queue[str | None]) -> None:
    for line in stream:
        if line.endswith(b"\n"):  # else it was killed within the line
            lines.put(line.decode())
    lines.put(None)


def _read(path: Path, limit: int, again: bool) -> bytes | None:
    try:
        return read_bounded(path, limit)
    except UnreadableFileError as error:
        if not again:  # the client writes it anew
            return None
        raise SourceError(f"cannot read {path} in the Hub's cache: {error.strerror}") from error


def _hub_path(file: AssetFile) -> str:
    return f"{file.origin.hub_folder}/{file.path}"


def _patience_from_environment() -> float:
    text = os.environ.get(PATIENCE_VARIABLE) or str(_DEFAULT_PATIENCE)
    try:
        patience = float(text)
    except ValueError:
        patience = 0.0
    if not 0 < patience <= _LARGEST_PATIENCE:
        raise SourceError(
            f"{PATIENCE_VARIABLE} is {text!r}; it is a number of seconds, at most a day"
        )
    return patience

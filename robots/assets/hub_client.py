"""Downloads files from a Hugging Face dataset, in a process of its own that `hub_source` can end.

The Hub's client waits without limit for some answers and blocks in name look-ups, which no thread
can be freed from; a process can. It reads a job from stdin and answers with JSON lines.
"""

from __future__ import annotations

import json
import logging
import os
import sys
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, as_completed
from typing import Any, TextIO, TypeVar

_ATTEMPTS = 3
_FIRST_WAIT = 0.3  # s, tripled after each attempt
_DOWNLOADS_AT_ONCE = 8
_CHUNK_SIZE = 2**13  # bytes
_FINAL_STATUSES = {
    401: "access refused (401): the dataset is private, gated or gone, and no token is sent",
    403: "access refused (403): the dataset is gated or private, and no token is sent",
    404: "not found (404)",
}

Result = TypeVar("Result")


def main() -> None:
    """Do the job on stdin, and report on stdout how it goes.

    The job is JSON: ``dataset``, ``revision``, ``endpoint``, ``files`` (the most bytes of each, by
    path) and ``again`` (whether to pass by the Hub's cache).
    """
    channel = _Channel(os.fdopen(os.dup(1), "w", encoding="utf-8"))
    os.dup2(2, 1)  # whatever else prints must not disturb the channel
    try:
        _download_all(json.load(sys.stdin), channel)
    except Exception as error:  # the border of the process: the client may raise anything
        channel.tell(failed=_reason(error))
    channel.tell(done=True)
    os._exit(0)  # downloads still running in threads are of no use any more


class _TooLargeError(Exception):
    """A file is larger than it may be."""


class _HostileAnswerError(Exception):
    """A server answers with what a Hub never says."""


class _Channel:
    """JSON lines to the parent process, from any thread."""

    def __init__(self, stream: TextIO) -> None:
        self._stream, self._lock = stream, threading.Lock()

    def tell(self, **message: object) -> None:
        with self._lock:
            print(json.dumps(message), file=self._stream, flush=True)


class _WarningTeller(logging.Handler):
    """Passes on what the client says about its own retries."""

    def __init__(self, channel: _Channel) -> None:
        super().__init__(logging.WARNING)
        self._channel = channel

    def emit(self, record: logging.LogRecord) -> None:
        self._channel.tell(warning=" ".join(record.getMessage().split()))


def _download_all(job: dict[str, Any], channel: _Channel) -> None:
    try:
        from huggingface_hub import HfApi, constants, set_client_factory
        from huggingface_hub.utils._http import default_client_factory
    except ImportError as error:
        channel.tell(failed=f"{error} (pip install huggingface_hub)")
        return
    # Else nothing is heard of a slow download until ten megabytes are there.
    constants.DOWNLOAD_CHUNK_SIZE = _CHUNK_SIZE
    logger = logging.getLogger("huggingface_hub")
    logger.handlers, logger.propagate = [_WarningTeller(channel)], False
    set_client_factory(lambda: _careful(default_client_factory()))
    revision = job["revision"]
    if not _is_commit(revision):
        api = HfApi(endpoint=job["endpoint"], token=False)
        revision = _with_retries(
            lambda: api.dataset_info(job["dataset"], revision=revision, expand=["sha"]).sha,
            channel,
        )
        if not _is_commit(str(revision)):
            raise _HostileAnswerError(f"the server names no commit, but {revision!r}")
    with ThreadPoolExecutor(_DOWNLOADS_AT_ONCE) as pool:
        downloads = {
            pool.submit(_download, job, path, str(revision), channel): path for path in job["files"]
        }
        for download in as_completed(downloads):
            _tell_outcome(download.result, downloads[download], channel)


def _careful(client: Any) -> Any:
    """Return the HTTP client, which from now on refuses names that lead out of the Hub's cache.

    The Hub's client calls files of its cache by what these headers say, whatever that is.
    """
    client.event_hooks["response"].append(_refuse_paths)
    return client


def _refuse_paths(response: Any) -> None:
    for header in ("etag", "x-linked-etag", "x-repo-commit"):
        value = response.headers.get(header, "").lstrip("W/").strip('"')
        if value.startswith(".") or "/" in value or "\\" in value:
            raise _HostileAnswerError(f"the server sends {header}: {value[:100]!r}")


def _tell_outcome(result: Callable[[], str], path: str, channel: _Channel) -> None:
    try:
        channel.tell(file=path, at=result())
    except _TooLargeError:
        channel.tell(too_large=path)
    except Exception as error:  # the border of the process, as in main
        if _status(error) == 404:
            channel.tell(absent=path)
            return
        channel.tell(failed=f"{path}: {_reason(error)}")
        channel.tell(done=True)
        os._exit(0)


def _download(job: dict[str, Any], path: str, revision: str, channel: _Channel) -> str:
    from huggingface_hub import hf_hub_download

    return _with_retries(
        lambda: hf_hub_download(
            job["dataset"],
            path,
            repo_type="dataset",
            revision=revision,
            endpoint=job["endpoint"],
            token=False,
            force_download=job["again"],
            tqdm_class=_counter(channel, job["files"][path]),
        ),
        channel,
    )


def _counter(channel: _Channel, limit: int) -> type[Any]:
    """Return a progress bar that shows nothing, passes on how many bytes arrived, and bounds them.

    Some servers send no length, or a wrong one: this sees every chunk before it is written.
    """
    from tqdm import tqdm

    class Counter(tqdm):  # pyright: ignore[reportMissingTypeArgument]
        def __init__(self, *args: Any, **settings: Any) -> None:  # noqa: ANN401
            self._arrived = int(settings.get("initial") or 0)
            super().__init__(*args, **{**settings, "disable": True})

        def update(self, n: float | None = 1) -> None:
            self._arrived += int(n or 0)
            if self._arrived > limit:
                raise _TooLargeError
            channel.tell(bytes=int(n or 0))

    return Counter


def _with_retries(call: Callable[[], Result], channel: _Channel) -> Result:
    wait = _FIRST_WAIT
    for _ in range(_ATTEMPTS - 1):
        try:
            return call()
        except (_TooLargeError, _HostileAnswerError):
            raise
        except Exception as error:  # the client lets its HTTP library's errors through
            if _status(error) in _FINAL_STATUSES or isinstance(error, OSError) and error.errno:
                raise
            channel.tell(warning=_reason(error))
        time.sleep(wait)
        wait *= 3
    return call()


def _status(error: BaseException | None) -> int | None:
    while error is not None:
        status = getattr(getattr(error, "response", None), "status_code", None)
        if status is not None:
            return int(status)
        error = error.__cause__
    return None


def _reason(error: BaseException) -> str:
    status = _status(error)
    if status is not None:
        return _FINAL_STATUSES.get(status, f"HTTP error {status}")
    if isinstance(error, OSError) and error.errno:
        return f"the Hub's cache cannot be written: {error.strerror}: {error.filename}"
    if type(error).__name__ == "LocalEntryNotFoundError" and error.__cause__ is not None:
        return _reason(error.__cause__)
    if isinstance(error, json.JSONDecodeError):
        return "the server answers with something that is no JSON, such as a login page"
    if isinstance(error, _HostileAnswerError):
        return f"{error}, which no Hub does"
    first_line = str(error).strip().split("\n")[0]
    return f"{type(error).__name__}: {first_line}"


def _is_commit(revision: str) -> bool:
    return len(revision) == 40 and set(revision) <= set("0123456789abcdef")

"""Recordings and policies on the Hugging Face Hub: ``hub:OWNER/NAME[@REVISION]``."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from functools import cache
from os import PathLike
from pathlib import Path

from robot_layouts.core.commands import notice
from robot_layouts.data.reading.json_files import FILE
from robots import RobotLayoutsError
from robots.assets.sources import ENDPOINT_VARIABLE, silent_bar, why

PREFIX = "hub:"
CERTIFICATE = "certificate.json"
PARTS = ("trajectory*.h5", "trajectory*.json", CERTIFICATE)  # files of a recording
_NAME = re.compile(r"([\w.-]+/[\w.-]+)(?:@([\w./-]+))?", re.ASCII)
_STATUSES = {
    401: "access refused (401): it is private, gated or not there; `hf auth login` keeps a token",
    403: "access refused (403): the token may not do this",
    404: "not found (404)",
    413: "the data set is larger than the Hub takes (413)",
}


class HubError(RobotLayoutsError, OSError):
    """Something that cannot be read from the Hugging Face Hub, or pushed to it."""


def on_hub(path: str | PathLike[str]) -> bool:
    """Return whether the name of a recording or a policy is one on the Hub."""
    return os.fspath(path).startswith(PREFIX)


def repository_and_revision(name: str) -> tuple[str, str | None]:
    """Return both parts of ``OWNER/NAME[@REVISION]``; ``hub:`` may stand before it.

    Raises:
        HubError: If it is no such name.
    """
    found = _NAME.fullmatch(name.removeprefix(PREFIX))
    if found is None:
        raise HubError(
            f"{name!r} is no name on the Hub; it must be OWNER/NAME, and where something is read"
            " hub:OWNER/NAME or hub:OWNER/NAME@REVISION"
        )
    return found[1], found[2]


def local_place(path: str | PathLike[str]) -> Path:
    """Return where a recording is on this machine; one on the Hub is downloaded.

    It is kept in the Hub's own cache, and only what is missing there is downloaded. A process reads
    the commit that it found first, whatever is pushed meanwhile.

    Raises:
        HubError: If it cannot be downloaded, or is no recording.
    """
    if not on_hub(path):
        return Path(path)
    return _downloaded(os.fspath(path), os.environ.get(ENDPOINT_VARIABLE))


@cache
def _downloaded(name: str, endpoint: str | None) -> Path:
    folder = _snapshot(name, "dataset", PARTS, endpoint)
    if not (place := folder / FILE).is_file():
        raise HubError(
            f"{name} holds no recording, whose first file is {FILE}; of an export, only tools for"
            " its format read the episodes"
        )
    return place.parent


def downloaded_policy(name: str, parts: Sequence[str]) -> Path:
    """Download files of a policy, and return the folder, which is called after the commit.

    Args:
        name: ``hub:OWNER/NAME[@REVISION]``.
        parts: Names of the files.

    Raises:
        HubError: If it cannot be downloaded.
    """
    return _snapshot(name, "model", parts, os.environ.get(ENDPOINT_VARIABLE))


def _snapshot(name: str, kind: str, parts: Sequence[str], endpoint: str | None) -> Path:
    """Download files of a repository into the Hub's own cache, and return their folder there."""
    from huggingface_hub import snapshot_download

    repository, revision = repository_and_revision(name)
    notice(f"reading {name}")
    try:
        folder = snapshot_download(
            repository,
            repo_type=kind,
            revision=revision,
            endpoint=endpoint,
            allow_patterns=list(parts),
            tqdm_class=silent_bar(),
        )
    except Exception as error:  # the client lets its HTTP library's errors through
        raise HubError(f"cannot read {name}: {reason(error)}") from None
    return Path(folder)


def reason(error: BaseException) -> str:
    """Return in one line why the Hub's client failed, without the user's token."""
    from huggingface_hub import get_token

    token, words = get_token(), why(error, _STATUSES)
    return words.replace(token, "…") if token else words

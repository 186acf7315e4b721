"""A folder that appears when everything in it is written, or not at all."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from robot_layouts.core.writing import PARTIAL, writing_errors, written_whole
from robot_layouts.data.recording.disk import claim
from robots import RecordingError


@contextmanager
def new_folder(path: Path) -> Generator[Path]:
    """Make a folder whose content is complete.

    What exports to the same folder left behind when they were killed is removed first.

    Args:
        path: The folder; it may be there already if it is empty; see `refuse_used`.

    Yields:
        A folder beside it to write into, which takes its place at the end.

    Raises:
        RecordingError: If the folder cannot be written.
    """
    partial = path.with_name(f".{path.name}.{os.getpid()}{PARTIAL}")
    with writing_errors(path, RecordingError):
        partial.parent.mkdir(parents=True, exist_ok=True)
        _remove_abandoned(path)
        lock = claim(partial)
        if lock is None:
            raise RecordingError(f"another process is writing {partial}")
        try:
            with written_whole(path, RecordingError, partial=partial):
                yield partial
        finally:
            os.close(lock)


def refuse_used(path: Path) -> None:
    """Refuse a path at which something is already, other than an empty folder.

    Raises:
        RecordingError: If so.
    """
    with writing_errors(path, RecordingError):
        try:
            used = any(path.iterdir())
        except FileNotFoundError:
            return
        except NotADirectoryError as error:
            raise RecordingError(f"{path} is a file; a folder's name is needed") from error
    if used:
        raise RecordingError(f"{path} is not empty; choose another folder, or empty it")


def _remove_abandoned(path: Path) -> None:
    """Remove the unfinished folders of processes that have ended; the others lock theirs."""
    unfinished = re.compile(rf"\.{re.escape(path.name)}\.[0-9]+\.partial")
    for entry in list(os.scandir(path.parent)):
        if unfinished.fullmatch(entry.name) and entry.is_dir(follow_symlinks=False):
            lock = claim(Path(entry.path), certain=True)
            if lock is not None:
                shutil.rmtree(entry.path, ignore_errors=True)
                os.close(lock)

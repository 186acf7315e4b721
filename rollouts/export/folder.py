"""A folder that appears when everything in it is written, or not at all."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from robots import RecordingError, RobotLayoutsError
from rollouts.recording.disk import claim


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
    partial = path.with_name(f".{path.name}.{os.getpid()}.partial")
    try:
        partial.parent.mkdir(parents=True, exist_ok=True)
        _remove_abandoned(path)
        right = claim(partial)
        if right is None:
            raise RecordingError(f"another process is writing {partial}")
        try:
            yield partial
            os.replace(partial, path)
        finally:
            shutil.rmtree(partial, ignore_errors=True)
            os.close(right)
    except RobotLayoutsError:
        raise
    except OSError as error:
        raise RecordingError(f"cannot write {path}: {_reason(error)}") from error


def refuse_used(path: Path) -> None:
    """Refuse a path at which something is already, other than an empty folder.

    Raises:
        RecordingError: If so.
    """
    try:
        used = any(path.iterdir())
    except FileNotFoundError:
        return
    except NotADirectoryError as error:
        raise RecordingError(f"{path} is a file; a folder's name is needed") from error
    except OSError as error:
        raise RecordingError(f"cannot write {path}: {_reason(error)}") from error
    if used:
        raise RecordingError(f"{path} is not empty; choose another folder, or empty it")


def _remove_abandoned(path: Path) -> None:
    """Remove the unfinished folders of processes that are no more; those at work own theirs."""
    unfinished = re.compile(rf"\.{re.escape(path.name)}\.[0-9]+\.partial")
    for entry in list(os.scandir(path.parent)):
        if unfinished.fullmatch(entry.name) and entry.is_dir(follow_symlinks=False):
            right = claim(Path(entry.path), certain=True)
            if right is not None:
                shutil.rmtree(entry.path, ignore_errors=True)
                os.close(right)


def _reason(error: OSError) -> str:
    """Return why in a few words; HDF5 and Arrow use many."""
    return os.strerror(error.errno) if error.errno else str(error)

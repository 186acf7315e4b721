"""A folder that appears when everything in it is written, or not at all."""

from __future__ import annotations

import os
import shutil
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from robots import RecordingError, RobotLayoutsError


@contextmanager
def new_folder(path: Path) -> Generator[Path]:
    """Make a folder whose content is complete.

    Args:
        path: The folder; it may be there already if it is empty; see `refuse_used`.

    Yields:
        A folder beside it to write into, which takes its place at the end.

    Raises:
        RecordingError: If the folder cannot be written.
    """
    partial = path.with_name(f".{path.name}.{os.getpid()}.partial")
    try:
        partial.mkdir(parents=True)
        yield partial
        os.replace(partial, path)
    except RobotLayoutsError:
        raise
    except OSError as error:
        raise RecordingError(f"cannot write {path}: {_reason(error)}") from error
    finally:
        shutil.rmtree(partial, ignore_errors=True)


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


def _reason(error: OSError) -> str:
    """Return why in a few words; HDF5 and Arrow use many."""
    return os.strerror(error.errno) if error.errno else str(error)

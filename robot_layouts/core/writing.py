"""Files and folders that appear whole or not at all, and what the disk refuses, in words.

New files for a user to go on with are never written over what is there. What several writers of
recordings and data sets need of the disk is here, too.
"""

from __future__ import annotations

import errno
import os
import re
import shutil
import sys
from collections.abc import Generator, Mapping
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from importlib.machinery import PathFinder
from io import FileIO
from itertools import count
from keyword import iskeyword
from pathlib import Path
from typing import Any

from robot_layouts.core.errors import RecordingError, RobotLayoutsError, UnwritableFileError
from robot_layouts.core.operating_system import lock, open_folder
from robot_layouts.core.own_packages import PACKAGES

PARTIAL = ".partial"  # in the names of files and folders that are not whole yet

_numbers = count()


@contextmanager
def written_whole(
    path: str | os.PathLike[str],
    error: type[RobotLayoutsError] | None = UnwritableFileError,
    *,
    partial: Path | None = None,
    parents: bool = True,
    sync: bool = False,
    over: bool = False,
) -> Generator[Path]:
    """Give a path beside the target to write to; it takes the target's place at the end.

    It may become a file, or a folder, which takes the place of nothing or of an empty folder.
    After an error the target is as it was, and nothing else is left.

    Args:
        path: The target.
        error: Raised if the disk refuses; None leaves the operating system's errors as they are.
        partial: The path to write to, on the same file system; left out, a path of its own.
        parents: Whether to make the folder that it is in.
        sync: Whether to wait until a file is on the disk before it takes the target's place.
        over: Whether a folder may also take the place of one that holds something.

    Raises:
        RobotLayoutsError: The given error, if it cannot be written.
        OSError: If so, and no error is given.
    """
    target = Path(path)
    partial = partial or _beside(target)
    with writing_errors(target, error) if error else nullcontext():
        if "\0" in str(target):
            raise OSError(errno.EINVAL, "a null character is in its name")
        if parents:
            _make_parent(target)
        try:
            yield partial
            if sync:
                _sync(partial)
            replaced = _replace(partial, target, over)
        except BaseException:
            remove(partial)
            raise
    for folder in replaced:
        remove(folder)


def write_whole(
    path: str | os.PathLike[str],
    content: str | bytes,
    error: type[RobotLayoutsError] = UnwritableFileError,
    *,
    parents: bool = True,
) -> None:
    """Write a file, text as UTF-8; see `written_whole`.

    Raises:
        RobotLayoutsError: The given error, if it cannot be written.
    """
    data = content.encode() if isinstance(content, str) else content
    with written_whole(path, error, parents=parents) as partial:
        partial.write_bytes(data)


@contextmanager
def writing_errors(
    path: str | os.PathLike[str],
    error: type[RobotLayoutsError] = UnwritableFileError,
    kinds: tuple[type[Exception], ...] = (OSError,),
) -> Generator[None]:
    """Turn what the disk refuses into one of our errors, which names the path.

    Args:
        path: What is written.
        error: The error to raise.
        kinds: What a refusal looks like; our own errors are left as they are.
    """
    try:
        yield
    except RobotLayoutsError:
        raise
    except kinds as refusal:
        raise error(f"cannot write {os.fspath(path)}: {_reason(refusal)}") from refusal


def remove(path: Path) -> None:
    """Remove a file or a folder, if it is there and the disk lets it go."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        with suppress(OSError):
            path.unlink()


def check_module_name(module: str, better: str, error: type[RobotLayoutsError]) -> None:
    """Refuse to write a module that cannot be imported, or hides one that others import.

    Args:
        module: Its name.
        better: A name that the error proposes.
        error: Raised if so.
    """
    if iskeyword(module):
        what = "a keyword of Python"
    elif module in PACKAGES:
        what = "a package of this library"
    elif module in sys.stdlib_module_names:
        what = "a module of Python"
    elif _is_installed(module):
        what = "an installed module"
    else:
        return
    raise error(
        f"the file would be {module}.py, but {module!r} is {what}; choose another name, such as"
        f" {better}"
    )


def _is_installed(module: str) -> bool:
    here = os.path.realpath(os.curdir)  # whose own files are none of an installation
    elsewhere = [entry for entry in sys.path if os.path.realpath(entry) != here]
    return PathFinder.find_spec(module, elsewhere) is not None


def write_new(folder: Path, texts: Mapping[str, str]) -> list[Path]:
    """Write files that must not be there yet: all of them, or none.

    Args:
        folder: Where; it is made if need be.
        texts: Text by file name.

    Returns:
        Their paths.

    Raises:
        UnwritableFileError: If one is there already, or cannot be written.
    """
    written: list[Path] = []
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in texts.items():
            with (folder / name).open("x", encoding="utf-8") as file:
                written.append(folder / name)
                file.write(text)
    except OSError as error:
        for path in written:
            with suppress(OSError):
                path.unlink()
        if isinstance(error, FileExistsError):
            name = error.filename or folder
            words = f"{name} is there already, and is not overwritten; nothing was written"
            raise UnwritableFileError(words) from error
        raise UnwritableFileError(f"cannot write into {folder}: {error.strerror}") from error
    return written


def _beside(target: Path) -> Path:
    return target.with_name(f"{target.name}.{os.getpid()}.{next(_numbers)}{PARTIAL}")


def _replace(partial: Path, target: Path, over: bool) -> list[Path]:
    """Put a file or folder in its place, which others may replace at the same moment.

    Returns:
        Where the folders are now that were in its place.
    """
    aside: list[Path] = []
    while True:
        try:
            os.replace(partial, target)
            return aside
        except OSError as refusal:
            is_link = target.is_symlink() and target.is_dir()
            if not over or not (is_link or refusal.errno in (errno.ENOTEMPTY, errno.EEXIST)):
                raise
        with suppress(FileNotFoundError):  # another one has just moved it
            os.replace(target, old := _beside(target))
            aside.append(old)


def _make_parent(target: Path) -> None:
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError) as error:
        raise NotADirectoryError(error.errno, f"{target.parent} is not a folder") from error


def _sync(path: Path) -> None:
    with path.open("rb") as stream:
        os.fsync(stream.fileno())


def _reason(refusal: Exception) -> str:
    """Return what the operating system said, out of the page that HDF5 or Arrow make of it."""
    number = re.search(r"errno = (\d+)", str(refusal))
    if number is not None:
        return os.strerror(int(number[1]))
    return (refusal.strerror if isinstance(refusal, OSError) else None) or str(refusal)


def disk_errors(path: Path) -> AbstractContextManager[None]:
    """Turn what the disk refuses into one of our errors; h5py says it in several ways."""
    return writing_errors(path, RecordingError, (OSError, RuntimeError, ValueError))


def claim(folder: Path, *, certain: bool = False) -> int | None:
    """Make a folder, unless it is there, and lock it; no file of the lock lies beside the user's.

    Args:
        folder: The folder.
        certain: Whether to return None where the file or the operating system has no locks.

    Returns:
        An open descriptor that holds the lock until it is closed, which the death of the process
        does too; None if another process holds it.
    """
    while True:
        with suppress(FileExistsError):
            folder.mkdir()
        try:
            descriptor = open_folder(folder)
        except FileNotFoundError:  # the process that held the lock has just removed the folder
            if folder.is_symlink():
                raise
            continue
        if descriptor is None:  # this system locks no folders
            return None if certain else os.open(os.devnull, os.O_RDONLY)
        try:
            lock(descriptor)
        except BlockingIOError:
            os.close(descriptor)
            return None
        except OSError:
            if certain:
                os.close(descriptor)
                return None
            return descriptor
        with suppress(FileNotFoundError):
            if os.path.samestat(os.fstat(descriptor), folder.stat()):
                return descriptor
        os.close(descriptor)  # the folder was removed after it was opened


class DiskFile(FileIO):
    """A file for HDF5 to write to, which crashes the process where a disk refuses a write to it.

    HDF5 is given it as a file object. It keeps the first refusal of the disk for `refusals`, and
    then writes no more. It takes no memory, however large the file becomes.
    """

    _refusal: OSError | None = None

    def write(self, data: Any, /) -> int:
        """Write all of ``data``, unless the disk has refused something."""
        rest = memoryview(data).cast("B")
        size = len(rest)
        with self._kept_refusal():
            while rest and self._refusal is None:
                rest = rest[super().write(rest) :]
        return size

    def truncate(self, size: int | None = None, /) -> int:
        """Change the size, unless the disk has refused something."""
        with self._kept_refusal():
            if self._refusal is None:
                super().truncate(size)
        return self.tell() if size is None else size

    @contextmanager
    def refusals(self) -> Generator[None]:
        """Raise at the end of the block what the disk refused; it explains whatever HDF5 says.

        Raises:
            OSError: If it did.
        """
        try:
            yield
        finally:
            if self._refusal is not None:
                raise self._refusal

    @contextmanager
    def _kept_refusal(self) -> Generator[None]:
        try:
            yield
        except OSError as refusal:
            self._refusal = refusal

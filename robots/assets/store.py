"""The local copy of the robot files: where it is, what in it can be used, how files get in."""

from __future__ import annotations

import errno
import hashlib
import os
import shutil
from collections.abc import Generator, Iterable, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

from filelock import FileLock, Timeout

from robot_layouts.core.commands import notice, printable
from robot_layouts.core.errors import AssetError, UnreadableFileError
from robot_layouts.core.files import open_regular
from robot_layouts.core.paths import ROOT_VARIABLE
from robot_layouts.core.writing import remove, written_whole
from robots.assets.manifest import AssetFile

_LOCK, _PARTIAL = ".lock", ".partial"
_ABSENT = (errno.ENOENT, errno.ENOTDIR)
_EXCHANGEABLE = (errno.EINVAL, errno.EFBIG, errno.ELOOP)  # no regular file, too large, a loop
_WAIT_BEFORE_SAYING = 2.0  # s
# sha256 of files hashed by this process, with what tells that a file has changed since.
_hashed: dict[Path, tuple[tuple[int, ...], str]] = {}


def say(text: str) -> None:
    """Print one line; no name in it steers the terminal."""
    notice(f"robot files: {printable(text)}")


def size(count: int) -> str:
    """Return a number of bytes as people write it."""
    return f"{count / 1e6:.1f} MB" if count >= 1e5 else f"{count / 1e3:.1f} kB"


def listing(entries: Sequence[str], separator: str = ", ", most: int = 12) -> str:
    """Return entries as a list for a message, and how many more there are beyond the first."""
    shown = list(entries[:most])
    if len(entries) > most:
        shown.append(f"and {len(entries) - most} more")
    return separator.join(shown)


class FileState(Enum):
    """Whether a file of the local copy is there, and is what the manifest says."""

    VERIFIED = "verified"
    WRONG = "differs from the manifest"
    MISSING = "missing"


@dataclass(frozen=True)
class AssetStore:
    """A folder of robot files, ``<root>/<package>/<path>``, that are checked before use."""

    root: Path

    def path(self, file: AssetFile) -> Path:
        """Return where a file is or would be."""
        return self.root / file.origin.name / (file.origin.mount or "") / file.path

    def state(self, file: AssetFile) -> FileState:
        """Tell whether a file is there and right; hashes it once per process and change.

        Raises:
            AssetError: If it is there but cannot be read.
        """
        try:
            digest = _sha256(self.path(file), file.bytes)
        except UnreadableFileError as error:
            if error.errno in _ABSENT:
                return FileState.MISSING
            if error.errno in _EXCHANGEABLE:
                return FileState.WRONG
            raise AssetError(str(error)) from error
        return FileState.VERIFIED if digest == file.sha256 else FileState.WRONG

    def unusable(self, files: Iterable[AssetFile]) -> list[AssetFile]:
        """Return the files that are missing or wrong."""
        return [file for file in files if self.state(file) is not FileState.VERIFIED]

    @contextmanager
    def fetching(self) -> Generator[Path]:
        """Hold the only right to write here, and give a scratch folder on the same file system.

        What a killed fetch left in the scratch folder is removed. A second process waits, and says
        so after two seconds.

        Raises:
            AssetError: If the folder cannot be written.
        """
        scratch = self.root / _PARTIAL
        with _destination_errors(self.root):
            self.root.mkdir(parents=True, exist_ok=True)
            lock = FileLock(self.root / _LOCK, mode=0o666)
            try:
                lock.acquire(timeout=_WAIT_BEFORE_SAYING)
            except Timeout:
                say(f"another process is fetching robot files into {self.root}; waiting for it")
                lock.acquire()
        try:
            with _destination_errors(self.root):
                remove(scratch)
                scratch.mkdir()
            yield scratch
        finally:
            shutil.rmtree(scratch, ignore_errors=True)
            lock.release()

    def install(self, file: AssetFile, data: bytes, *, scratch: Path) -> bool:
        """Put a file in its place, whole or not at all; only inside `fetching`.

        Args:
            file: What the manifest promises.
            data: What a source gave.
            scratch: The folder that `fetching` gave.

        Returns:
            Whether it is what the manifest promises; if not, nothing is written.

        Raises:
            AssetError: If it cannot be written.
        """
        if hashlib.sha256(data).hexdigest() != file.sha256:
            return False
        partial = scratch / "file"
        with (
            _destination_errors(self.root),
            written_whole(self.path(file), None, partial=partial, sync=True),
        ):
            partial.write_bytes(data)
        return True


def _sha256(path: Path, limit: int) -> str:
    with open_regular(path) as stream:
        status = os.fstat(stream.fileno())
        stamp = (status.st_ino, status.st_size, status.st_mtime_ns, status.st_ctime_ns)
        known = _hashed.get(path)
        if known is not None and known[0] == stamp:
            return known[1]
        if status.st_size > limit:
            raise UnreadableFileError(path, f"it has more than {limit:,} bytes", errno.EFBIG)
        digest = hashlib.sha256(stream.read(limit)).hexdigest()
    _hashed[path] = (stamp, digest)
    return digest


@contextmanager
def _destination_errors(root: Path) -> Generator[None]:
    try:
        yield
    except OSError as error:
        place = error.filename2 or error.filename
        where = f" ({place})" if isinstance(place, (str, Path)) and str(place) != str(root) else ""
        reason = error.strerror or str(error)
        if error.errno == errno.EEXIST:
            reason = "something that is no folder is in its place"
        raise AssetError(
            f"cannot write robot files to {root}: {reason}{where}. Make room or"
            f" give write permission there, or choose another folder with --dest or"
            f" {ROOT_VARIABLE}."
        ) from error

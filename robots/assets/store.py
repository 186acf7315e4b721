"""The local copy of the robot files: where it is, what in it can be used, how files get in."""

from __future__ import annotations

import errno
import hashlib
import json
import os
import shutil
from collections.abc import Generator, Iterable, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from enum import Enum
from functools import lru_cache
from pathlib import Path
from typing import TypedDict

from filelock import FileLock, Timeout

from robot_layouts.core.errors import AssetError, UnreadableFileError
from robot_layouts.core.files import open_regular, read_json
from robot_layouts.core.paths import ROOT_VARIABLE
from robot_layouts.core.schema import check
from robot_layouts.core.writing import remove, written_whole
from robots.assets.manifest import AssetFile
from robots.assets.progress import say

_LOCK, _PARTIAL, _RECORD = ".lock", ".partial", "fetched.json"
_ABSENT = (errno.ENOENT, errno.ENOTDIR)
_EXCHANGEABLE = (errno.EINVAL, errno.EFBIG, errno.ELOOP)  # no regular file, too large, a loop
_LARGEST_RECORD = 2**24  # bytes
_WAIT_BEFORE_SAYING = 2.0  # s

# sha256 of files hashed by this process, with what tells that a file has changed since.
_hashed: dict[Path, tuple[tuple[int, ...], str]] = {}


class FetchedFile(TypedDict):
    """Where a file came from.

    Attributes:
        source: Title of the source.
        sha256: SHA-256 of what it gave, in hex.
        trusted: Whether it was accepted although it differs from the manifest.
    """

    source: str
    sha256: str
    trusted: bool


class FileState(Enum):
    """Whether a file of the local copy is there, and is what the manifest says."""

    VERIFIED = "verified"
    TRUSTED = "differs from the manifest, trusted"
    WRONG = "differs from the manifest"
    MISSING = "missing"

    @property
    def usable(self) -> bool:
        """Whether the file may be used."""
        return self in (FileState.VERIFIED, FileState.TRUSTED)


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
            digest = _sha256(self.path(file), file.limit(trust=True))
        except UnreadableFileError as error:
            if error.errno in _ABSENT:
                return FileState.MISSING
            if error.errno in _EXCHANGEABLE:
                return FileState.WRONG
            raise AssetError(str(error)) from error
        if digest == file.sha256:
            return FileState.VERIFIED
        entry = self.record().get(str(file))
        trusted = entry is not None and entry["trusted"] and entry["sha256"] == digest
        return FileState.TRUSTED if trusted else FileState.WRONG

    def unusable(self, files: Iterable[AssetFile]) -> list[AssetFile]:
        """Return the files that are missing or wrong."""
        return [file for file in files if not self.state(file).usable]

    def record(self) -> dict[str, FetchedFile]:
        """Return what was fetched, by package and path; a damaged record counts as empty.

        Of each file its sha256 decides, not this record, so that little is lost with it.

        Raises:
            AssetError: If the record is there but may not be read.
        """
        path = self.root / _RECORD
        try:
            value = read_json(path, _LARGEST_RECORD)
            return dict(check(value, Mapping[str, FetchedFile], "it", AssetError))
        except UnreadableFileError as error:
            if error.errno in _ABSENT:
                return {}
            if error.errno in (errno.EACCES, errno.EPERM, errno.EIO):
                raise AssetError(str(error)) from error
            damage = error.strerror
        except AssetError as error:
            damage = str(error)
        _say_once(
            f"{path} is damaged: {damage}; nothing that was verified is lost, but what was fetched"
            " with --trust-source counts as differing"
        )
        return {}

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

    def install(
        self, file: AssetFile, data: bytes, *, scratch: Path, source: str, trust: bool = False
    ) -> bool:
        """Put a file in its place, whole or not at all; only inside `fetching`.

        Args:
            file: What the manifest promises.
            data: What the source gave.
            scratch: The folder that `fetching` gave.
            source: Name of the source, for the record.
            trust: Whether to accept contents that differ from the manifest, and mark them.

        Returns:
            Whether the file was accepted.

        Raises:
            AssetError: If it cannot be written.
        """
        digest = hashlib.sha256(data).hexdigest()
        matches = digest == file.sha256
        if not (matches or trust):
            return False
        record = self.record()
        record[str(file)] = {"source": source, "sha256": digest, "trusted": not matches}
        with _destination_errors(self.root):
            # The record goes first: a file is trusted only if the record names its sha256.
            _write(self.root / _RECORD, json.dumps(record, indent=1).encode(), scratch)
            _write(self.path(file), data, scratch)
        return True


_say_once = lru_cache(say)


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


def _write(path: Path, data: bytes, scratch: Path) -> None:
    with written_whole(path, None, partial=scratch / "file", sync=True) as partial:
        partial.write_bytes(data)


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

"""What was fetched into a local copy: `fetched.json`, which may be damaged without any loss."""

from __future__ import annotations

import errno
import json
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypedDict

from robots.assets.progress import say
from robots.common.errors import AssetError, UnreadableFileError
from robots.common.files import read_json
from robots.common.schema import check

_LIMIT = 2**24  # bytes
_ABSENT = (errno.ENOENT, errno.ENOTDIR)
_DAMAGED = ".damaged"

_warned: set[str] = set()


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


@dataclass
class FetchRecord:
    """What was fetched, by package and path; of each file its sha256 decides, not this record.

    Attributes:
        path: The file it is kept in.
        files: What was fetched.
        damage: Why some of the file could not be read, in a sentence, or nothing.
    """

    path: Path
    files: dict[str, FetchedFile] = field(default_factory=dict[str, FetchedFile])
    damage: str = ""

    @classmethod
    def read(cls, path: Path) -> FetchRecord:
        """Return the record that a file keeps, or what of it can be read; warns once.

        Raises:
            AssetError: If the file may not be read.
        """
        record = cls(path)
        try:
            record._fill(read_json(path, _LIMIT))
        except UnreadableFileError as error:
            if error.errno in _ABSENT:
                return record
            if error.errno in (errno.EACCES, errno.EPERM, errno.EIO):
                raise AssetError(str(error)) from error
            record.damage = str(error.strerror)
        if record.damage and str(path) not in _warned:
            _warned.add(str(path))
            say(
                f"{path} is damaged: {record.damage}; nothing that it verified is lost, but what"
                " was fetched with --trust-source counts as differing"
            )
        return record

    def set_aside(self) -> None:
        """Keep a damaged file under another name, before it is written anew.

        Raises:
            OSError: If it cannot be renamed.
        """
        if self.damage:
            os.rename(self.path, f"{self.path}{_DAMAGED}")
            self.damage = ""

    def to_json(self) -> str:
        """Return what `read` reads."""
        return json.dumps(self.files, indent=1)

    def _fill(self, value: Any) -> None:
        if not isinstance(value, dict):
            self.damage = "it does not map files to what was fetched"
            return
        for name, entry in value.items():
            try:
                self.files[name] = check(entry, FetchedFile, repr(name), AssetError)
            except AssetError as error:
                self.damage = str(error)

"""Where robot files can be had on this machine: another local copy, or an installed package."""

from __future__ import annotations

import errno
from collections.abc import Generator, Iterable, Sequence
from pathlib import Path
from typing import Protocol

from robots.assets.manifest import AssetFile
from robots.assets.packages import IndexPackage, SourceError, find_package
from robots.assets.progress import listing
from robots.assets.store import AssetStore, FileState
from robots.common.errors import AssetError, UnreadableFileError
from robots.common.files import read_regular

# None stands for contents that are more than the file may have.
Contents = Generator[tuple[AssetFile, bytes | None], None, None]


class AssetSource(Protocol):
    """A place that robot files can be fetched from."""

    @property
    def name(self) -> str:
        """Name on the command line."""
        ...

    @property
    def title(self) -> str:
        """Name in messages."""
        ...

    def holds(self, file: AssetFile) -> bool:
        """Tell whether it may have a file; it is asked for no others."""
        ...

    def fetch(
        self, files: Sequence[AssetFile], scratch: Path, *, again: bool, trust: bool
    ) -> Contents:
        """Yield the contents of files, unchecked, as they arrive.

        Of a file that is larger than `AssetFile.limit`, no more than that is read, and None is
        given. Files that were not asked for may follow those that were, if they came along.

        Args:
            files: What is wanted.
            scratch: A folder for temporary files.
            again: Whether these files were wrong a moment ago, so that caches must be passed by.
            trust: Whether files may differ from the manifest, also in size.

        Raises:
            SourceError: If some file cannot be had; those that can be are yielded before.
        """
        ...


class LocalCopy:
    """A local copy, as a source for another folder."""

    name = "local"

    def __init__(self, root: Path, *, states: Iterable[FileState] = (FileState.VERIFIED,)) -> None:
        """Read from a folder, taking only files in some states."""
        self._store = AssetStore(root)
        self._states = frozenset(states)
        self.title = f"local copy {root}"

    def holds(self, file: AssetFile) -> bool:
        """Tell that it may have any file."""
        return True

    def fetch(
        self, files: Sequence[AssetFile], scratch: Path, *, again: bool, trust: bool
    ) -> Contents:
        """Yield what the copy holds; see `AssetSource`."""
        absent: list[str] = []
        for file in files:
            try:
                state = self._store.state(file)
                if state in self._states:
                    yield file, read_bounded(self._store.path(file), file.limit(trust=trust))
                else:
                    absent.append(f"{file} ({state.value})")
            except (AssetError, UnreadableFileError) as error:
                absent.append(f"{file} ({error})")
        expect_none(absent)


class InstalledPackage:
    """A package of this Python that holds robot files, found without importing it."""

    def __init__(self, package: IndexPackage) -> None:
        """Read from a package, wherever it is installed."""
        self.name = package.name
        self.title = f"installed {package.name}"

    def holds(self, file: AssetFile) -> bool:
        """Tell whether a file is of its package."""
        return file.origin.distribution == self.name

    def fetch(
        self, files: Sequence[AssetFile], scratch: Path, *, again: bool, trust: bool
    ) -> Contents:
        """Yield what the package holds; see `AssetSource`."""
        folder = find_package(self.name)
        absent: list[str] = []
        for file in files:
            path = folder / file.origin.folder / file.path
            try:
                yield file, read_bounded(path, file.limit(trust=trust))
            except UnreadableFileError as error:
                absent.append(f"{path} ({error.strerror})")
        expect_none(absent)


def expect_none(absent: Sequence[str]) -> None:
    """Refuse if a source has not got some files.

    Raises:
        SourceError: If there are any.
    """
    if absent:
        raise SourceError(f"lacks {len(absent)} files: {listing(absent)}")


def read_bounded(path: Path, limit: int) -> bytes | None:
    """Return the contents of a file, or None if it has more bytes than the limit.

    Raises:
        UnreadableFileError: If it cannot be read, or is no regular file.
    """
    try:
        return read_regular(path, limit)
    except UnreadableFileError as error:
        if error.errno == errno.EFBIG:
            return None
        raise

"""The h5 files of a recording that its episodes are joined into, and their manifest."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from robots import RecordingError, UnreadableFileError
from robots.common.files import open_regular, read_text
from robots.common.writing import write_whole
from rollouts.reading.manifest import (
    FILE_NUMBER,
    FileEntry,
    Manifest,
    file_path,
    manifest_path,
    manifest_text,
    read_manifest,
    sized_file,
    spans_of,
)
from rollouts.reading.provenance import listing
from rollouts.reading.summary import MAX_JSON, TrajectoryError
from rollouts.recording.header import header_differences, header_hash, numbered
from rollouts.recording.trajectory_writer import join, read_header, read_joined
from rollouts.sources.header import Source, combined, source_of


@dataclass
class OpenFile:
    """A file of a recording that may have to be written anew.

    Attributes:
        number: Which file; see `rollouts.reading.manifest.file_path`.
        groups: The groups of its episodes by seed, ascending.
        abouts: Their json, likewise.
        sizes: Their `Stored.size`, likewise.
        sources: What its header says of its source, unless it is empty.
        lost: Seeds of episodes that it held, and that are damaged.
        whole: Whether there is nothing to mend in the h5 file.
    """

    number: int
    groups: dict[int, str] = field(default_factory=dict[int, str])
    abouts: dict[int, dict[str, Any]] = field(default_factory=dict[int, dict[str, Any]])
    sizes: dict[int, int] = field(default_factory=dict[int, int])
    sources: frozenset[Source] = frozenset()
    lost: frozenset[int] = frozenset()
    whole: bool = False


class JoinedFiles:
    """The files of a recording: full ones, which stay as they are, and a last one that may grow.

    Full files that are as the manifest says are not read again.

    Attributes:
        last: The last file.
        mending: Full files of which episodes are damaged, by number.
        seeds: Seeds of the episodes of all files.
        damaged: What is damaged, in words.
    """

    def __init__(self, path: Path, header: Mapping[str, Any]) -> None:
        """Take the first h5 file of a recording and what its episodes have in common."""
        self._path, self._header = path, header
        self._entries: list[FileEntry] = []  # of the full files
        self._last_entry: FileEntry | None = None
        self.last = OpenFile(0)
        self.mending: dict[int, OpenFile] = {}
        self.seeds = set[int]()
        self.damaged: list[str] = []

    @property
    def manifest(self) -> Path:
        """Where the manifest is."""
        return manifest_path(self._path)

    def paths(self) -> list[Path]:
        """Return the h5 files that are there, or that the manifest lists, the first one first.

        Raises:
            RecordingError: If another recording has the name of one.
        """
        for path in (self._path, self._path.with_suffix(".json")):
            _expect_file_or_nothing(path)
        count = int(self._path.exists())
        while (path := file_path(self._path, max(count, 1))).exists():
            self._expect_own(path, max(count, 1))
            count = max(count, 1) + 1
        return [file_path(self._path, i) for i in range(max(count, len(self._listed())))]

    def read(self) -> None:
        """Look at what is there; files that a kill left half noted are noted.

        Raises:
            RecordingError: If it is of something else, or no recording.
        """
        paths, listed = self.paths(), self._listed()
        for number, path in enumerate(paths):
            entry = listed[number] if number < len(listed) else None
            if number + 1 == len(paths):
                self.last = self._look(number, path, entry)
                self._note_seeds(path, self.last.groups)
            elif entry is not None and entry.matches(path):
                self._entries.append(entry)
                self._note_seeds(path, entry.seeds)
            else:
                self._reopen(number, path, entry)
        if self._entries:
            self._expect_same(paths[0], read_header(paths[0]))

    def remove(self) -> None:
        """Delete all files."""
        for path in (self.manifest, *self.paths(), self._path):
            path.with_suffix(".json").unlink(missing_ok=True)
            path.unlink(missing_ok=True)

    def write(
        self,
        file: OpenFile,
        places: Mapping[int, Path | str],
        sources: Iterable[Source] = (),
        *,
        last: bool,
    ) -> None:
        """Write a file; the manifest must be written after it.

        Args:
            file: What is there.
            places: Where its episodes are, by seed, ascending: parts, or groups of what is there.
            sources: What parts say of their source.
            last: Whether it may grow; else the next file becomes the last.

        Raises:
            RecordingError: If it cannot be written, or an episode not be read.
        """
        path, kept = file_path(self._path, file.number), file.groups.keys() & places.keys()
        file.sources = frozenset(sources) | (file.sources if kept else frozenset())
        about = combined(file.sources or [source_of(self._header)])
        header = numbered({**self._header, **about}, file.number)
        if not (file.whole and list(places.values()) == list(file.groups.values())):
            joined = join(path, header, list(places.values()))
            file.groups = dict(zip(places, joined, strict=True))
            file.abouts = dict(zip(places, joined.values(), strict=True))
            file.whole, file.lost = True, frozenset()
        self._write_json(path, header, file.abouts.values())
        self.seeds.update(places)
        if last:
            self._last_entry = _entry(path, file.abouts) if file.number else None
            return
        self._entries[file.number : file.number + 1] = [_entry(path, file.abouts)]
        if file is self.last:
            self.last = OpenFile(file.number + 1)

    def write_manifest(self) -> None:
        """Write which files there are; none if there is one alone.

        Raises:
            RecordingError: If it cannot be written.
        """
        entries = (*self._entries, *([self._last_entry] if self._last_entry else []))
        if not self._entries:
            self.manifest.unlink(missing_ok=True)
            return
        task_id = self._header["env_info"]["env_id"]
        manifest = Manifest(task_id, header_hash(self._header), entries)
        _write_if_other(self.manifest, manifest_text(manifest, self._path))

    def write_empty(self) -> None:
        """Write the last file without episodes; none if there are others.

        Raises:
            RecordingError: If it cannot be written.
        """
        if not self.last.number:
            self.write(self.last, {}, last=True)
        else:
            path = file_path(self._path, self.last.number)
            path.with_suffix(".json").unlink(missing_ok=True)
            path.unlink(missing_ok=True)
        self.write_manifest()

    def _listed(self) -> tuple[FileEntry, ...]:
        try:
            manifest = read_manifest(self._path)
        except TrajectoryError:  # the files are read in its place, and it is written anew
            return ()
        if manifest is None or manifest.header != header_hash(self._header):
            return ()
        return manifest.files

    def _look(self, number: int, path: Path, entry: FileEntry | None) -> OpenFile:
        """Read all of a file."""
        held = frozenset(entry.seeds if entry else ())
        if not path.exists():
            self.damaged.append(f"{path} with its {len(held)} episodes, which is gone,")
            return OpenFile(number, lost=held)
        joined = read_joined(path)
        self._expect_same(path, joined.header)
        self.damaged += [f"{name} of {path}" for name in joined.damaged]
        groups = {about["episode_seed"]: name for name, about in joined.episodes.items()}
        groups = {seed: groups[seed] for seed in sorted(groups)}
        in_order = list(groups.values()) == [f"traj_{i}" for i in range(len(groups))]
        return OpenFile(
            number,
            groups,
            {seed: joined.episodes[name] for seed, name in groups.items()},
            {seed: joined.sizes[name] for seed, name in groups.items()},
            frozenset([source_of(joined.header)] if groups else ()),
            held - set(groups),
            in_order and not joined.damaged,
        )

    def _reopen(self, number: int, path: Path, entry: FileEntry | None) -> None:
        """Mend a full file that is not as the manifest says, or leave that until the end."""
        if entry is None and not path.exists():
            raise RecordingError(
                f"{path} is gone, and nothing says what it held; bring it back, or choose another"
                " folder"
            )
        file = self._look(number, path, entry)
        self._note_seeds(path, file.groups)
        if entry is not None and file.lost:
            self.mending[number] = file
            self._entries.append(entry)
        else:
            self.write(file, file.groups, last=False)

    def _note_seeds(self, path: Path, seeds: Iterable[int]) -> None:
        before, seeds = len(self.seeds), list(seeds)
        self.seeds.update(seeds)
        if len(self.seeds) != before + len(seeds):
            raise RecordingError(f"{path} holds an episode of a seed that a file before it holds")

    def _expect_own(self, path: Path, number: int) -> None:
        """Refuse another recording at the place of one of this recording's files."""
        _expect_file_or_nothing(path)
        if number >= len(self._listed()) and read_header(path).get(FILE_NUMBER) != number:
            raise RecordingError(
                f"{path} is a recording of its own, in the place of a later file of {self._path};"
                " choose another name"
            )

    def _expect_same(self, path: Path, header: Mapping[str, Any]) -> None:
        found = header_differences(header, self._header)
        if found:
            raise RecordingError(
                f"{path} was recorded with something else, so this recording cannot go on there"
                f" ({listing(found)}); choose another folder"
            )

    def _write_json(
        self, path: Path, header: Mapping[str, Any], abouts: Iterable[Mapping[str, Any]]
    ) -> None:
        episodes = [{"episode_id": number, **about} for number, about in enumerate(abouts)]
        text = json.dumps({**header, "episodes": episodes}, indent=1) + "\n"
        _write_if_other(path.with_suffix(".json"), text)


def _entry(path: Path, abouts: Mapping[int, Mapping[str, Any]]) -> FileEntry:
    return FileEntry(
        sized_file(path),
        sized_file(path.with_suffix(".json")),
        len(abouts),
        sum(bool(about["success"]) for about in abouts.values()),
        sum(about["elapsed_steps"] for about in abouts.values()),
        spans_of(abouts),
    )


def _write_if_other(path: Path, text: str) -> None:
    with suppress(UnreadableFileError):
        if read_text(path, MAX_JSON) == text:
            return
    write_whole(path, text, RecordingError, parents=False)


def _expect_file_or_nothing(path: Path) -> None:
    """Refuse a path at which there is something that is no file, before anything is recorded."""
    if os.path.lexists(path) and path.exists():
        try:
            open_regular(path).close()
        except UnreadableFileError as error:
            raise RecordingError(f"cannot write {path}: {error.strerror}") from error

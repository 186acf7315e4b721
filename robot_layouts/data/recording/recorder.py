"""Writes episodes in ManiSkill's own trajectory format, h5 with a json beside it."""

from __future__ import annotations

import glob
import json
import math
import os
import re
import weakref
from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import chain
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple

from robot_layouts.core.files import open_regular, read_text
from robot_layouts.core.writing import PARTIAL, claim, disk_errors, write_whole
from robot_layouts.data.actors import Source, combined, source_of
from robot_layouts.data.reading.hdf5 import Hdf5File, damage_errors
from robot_layouts.data.reading.json_files import (
    FILE_NUMBER,
    FILE_SIZE,
    MAX_JSON,
    FileEntry,
    RecordingManifest,
    TrajectoryError,
    file_path,
    manifest_path,
    manifest_text,
    matches,
    read_manifest,
    seeds_of,
    sized_file,
    spans_of,
)
from robot_layouts.data.reading.provenance import (
    describe_task,
    header_differences,
    header_hash,
    listing,
    numbered,
    recorded_control_mode,
)
from robot_layouts.data.recording.episode_files import (
    JoinedEpisode,
    PartEncoder,
    Place,
    Stored,
    damaged_recording,
    join,
    list_parts,
    part_path,
    part_size,
    read_header,
    read_joined,
    read_joined_episode,
    read_part,
    refuse_foreign,
    seed_of,
    write_part,
)
from robots import RecordingError, TaskError, UnreadableFileError
from tasks import TaskEnv
from tasks.episode import PlayedEpisode


@dataclass
class OpenFile:
    """A file of a recording that may have to be written anew.

    Attributes:
        number: Which file; see `robot_layouts.data.reading.json_files.file_path`.
        episodes: Its episodes by seed, ascending.
        sources: What its header says of its source, unless it is empty.
        lost: Seeds of episodes that it held, and that are damaged.
        whole: Whether there is nothing to repair in the h5 file.
    """

    number: int
    episodes: dict[int, JoinedEpisode] = field(default_factory=dict[int, JoinedEpisode])
    sources: frozenset[Source] = frozenset()
    lost: frozenset[int] = frozenset()
    whole: bool = False


class JoinedFiles:
    """The files of a recording: full ones, which stay as they are, and a last one that may grow.

    Full files that are as the manifest says are not read again.

    Attributes:
        manifest: Where the manifest is.
        paths: The h5 files that are there, or that the manifest lists, the first one first.
        last: The last file.
        to_repair: Full files of which episodes are damaged, by number.
        seeds: Seeds of the episodes of all files.
        damaged: What is damaged, in words.
    """

    def __init__(self, path: Path, header: Mapping[str, Any]) -> None:
        """Find the files.

        Args:
            path: The first h5 file of a recording.
            header: What its episodes have in common.

        Raises:
            RecordingError: If another recording has the name of one.
        """
        self._path, self._header, self.manifest = path, header, manifest_path(path)
        self._entries: list[FileEntry] = []  # of the full files
        self._last_entry: FileEntry | None = None
        self.last = OpenFile(0)
        self.to_repair: dict[int, OpenFile] = {}
        self.seeds = set[int]()
        self.damaged: list[str] = []
        self._listed = self._read_manifest()
        self.paths = self._find()

    def read(self) -> None:
        """Check what is there; files that a kill left half noted are noted.

        Raises:
            RecordingError: If it is of something else, or no recording.
        """
        for number, path in enumerate(self.paths):
            entry = self._listed[number] if number < len(self._listed) else None
            if number + 1 == len(self.paths):
                self.last = self._read_all(number, path, entry)
            elif entry is not None and matches(entry, path):
                self._entries.append(entry)
                self._note_seeds(path, seeds_of(entry))
            else:
                self._reopen(number, path, entry)
        if self._entries:
            self._expect_same(self.paths[0], read_header(self.paths[0]))

    def remove(self) -> None:
        """Delete all files."""
        for path in (self.manifest, *self.paths, self._path):
            path.with_suffix(".json").unlink(missing_ok=True)
            path.unlink(missing_ok=True)
        self._listed, self.paths = [], []

    def write(
        self,
        file: OpenFile,
        places: Mapping[int, Place],
        sources: Iterable[Source] = (),
        *,
        last: bool,
    ) -> None:
        """Write a file; the manifest must be written after it.

        Args:
            file: What is there.
            places: Where its episodes are, by seed, ascending.
            sources: What parts say of their source.
            last: Whether it may grow; else the next file becomes the last.

        Raises:
            RecordingError: If it cannot be written, or an episode not be read.
        """
        path, kept = file_path(self._path, file.number), file.episodes.keys() & places.keys()
        file.sources = frozenset(sources) | (file.sources if kept else frozenset())
        about = combined(file.sources or [source_of(self._header)])
        header = numbered({**self._header, **about}, file.number)
        if not file.whole or [*places.values()] != [held.group for held in file.episodes.values()]:
            file.episodes = join(path, header, places)
            file.whole, file.lost = True, frozenset()
        abouts = [held.about for held in file.episodes.values()]
        episodes = [{"episode_id": number, **about} for number, about in enumerate(abouts)]
        text = json.dumps({**header, "episodes": episodes}, indent=1) + "\n"
        _write_if_other(path.with_suffix(".json"), text)
        self.seeds.update(places)
        entry = FileEntry(
            file=path.name,
            h5=sized_file(path),
            json=sized_file(path.with_suffix(".json")),
            episodes=len(abouts),
            successes=sum(bool(about["success"]) for about in abouts),
            steps=sum(about["elapsed_steps"] for about in abouts),
            seeds=spans_of(file.episodes),
        )
        if last:
            self._last_entry = entry if file.number else None
            return
        self._entries[file.number : file.number + 1] = [entry]
        if file is self.last:
            self.last = OpenFile(file.number + 1)

    def write_manifest(self) -> None:
        """Write which files there are; none if there is one alone.

        Raises:
            RecordingError: If it cannot be written.
        """
        if not self._entries:
            self.manifest.unlink(missing_ok=True)
            return
        entries = [*self._entries, *([self._last_entry] if self._last_entry else [])]
        task_id = self._header["env_info"]["env_id"]
        manifest = RecordingManifest(task_id, header_hash(self._header), entries)
        _write_if_other(self.manifest, manifest_text(manifest))

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

    def read_groups(self, file: OpenFile, seeds: Iterable[int]) -> Iterator[tuple[int, Stored]]:
        """Yield episodes of one of the files with their seeds.

        Raises:
            RecordingError: If one is damaged.
        """
        path = file_path(self._path, file.number)
        with (
            damage_errors(lambda reason: damaged_recording(path, reason)),
            Hdf5File(path) as opened,
        ):
            for seed in seeds:
                yield seed, read_joined_episode(opened, file.episodes[seed].group)

    def _read_manifest(self) -> list[FileEntry]:
        try:
            manifest = read_manifest(self._path)
        except TrajectoryError:  # the files are read in its place, and it is written anew
            return []
        if manifest is None or manifest.header != header_hash(self._header):
            return []
        return manifest.files

    def _find(self) -> list[Path]:
        for path in (self._path, self._path.with_suffix(".json")):
            _expect_file_or_nothing(path)
        count = int(self._path.exists())
        while (path := file_path(self._path, number := max(count, 1))).exists():
            _expect_file_or_nothing(path)
            if number >= len(self._listed) and read_header(path).get(FILE_NUMBER) != number:
                raise RecordingError(
                    f"{path} is a recording of its own, in the place of a later file of"
                    f" {self._path}; choose another name"
                )
            count = number + 1
        return [file_path(self._path, i) for i in range(max(count, len(self._listed)))]

    def _read_all(self, number: int, path: Path, entry: FileEntry | None) -> OpenFile:
        """Read all of a file."""
        listed = frozenset(seeds_of(entry) if entry else ())
        if not path.exists():
            self.damaged.append(f"{path} with its {len(listed)} episodes, which is gone,")
            return OpenFile(number, lost=listed)
        header, episodes, damaged = read_joined(path)
        self._expect_same(path, header)
        self.damaged += [f"{name} of {path}" for name in damaged]
        self._note_seeds(path, episodes)
        in_order = [held.group for held in episodes.values()] == [
            f"traj_{i}" for i in range(len(episodes))
        ]
        return OpenFile(
            number,
            episodes,
            frozenset([source_of(header)] if episodes else ()),
            listed - set(episodes),
            in_order and not damaged,
        )

    def _reopen(self, number: int, path: Path, entry: FileEntry | None) -> None:
        """Mend a full file that is not as the manifest says, or leave that until the end."""
        if entry is None and not path.exists():
            raise RecordingError(
                f"{path} is gone, and nothing says what it held; bring it back, or choose another"
                " folder"
            )
        file = self._read_all(number, path, entry)
        if entry is not None and file.lost:
            self.to_repair[number] = file
            self._entries.append(entry)
        else:
            self.write(file, {s: held.group for s, held in file.episodes.items()}, last=False)

    def _note_seeds(self, path: Path, seeds: Iterable[int]) -> None:
        before, seeds = len(self.seeds), list(seeds)
        self.seeds.update(seeds)
        if len(self.seeds) != before + len(seeds):
            raise RecordingError(f"{path} holds an episode of a seed that a file before it holds")

    def _expect_same(self, path: Path, header: Mapping[str, Any]) -> None:
        if found := header_differences(header, self._header):
            raise RecordingError(
                f"{path} was recorded with something else, so this recording cannot go on there"
                f" ({listing(found)}); choose another folder"
            )


class _FinishedEpisode(NamedTuple):
    """A finished episode that is not joined yet: its size (bytes), and what its header says."""

    size: int
    source: Source


def checked_file_size(size: Any) -> float:
    """Return a size at which a further file is begun (MB).

    Raises:
        TaskError: If it is no such size.
    """
    if not isinstance(size, (int, float)) or not 0 < size < math.inf:
        raise TaskError(f"file_size is {size!r}; it must be MB, more than 0")
    return size


class Recorder:
    """A recording that grows by whole episodes; whatever ends it, the finished ones stay.

    Each finished episode is a file of its own in a folder beside the recording. They are joined in
    the order of their seeds by `close`, and before that as soon as they fill a file. If the process
    is killed before, the next Recorder that resumes the recording finds them there.

    A recording that does not fit into one file goes on in ``trajectory_0001.h5`` and so on, each a
    recording by itself; see `manifest`. If `expect` was told which seeds come, the
    files are the same in whichever order they come; they are full when the next episode would not
    fit any more.

    In the h5 file ``traj_i`` holds the flat actions (T, A), env states (T + 1, k), rewards and
    flags (T,). Its attribute ``action_split`` is json: robot name → first and last + 1 action
    number. The file's attributes ``layout`` and ``simulation`` are json too; see
    `robot_layouts.data.reading.provenance`.

    Attributes:
        path: The first h5 file.
        json_path: The json file beside it.
        parts: The folder of finished episodes that are not joined yet.
        damaged: Episodes that were there and are damaged, by their files or groups, in words;
            they do not count as recorded.
        encoder: Encodes one episode; may be handed to worker processes.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        task: TaskEnv,
        *,
        overwrite: bool = False,
        resume: bool = False,
        source: str = "scripted",
        source_desc: str | None = None,
        file_size: float = FILE_SIZE,
        observed: bool = False,
    ) -> None:
        """Begin a recording, or go on with one.

        Args:
            path: Name of the first h5 file; its folder is made.
            task: The task whose episodes are recorded.
            overwrite: Whether a recording that is already there may be replaced.
            resume: Whether to keep the episodes that are already there.
            source: Where the actions come from, in ManiSkill's words (``source_type``).
            source_desc: The same in your own words.
            file_size: Size at which a further h5 file is begun (MB); full ones stay as they are.
            observed: Whether episodes come with what the task observed in them.

        Raises:
            RecordingError: If there is a recording already and neither ``overwrite`` nor
                ``resume``, it is of something else or in use by another process, or the folder
                cannot be written.
            TaskError: If the size is invalid.
            AssetError: If robot files cannot be found.
        """
        checked_file_size(file_size)
        self.path = Path(path)
        self.json_path = self.path.with_suffix(".json")
        self.parts = self.path.with_suffix(".parts")
        self.damaged: list[str] = []
        self._header = describe_task(task, source, source_desc, observed=observed)
        self._limit = file_size * 1e6
        self._waiting: dict[int, _FinishedEpisode] = {}  # by seed
        self._coming: deque[int] = deque()
        self._given_up = set[int]()
        with disk_errors(self.path):
            self.path.parent.mkdir(parents=True, exist_ok=True)
            if os.path.lexists(self.parts) and not self.parts.is_dir():
                raise RecordingError(f"{self.parts} is no folder; move it somewhere else")
            lock = claim(self.parts)
            if lock is None:
                raise RecordingError(f"another process is recording into {self.parts}")
            try:
                self._files = JoinedFiles(self.path, self._header)
                self._begin(overwrite=overwrite, resume=resume)
            except BaseException:
                with suppress(OSError):  # not empty
                    self.parts.rmdir()
                os.close(lock)
                raise
        self._release = weakref.finalize(self, os.close, lock)
        mode = recorded_control_mode(task)
        self.encoder = PartEncoder(self._header, mode)
        self._closed = False

    def __enter__(self) -> Recorder:
        """Return itself."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Close the recording; if it ends by an error, that is the one that counts."""
        try:
            self.close()
        except RecordingError:
            if error is None:
                raise

    def __len__(self) -> int:
        """Return the number of episodes recorded."""
        return len(self.seeds)

    @property
    def seeds(self) -> set[int]:
        """Seeds of all episodes recorded."""
        return {*self._files.seeds, *self._waiting}

    def expect(self, seeds: Iterable[int]) -> None:
        """Say which episodes will come, so that files do not depend on their order."""
        self._coming = deque(sorted({*self._coming, *seeds}))

    def give_up(self, seed: int) -> None:
        """Say that an expected episode will not come; those after it are not kept waiting."""
        self._given_up.add(seed)

    def add(self, episode: PlayedEpisode) -> None:
        """Write one episode; it is kept when this returns.

        Raises:
            RecordingError: If it cannot be written; the episodes before it stay. Also if there
                is one of that seed already, or the recording was closed.
        """
        self.store(episode.seed, self.encoder.encode(episode))

    def store(self, seed: int, part: bytes) -> None:
        """Write an episode that the `encoder` encoded, perhaps elsewhere; else as `add`."""
        if self._closed:
            raise RecordingError(f"cannot write {self.path}: the recording was closed")
        if seed in self.seeds:
            raise RecordingError(f"{self.path} has an episode of seed {seed} already")
        write_part(self.parts, seed, part)
        self._waiting[seed] = _FinishedEpisode(part_size(part), source_of(self._header))
        while (full := self._full_file()) is not None:
            self._fill_last(full)

    def close(self) -> None:
        """Join the episodes into h5 files and write the json; closing twice is allowed.

        Raises:
            RecordingError: If they cannot be written; the finished episodes stay where they are.
        """
        if self._closed:
            return
        self._closed = True
        try:
            self._join()
        finally:
            self._release()

    def _begin(self, *, overwrite: bool, resume: bool) -> None:
        """Check and tidy what is there."""
        refuse_foreign(self.parts)
        parts, files = list_parts(self.parts), self._files
        there = [p for p in (*files.paths, files.manifest, *parts) if p.exists()]
        if there and not (overwrite or resume):
            raise RecordingError(
                f"{there[0]} is there already; choose another name, or pass overwrite=True to"
                " replace the recording or resume=True to go on with it"
            )
        for left_over in self._left_over():
            left_over.unlink(missing_ok=True)
        if overwrite:
            files.remove()
            for part in parts:
                part.unlink(missing_ok=True)
        files.read()
        self.damaged += files.damaged
        for part in list_parts(self.parts):
            self._check_part(part)

    def _left_over(self) -> list[Path]:
        """Return the files that a kill left half written."""
        pattern, own = f"{glob.escape(self.path.stem)}*{PARTIAL}", re.escape(self.path.stem)
        number = "(_[0-9]{4,})?" if self._files.manifest.exists() else ""
        name = re.compile(rf"{own}{number}\..*{re.escape(PARTIAL)}")
        beside = (path for path in self.path.parent.glob(pattern) if name.fullmatch(path.name))
        return [*chain(self.parts.glob(f"*{PARTIAL}"), beside)]

    def _check_part(self, part: Path) -> None:
        """Refuse a part of another recording; remove one that is damaged or already joined."""
        try:
            header, stored = read_part(part)
        except RecordingError:  # by a power cut, say: its episode is recorded again
            self.damaged.append(str(part))
            part.unlink()
            return
        if found := header_differences(header, self._header):
            raise RecordingError(
                f"{part} was recorded with something else, so this recording cannot go on there"
                f" ({listing(found)}); choose another folder"
            )
        if seed_of(part) in self._files.seeds:
            part.unlink()
        else:
            self._waiting[seed_of(part)] = _FinishedEpisode(stored.size, source_of(header))

    def _full_file(self, *, certain: bool = False) -> list[int] | None:
        """Return the seeds of the next full file; None if there is not enough for one.

        Args:
            certain: Whether not to wait for those that are expected before.
        """
        lost = {seed for file in self._files.to_repair.values() for seed in file.lost}
        sizes = {seed: held.size for seed, held in self._files.last.episodes.items()}
        sizes |= {seed: part.size for seed, part in self._waiting.items() if seed not in lost}
        if sum(sizes.values()) <= self._limit:
            return None
        missing = math.inf if certain else self._first_missing()
        seeds, total = list[int](), 0
        for seed in sorted(sizes):
            if seed > missing:
                return None
            total += sizes[seed]
            if seeds and total > self._limit:
                return seeds
            seeds.append(seed)
        return None

    def _first_missing(self) -> float:
        """Return the least seed that is expected and has not come."""
        came = self._waiting, self._files.seeds, self._given_up
        while self._coming and any(self._coming[0] in seeds for seeds in came):
            self._coming.popleft()
        return self._coming[0] if self._coming else math.inf

    def _fill_last(self, seeds: list[int]) -> None:
        """Write the last file with some episodes, and begin another one."""
        file = self._files.last
        header = {**self._header, **combined(file.sources)}
        encoder = replace(self.encoder, header=header)
        spilt = [seed for seed in file.episodes if seed not in set(seeds)]
        for seed, stored in self._files.read_groups(file, spilt) if spilt else ():
            write_part(self.parts, seed, encoder.encode_stored(stored), sync=True)
            self._waiting[seed] = _FinishedEpisode(stored.size, source_of(header))
        self._write(file, seeds, last=False)

    def _write(self, file: OpenFile, seeds: Iterable[int], *, last: bool) -> None:
        """Write a file and the manifest; then the parts that it was joined from are deleted."""
        parts = {s: part_path(self.parts, s) for s in seeds if s not in file.episodes}
        places = {s: parts.get(s) or file.episodes[s].group for s in sorted(seeds)}
        sources = {self._waiting[seed].source for seed in parts}
        self._files.write(file, places, sources, last=last)
        self._files.write_manifest()
        for seed, part in parts.items():
            part.unlink(missing_ok=True)
            self._waiting.pop(seed, None)

    def _join(self) -> None:
        for file in self._files.to_repair.values():
            if again := file.lost & self._waiting.keys():
                self._write(file, {*file.episodes, *again}, last=False)
        waiting = sum(part.size for part in self._waiting.values())
        certain = waiting > 2 * self._limit  # not much waits for few that lack
        while (full := self._full_file(certain=certain)) is not None:
            self._fill_last(full)
        last = self._files.last
        if seeds := {*last.episodes, *self._waiting}:
            self._write(last, seeds, last=True)
        else:
            self._files.write_empty()
        with suppress(OSError):  # something else was put there meanwhile, and is not ours to delete
            self.parts.rmdir()


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

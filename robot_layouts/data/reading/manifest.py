"""The manifest of a recording that has several files: which ones, their checksums and seeds.

It lies beside them and appears with the second file: ``trajectory.manifest.json`` beside
``trajectory.h5``, ``trajectory_0001.h5`` and so on. Each of them is a recording by itself.
"""

from __future__ import annotations

import errno
import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, TypedDict

from robot_layouts.core.files import open_regular, read_json
from robot_layouts.core.schema import Digest, FieldError, Name, check, exactly, length, whole
from robot_layouts.data.reading.summary import MAX_JSON, MAX_SEED, TrajectoryError
from robots import UnreadableFileError

FORMAT = "robot-layouts recording 1"
SUFFIX = ".manifest.json"
FILE_NUMBER = "file_number"  # what all files but the first say in json and attributes
FILE_SIZE = 200.0  # MB, at which another file is begun; some 6,000 episodes, opened in 0.15 s
MOST_FILES = 10_000
MOST_EPISODES = 10**7  # of all files: a few bytes of ranges must not become gigabytes of seeds
_BLOCK = 2**20  # bytes

_Count = Annotated[int, whole(0, MAX_SEED + 1)]
_Bytes = Annotated[int, whole(0, 2**53)]
_Seed = Annotated[int, whole(0, MAX_SEED)]


class _Sized(TypedDict):
    bytes: _Bytes
    sha256: Digest


class _File(TypedDict):
    file: Name
    h5: _Sized
    json: _Sized
    episodes: _Count
    successes: _Count
    steps: _Bytes
    seeds: list[Annotated[list[_Seed], length(2)]]


class _Manifest(TypedDict):
    format: Annotated[str, exactly(FORMAT)]
    task: Name
    header: Digest
    files: list[_File]


Span = tuple[int, int]  # first and last of a range of seeds


@dataclass(frozen=True)
class Sized:
    """A file's size (bytes) and its SHA-256."""

    bytes: int
    sha256: str


@dataclass(frozen=True)
class FileEntry:
    """What a manifest says about one of a recording's files.

    Attributes:
        h5: Its h5 file.
        json: The json beside that.
        episodes: How many episodes it holds.
        successes: How many of them ended in success.
        steps: Control steps of all of them.
        spans: Their seeds, ascending, as ranges.
    """

    h5: Sized
    json: Sized
    episodes: int
    successes: int
    steps: int
    spans: tuple[Span, ...]

    @property
    def seeds(self) -> list[int]:
        """The seeds of its episodes, in their order."""
        return [seed for first, last in self.spans for seed in range(first, last + 1)]

    def matches(self, path: Path) -> bool:
        """Tell whether an h5 file and its json are those that are meant, to the last byte."""
        return all(
            is_file_of(one, sized.bytes) and sized_file(one) == sized
            for one, sized in ((path.with_suffix(".json"), self.json), (path, self.h5))
        )


@dataclass(frozen=True)
class Manifest:
    """What a recording of several files consists of.

    Attributes:
        task_id: Id of the task that was recorded.
        header: SHA-256 of what the files have in common.
        files: What is known of each, in order; see `file_path`.
    """

    task_id: str
    header: str
    files: tuple[FileEntry, ...]


def manifest_path(path: Path) -> Path:
    """Return where the manifest of a recording is, given its first h5 file."""
    return path.with_name(f"{path.stem}{SUFFIX}")


def file_path(path: Path, number: int) -> Path:
    """Return one of a recording's h5 files, given the first, whose number is 0."""
    return path.with_name(f"{path.stem}_{number:04d}{path.suffix}") if number else path


def read_manifest(path: Path) -> Manifest | None:
    """Return the manifest of a recording, given its first h5 file; None if it has none.

    Raises:
        TrajectoryError: If it cannot be read, or is none.
    """
    place = manifest_path(path)
    try:
        found = read_json(place, MAX_JSON)
        check(found, _Manifest, "")
        return Manifest(found["task"], found["header"], tuple(_entries(path, found["files"])))
    except UnreadableFileError as error:
        if error.errno == errno.ENOENT:
            return None
        raise TrajectoryError(f"cannot read {place}: {error.strerror}") from error
    except FieldError as error:
        raise TrajectoryError(f"{place} is no manifest of a recording: {error}") from error


def manifest_text(manifest: Manifest, path: Path) -> str:
    """Return what is written of a manifest, given the first h5 file."""
    files = [_described(entry, file_path(path, i).name) for i, entry in enumerate(manifest.files)]
    about = {
        "format": FORMAT,
        "task": manifest.task_id,
        "header": manifest.header,
        **{name: sum(file[name] for file in files) for name in ("episodes", "successes", "steps")},
        "files": files,
    }
    return json.dumps(about, indent=1) + "\n"


def sized_file(path: Path) -> Sized:
    """Return the size and checksum of a file.

    Raises:
        UnreadableFileError: If it cannot be read.
    """
    digest, count = hashlib.sha256(), 0
    with open_regular(path) as file:
        while block := file.read(_BLOCK):
            digest.update(block)
            count += len(block)
    return Sized(count, digest.hexdigest())


def is_file_of(path: Path, size: int) -> bool:
    """Tell whether there is a file of so many bytes."""
    return path.is_file() and path.stat().st_size == size


def spans_of(seeds: Iterable[int]) -> tuple[Span, ...]:
    """Return ascending seeds as ranges."""
    listed = list(seeds)
    if not listed:
        return ()
    breaks = [i for i, (a, b) in enumerate(pairwise(listed), 1) if b != a + 1]
    bounds = pairwise([0, *breaks, len(listed)])
    return tuple((listed[first], listed[last - 1]) for first, last in bounds)


def _entries(path: Path, files: list[Mapping[str, Any]]) -> Iterable[FileEntry]:
    if len(files) > MOST_FILES:
        raise FieldError(f"it lists {len(files)} files; {MOST_FILES} are the most")
    if (count := sum(file["episodes"] for file in files)) > MOST_EPISODES:
        raise FieldError(f"it lists {count:,} episodes; {MOST_EPISODES:,} are the most")
    for number, file in enumerate(files):
        if file["file"] != file_path(path, number).name:
            raise FieldError(
                f"files[{number}].file is {file['file']!r}; it must be"
                f" {file_path(path, number).name!r}"
            )
        spans = tuple((first, last) for first, last in file["seeds"])
        bounds = [bound for span in spans for bound in span]
        apart = all(a < b for (_, a), (b, _) in pairwise(spans))
        if bounds != sorted(bounds) or not apart:
            raise FieldError(f"files[{number}].seeds are not ascending ranges")
        if sum(last - first + 1 for first, last in spans) != file["episodes"]:
            raise FieldError(f"files[{number}].seeds are not those of so many episodes")
        yield FileEntry(
            Sized(**{name: file["h5"][name] for name in ("bytes", "sha256")}),
            Sized(**{name: file["json"][name] for name in ("bytes", "sha256")}),
            episodes=file["episodes"],
            successes=file["successes"],
            steps=file["steps"],
            spans=spans,
        )


def _described(entry: FileEntry, name: str) -> dict[str, Any]:
    return {
        "file": name,
        "h5": vars(entry.h5),
        "json": vars(entry.json),
        "episodes": entry.episodes,
        "successes": entry.successes,
        "steps": entry.steps,
        "seeds": [list(span) for span in entry.spans],
    }

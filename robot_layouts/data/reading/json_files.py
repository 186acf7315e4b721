"""The json files of a recording: one beside each h5 file, and a manifest if there are several.

ManiSkill writes the former, too. The manifest says which files belong together, with their
checksums and seeds; it appears with the second: ``trajectory.manifest.json`` beside
``trajectory.h5``, ``trajectory_0001.h5`` and so on. Each of these is a recording by itself.
"""

from __future__ import annotations

import errno
import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from os import PathLike
from pathlib import Path
from typing import Annotated, Any

from typing_extensions import NotRequired, TypedDict

from robot_layouts.core.files import open_regular, read_json
from robot_layouts.core.schema import (
    AnyText,
    Digest,
    FieldError,
    Finite,
    Name,
    Object,
    check,
    exactly,
    length,
    whole,
)
from robots import CONTROL_MODES, RobotLayoutsError, UnreadableFileError

MAX_JSON = 2**28  # bytes; some 600,000 episodes
MAX_STEPS = 10**6  # of an episode; fourteen hours at 20 Hz
MAX_SEED = 2**32 - 1  # of NumPy's generators

_Seed = Annotated[int, whole(0, MAX_SEED)]
_Seeds = _Seed | list[_Seed] | None
_Steps = Annotated[int, whole(1, MAX_STEPS)]
_Mode = Name | dict[str, Name]
FILE = "trajectory.h5"  # the first of a recording
FORMAT = "robot-layouts recording 1"
SUFFIX = ".manifest.json"
FILE_NUMBER = "file_number"  # what all files but the first say in json and attributes
FILE_SIZE = 200.0  # MB, at which another file is begun; some 6,000 episodes, opened in 0.15 s
MOST_FILES = 10_000
MOST_EPISODES = 10**7  # of all files: a few bytes of ranges must not become gigabytes of seeds
_BLOCK = 2**20  # bytes

_Count = Annotated[int, whole(0, MAX_SEED + 1)]
_Bytes = Annotated[int, whole(0, 2**53)]


class _Reset(TypedDict, total=False):
    seed: _Seeds
    options: Object | None


class _ActorJson(TypedDict):
    kind: Name
    name: AnyText
    sha256: NotRequired[AnyText | None]


class _Source(TypedDict):
    kind: Name
    actors: NotRequired[list[_ActorJson]]
    corrects: NotRequired[_ActorJson]


class _Played(TypedDict, total=False):
    control_mode: _Mode | None
    reset_kwargs: _Reset | None
    success: bool | Finite | None
    source: _Source | None
    drawn: Object | None
    reason: AnyText | None


class OwnEpisode(_Played):
    """An episode's own note in a recording of this library, which becomes its entry in the json."""

    episode_seed: _Seed
    elapsed_steps: _Steps


class _Episode(_Played):
    episode_id: Annotated[int, whole(0, 2**31 - 1)]
    episode_seed: NotRequired[_Seeds]
    elapsed_steps: NotRequired[_Steps | None]


class _EnvKwargs(TypedDict, total=False):
    control_mode: _Mode | None
    sim_backend: Name | None


class _EnvInfo(TypedDict):
    env_id: Name
    env_kwargs: NotRequired[_EnvKwargs | None]
    max_episode_steps: NotRequired[_Steps | None]
    module: NotRequired[Name | None]


class _Summary(TypedDict):
    env_info: _EnvInfo
    episodes: list[_Episode]
    source_type: NotRequired[AnyText | None]
    source_desc: NotRequired[AnyText | None]


class TrajectoryError(RobotLayoutsError, ValueError):
    """A file of recorded episodes that cannot be read, or is for something else."""


@dataclass(frozen=True)
class EpisodeEntry:
    """What the json says about an episode.

    Attributes:
        episode_id: Its number in the file.
        seed: Seed of its reset; None if there is none, or several.
        episode_seed: The same as the recording's own note of it, which may be absent.
        steps: Its control steps, or None.
        rebuilt: Whether its reset rebuilt the world.
        success: Whether it ended in success, or None.
        source: Who acted; see `tasks.episode.PlayedEpisode`.
        drawn: What was varied in its world; likewise.
        reason: Why it failed, in words; likewise.
    """

    episode_id: int
    seed: int | None
    episode_seed: int | None
    steps: int | None
    rebuilt: bool
    success: bool | None = None
    source: dict[str, Any] | None = None
    drawn: dict[str, Any] | None = None
    reason: str = ""

    @property
    def group(self) -> str:
        """The name of its group in the h5 file."""
        return f"traj_{self.episode_id}"


@dataclass(frozen=True)
class RecordingSummary:
    """What the json says about a recording.

    Attributes:
        task_id: Id of the task that was recorded.
        module: Module of a user's own that registers it, or None.
        env_kwargs: What native's environment was made with.
        control_mode: Control mode of every episode, or those of arms: by their names in the
            layout, or by native's of robots.
        max_episode_steps: Control steps until an episode was truncated, or None.
        source_type: Where the actions come from, in ManiSkill's words, or None.
        source_desc: The same in the recorder's own words, or None.
        episodes: Its episodes, in order.
    """

    task_id: str
    module: str | None
    env_kwargs: dict[str, Any]
    control_mode: str | dict[str, str]
    max_episode_steps: int | None
    source_type: str | None
    source_desc: str | None
    episodes: tuple[EpisodeEntry, ...]


def read_summary(path: Path) -> RecordingSummary:
    """Return what the json beside an h5 file says.

    Raises:
        TrajectoryError: If it cannot be read, is of another kind, or names no control mode in
            which all episodes can be played.
    """
    found = _read(path)
    info, episodes = found["env_info"], found["episodes"]
    env_kwargs = info.get("env_kwargs") or {}
    return RecordingSummary(
        task_id=info["env_id"],
        module=info.get("module"),
        env_kwargs=env_kwargs,
        control_mode=_common_mode(
            path, episodes, env_kwargs.get("control_mode"), own="layout" in found
        ),
        max_episode_steps=info.get("max_episode_steps"),
        source_type=found.get("source_type"),
        source_desc=found.get("source_desc"),
        episodes=tuple(_entry(episode) for episode in episodes),
    )


def recorded_task(path: Path) -> str:
    """Return the id of the task that a file was recorded in, from the json beside it.

    Raises:
        TrajectoryError: If the json cannot be read.
    """
    return _read(path)["env_info"]["env_id"]


def describe_source(entry: EpisodeEntry, summary: RecordingSummary) -> str:
    """Return the name of an episode's source: who acted, and who corrected."""
    source = entry.source
    if source is None:
        named = (summary.source_type, summary.source_desc)
        return " ".join(filter(None, named)) or "unknown"
    actors: list[Mapping[str, Any]] = source.get("actors") or [source]
    words = " and ".join(f"{a.get('kind', '')} {a.get('name', '')}".strip() for a in actors)
    corrected: Mapping[str, Any] | None = source.get("corrects")
    return words + (f", correcting {corrected.get('name', '')}" if corrected else "")


def _read(path: Path) -> dict[str, Any]:
    beside = path.with_suffix(".json")
    try:
        found = read_json(beside, MAX_JSON)
    except UnreadableFileError as error:
        if error.errno is None:
            raise TrajectoryError(
                f"{beside} is not a demonstration's json: {error.strerror}"
            ) from error
        raise TrajectoryError(
            f"cannot read {beside}, which belongs beside {path.name}: {error.strerror}"
        ) from error
    try:
        check(found, _Summary, "")
    except FieldError as error:
        raise TrajectoryError(f"{beside} is not a demonstration's json: {error}") from error
    listed = [episode["episode_id"] for episode in found["episodes"]]
    if len(set(listed)) != len(listed):
        raise TrajectoryError(f"{beside} lists an episode twice")
    return found


def _entry(episode: Mapping[str, Any]) -> EpisodeEntry:
    reset: Mapping[str, Any] = episode.get("reset_kwargs") or {}
    options: Mapping[str, Any] = reset.get("options") or {}
    return EpisodeEntry(
        episode_id=episode["episode_id"],
        seed=_only(reset.get("seed")),
        episode_seed=_only(episode.get("episode_seed")),
        steps=episode.get("elapsed_steps"),
        rebuilt=bool(options.get("reconfigure")),
        success=None if episode.get("success") is None else bool(episode["success"]),
        source=episode.get("source"),
        drawn=episode.get("drawn"),
        reason=episode.get("reason") or "",
    )


def _only(seed: int | list[int] | None) -> int | None:
    """Return a seed, which native writes as a list where environments are vectors."""
    if isinstance(seed, list):
        return seed[0] if len(seed) == 1 else None
    return seed


def _common_mode(
    path: Path, episodes: list[Mapping[str, Any]], default: Any, *, own: bool
) -> str | dict[str, str]:
    """Return the control mode of all episodes.

    Args:
        path: The recording.
        episodes: Their json.
        default: What the environment was made with.
        own: Whether this library recorded it, perhaps in a mode of a robot's own.
    """
    given = [episode.get("control_mode", default) for episode in episodes] or [default]
    mixed = default if isinstance(default, Mapping) else given[0]
    modes = sorted({mode for each in given for mode in _modes(each)} or _modes(default))
    if modes and (own or set(modes) <= set(CONTROL_MODES)):
        if len(modes) == 1 and not isinstance(default, Mapping):
            return modes[0]
        if isinstance(mixed, Mapping) and all(each == given[0] for each in given):
            return dict(mixed)
    listing = " and ".join(modes[:4]) or "no control mode that it names"
    raise TrajectoryError(
        f"{path} was recorded in {listing}; an episode can be played in one of"
        f" {', '.join(CONTROL_MODES)}, or each arm in one of its own"
    )


def _modes(mode: str | Mapping[str, str] | None) -> set[str]:
    if mode is None:
        return set()
    return {mode} if isinstance(mode, str) else set(mode.values())


class Sized(TypedDict):
    """A file's size (bytes) and its SHA-256."""

    bytes: _Bytes
    sha256: Digest


class FileEntry(TypedDict):
    """What a manifest says about one of a recording's files.

    Attributes:
        file: The name of its h5 file.
        h5: That file.
        json: The json beside it.
        episodes: How many episodes it holds.
        successes: How many of them ended in success.
        steps: Control steps of all of them.
        seeds: Their seeds, ascending, as ranges: the first and the last of each.
    """

    file: Name
    h5: Sized
    json: Sized
    episodes: _Count
    successes: _Count
    steps: _Bytes
    seeds: list[Annotated[list[_Seed], length(2)]]


class _Manifest(TypedDict):
    format: Annotated[str, exactly(FORMAT)]
    task: Name
    header: Digest
    files: list[FileEntry]


@dataclass(frozen=True)
class RecordingManifest:
    """What a recording of several files consists of.

    Attributes:
        task_id: Id of the task that was recorded.
        header: SHA-256 of what the files have in common.
        files: What is known of each, in order; see `file_path`.
    """

    task_id: str
    header: str
    files: list[FileEntry]


def manifest_path(path: Path) -> Path:
    """Return where the manifest of a recording is, given its first h5 file."""
    return path.with_name(f"{path.stem}{SUFFIX}")


def file_path(path: Path, number: int) -> Path:
    """Return one of a recording's h5 files, given the first, whose number is 0."""
    return path.with_name(f"{path.stem}_{number:04d}{path.suffix}") if number else path


def read_manifest(path: Path) -> RecordingManifest | None:
    """Return the manifest of a recording, given its first h5 file; None if it has none.

    Raises:
        TrajectoryError: If it cannot be read, or is no manifest.
    """
    place = manifest_path(path)
    try:
        found = check(read_json(place, MAX_JSON), _Manifest, "")
        _expect_entries(path, found["files"])
        return RecordingManifest(found["task"], found["header"], found["files"])
    except UnreadableFileError as error:
        if error.errno == errno.ENOENT:
            return None
        raise TrajectoryError(f"cannot read {place}: {error.strerror}") from error
    except FieldError as error:
        raise TrajectoryError(f"{place} is no manifest of a recording: {error}") from error


def manifest_text(manifest: RecordingManifest) -> str:
    """Return what is written of a manifest."""
    files = manifest.files
    about = {
        "format": FORMAT,
        "task": manifest.task_id,
        "header": manifest.header,
        **{name: sum(file[name] for file in files) for name in ("episodes", "successes", "steps")},
        "files": files,
    }
    return json.dumps(about, indent=1) + "\n"


def seeds_of(entry: FileEntry) -> list[int]:
    """Return the seeds of a file's episodes, in their order."""
    return [seed for first, last in entry["seeds"] for seed in range(first, last + 1)]


def matches(entry: FileEntry, path: Path) -> bool:
    """Tell whether an h5 file and its json are those that are meant, to the last byte."""
    pairs = (path.with_suffix(".json"), entry["json"]), (path, entry["h5"])
    return all(
        one.is_file() and one.stat().st_size == sized["bytes"] and sized_file(one) == sized
        for one, sized in pairs
    )


def sized_file(path: str | PathLike[str]) -> Sized:
    """Return the size and checksum of a file.

    Raises:
        UnreadableFileError: If it cannot be read.
    """
    digest, count = hashlib.sha256(), 0
    with open_regular(path) as file:
        while block := file.read(_BLOCK):
            digest.update(block)
            count += len(block)
    return Sized(bytes=count, sha256=digest.hexdigest())


def spans_of(seeds: Iterable[int]) -> list[list[int]]:
    """Return ascending seeds as ranges: the first and the last of each."""
    spans: list[list[int]] = []
    for seed in seeds:
        if spans and seed == spans[-1][1] + 1:
            spans[-1][1] = seed
        else:
            spans.append([seed, seed])
    return spans


def _expect_entries(path: Path, files: list[FileEntry]) -> None:
    """Refuse files that are not those of a recording, or too many."""
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
        bounds = [bound for span in file["seeds"] for bound in span]
        apart = all(a < b for (_, a), (b, _) in pairwise(file["seeds"]))
        if bounds != sorted(bounds) or not apart:
            raise FieldError(f"files[{number}].seeds are not ascending ranges")
        if sum(last - first + 1 for first, last in file["seeds"]) != file["episodes"]:
            raise FieldError(f"files[{number}].seeds are not those of so many episodes")

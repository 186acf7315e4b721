"""Writes episodes in ManiSkill's own trajectory format, h5 with a json beside it."""

from __future__ import annotations

import glob
import json
import os
import weakref
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple

from robots import CONTROL_MODES, RecordingError, UnreadableFileError
from robots.common.files import open_regular, read_text
from robots.common.writing import PARTIAL, write_whole
from robots.control_modes import plain_mode
from rollouts.reading.guessed_robots import describe_guessed
from rollouts.reading.provenance import describe_layout, describe_simulation, differences, listing
from rollouts.reading.summary import MAX_JSON
from rollouts.recording.disk import claim, disk_errors
from rollouts.recording.episode_files import (
    PartWriter,
    list_earlier_parts,
    list_parts,
    part_path,
    read_part,
    refuse_foreign,
    seed_of,
)
from rollouts.recording.trajectory_writer import join, read_joined
from rollouts.sources.header import Source, combined, source_of
from tasks import MultiRobotTask
from tasks.episode import PlayedEpisode
from tasks.native.format import observation_keys
from tasks.registry import full_name

__all__ = ["Recorder", "describe_layout"]

# What may change from one resumption to the next, and what earlier versions did not write.
NOT_COMPARED = ("source_type", "source_desc", "guessed")


class _Entry(NamedTuple):
    """An episode of the h5 file: its group there, and its json."""

    group: str
    about: dict[str, Any]


class Recorder:
    """A recording that grows by whole episodes; whatever ends it, the finished ones stay.

    Each finished episode is a file of its own in a folder beside the recording, until `close`
    joins them in the order of their seeds. If the process is killed before, the next Recorder
    that resumes the recording finds them there.

    In the h5 file ``traj_i`` holds the flat actions (T, A), env states (T + 1, k), rewards and
    flags (T,). Its attribute ``action_split`` is json: robot name → first and last + 1 action
    number. The file's attributes ``layout`` and ``simulation`` are json too; see
    `rollouts.reading.provenance`.

    Attributes:
        path: The h5 file.
        json_path: The json file beside it.
        parts: The folder of finished episodes that are not joined yet.
        damaged: Episodes that were there and are damaged, by their files or groups, in words;
            they do not count as recorded.
        writer: Writes one episode; may be handed to worker processes.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        task: MultiRobotTask,
        *,
        overwrite: bool = False,
        resume: bool = False,
        source: str = "scripted",
        source_desc: str | None = None,
    ) -> None:
        """Begin a recording, or go on with one.

        Args:
            path: Name of the h5 file; its folder is made.
            task: The task whose episodes are recorded.
            overwrite: Whether a recording that is already there may be replaced.
            resume: Whether to keep the episodes that are already there.
            source: Where the actions come from, in ManiSkill's words (``source_type``).
            source_desc: The same in your own words.

        Raises:
            RecordingError: If there is a recording already and neither ``overwrite`` nor
                ``resume``, it is of something else or in use by another process, or the folder
                cannot be written.
            AssetError: If robot files cannot be found.
        """
        self.path = Path(path)
        self.json_path = self.path.with_suffix(".json")
        self.parts = self.path.with_suffix(".parts")
        self.damaged: list[str] = []
        self._header = _header(task, source, source_desc)
        self._sources: set[Source] = set()  # of the episodes that are there already
        self._left: set[int] = set()  # seeds of those that are not joined yet
        with disk_errors(self.path):
            self.path.parent.mkdir(parents=True, exist_ok=True)
            if os.path.lexists(self.parts) and not self.parts.is_dir():
                raise RecordingError(f"{self.parts} is no folder; move it somewhere else")
            lock = claim(self.parts)
            if lock is None:
                raise RecordingError(f"another process is recording into {self.parts}")
            try:
                self._joined = self._begin(overwrite=overwrite, resume=resume)
            except BaseException:
                with suppress(OSError):  # not empty
                    self.parts.rmdir()
                os.close(lock)
                raise
        self._release = weakref.finalize(self, os.close, lock)
        self.writer = PartWriter(self.parts.absolute(), self._header, _control_mode(task))
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
        """Seeds of all episodes recorded, those that worker processes wrote included."""
        return {*self._joined, *(seed_of(part) for part in list_parts(self.parts))}

    def add(self, episode: PlayedEpisode) -> None:
        """Write one episode; it is kept when this returns.

        Raises:
            RecordingError: If it cannot be written; the episodes before it stay. Also if there
                is one of that seed already, or the recording was closed.
        """
        if self._closed:
            raise RecordingError(f"cannot write {self.path}: the recording was closed")
        if episode.seed in self._joined or part_path(self.parts, episode.seed).exists():
            raise RecordingError(f"{self.path} has an episode of seed {episode.seed} already")
        self.writer.write(episode)

    def close(self) -> None:
        """Join the episodes into the h5 file and write the json; closing twice is allowed.

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

    def _begin(self, *, overwrite: bool, resume: bool) -> dict[int, _Entry]:
        """Check and tidy what is there; returns the episodes of the h5 file by seed."""
        for path in (self.path, self.json_path):
            _expect_file_or_nothing(path)
        refuse_foreign(self.parts)
        earlier = list_earlier_parts(self.parts)
        there = [p for p in (self.path, *list_parts(self.parts), *earlier) if p.exists()]
        if there and not (overwrite or resume):
            raise RecordingError(
                f"{there[0]} is there already; choose another name, or pass overwrite=True to"
                " replace the recording or resume=True to go on with it"
            )
        for left_over in (*self.parts.glob(f"*{PARTIAL}"), *self.path.parent.glob(self._partials)):
            left_over.unlink(missing_ok=True)
        if overwrite:
            for path in (self.json_path, *there):
                path.unlink(missing_ok=True)
        elif earlier:
            raise RecordingError(
                f"{earlier[0]} is one of {len(earlier)} episodes that an earlier version of this"
                " library left when it was interrupted; go on with that version until it ends, or"
                " choose another folder, or delete them to have them recorded again"
            )
        joined = self._read_joined()
        for part in list_parts(self.parts):
            self._check_part(part, joined)
        return joined

    @property
    def _partials(self) -> str:
        return f"{glob.escape(self.path.stem)}.*{PARTIAL}"

    def _read_joined(self) -> dict[int, _Entry]:
        if not self.path.exists():
            return {}
        joined = read_joined(self.path)
        self._expect_same(self.path, joined.header)
        if joined.episodes:
            self._sources.add(source_of(joined.header))
        self.damaged += [f"{name} of {self.path}" for name in joined.damaged]
        entries = {
            about["episode_seed"]: _Entry(name, about) for name, about in joined.episodes.items()
        }
        return {seed: entries[seed] for seed in sorted(entries)}

    def _check_part(self, part: Path, joined: Mapping[int, _Entry]) -> None:
        """Refuse a part of another recording; remove one that is damaged or already joined."""
        try:
            header, _ = read_part(part)
        except RecordingError:  # by a power cut, say: its episode is recorded again
            self.damaged.append(str(part))
            part.unlink()
            return
        self._expect_same(part, header)
        if seed_of(part) in joined:
            part.unlink()
        else:
            self._sources.add(source_of(header))
            self._left.add(seed_of(part))

    def _expect_same(self, path: Path, header: Mapping[str, Any]) -> None:
        found = differences(_compared(header), _compared(self._header))
        if found:
            raise RecordingError(
                f"{path} was recorded with something else, so this recording cannot go on there"
                f" ({listing(found)}); choose another folder"
            )

    def _join(self) -> None:
        parts = {seed_of(part): part for part in list_parts(self.parts)}
        if not self._sources or parts.keys() - self._left:
            self._sources.add(source_of(self._header))
        header = {**self._header, **combined(self._sources)}
        numbered = [entry.group for entry in self._joined.values()]
        in_order = numbered == [f"traj_{number}" for number in range(len(numbered))]
        if parts or self.damaged or not in_order or not self.path.exists():
            places = {**{seed: entry.group for seed, entry in self._joined.items()}, **parts}
            seeds = sorted(places)
            joined = join(self.path, header, [places[seed] for seed in seeds])
            self._joined = {
                seed: _Entry(*entry) for seed, entry in zip(seeds, joined.items(), strict=True)
            }
        abouts = enumerate(entry.about for entry in self._joined.values())
        episodes = [{"episode_id": number, **about} for number, about in abouts]
        text = json.dumps({**header, "episodes": episodes}, indent=1) + "\n"
        if not self._json_says(text):
            write_whole(self.json_path, text, RecordingError, parents=False)
        for part in parts.values():
            part.unlink(missing_ok=True)
        with suppress(OSError):  # something else was put there meanwhile, and is not ours to delete
            self.parts.rmdir()

    def _json_says(self, text: str) -> bool:
        try:
            return read_text(self.json_path, MAX_JSON) == text
        except UnreadableFileError:
            return False


def _header(task: MultiRobotTask, source: str, source_desc: str | None) -> dict[str, Any]:
    """Return what the json and the attributes of every file say about all episodes."""
    name, guessed = full_name(type(task)), describe_guessed(task.scenario.layout)
    return {
        "env_info": {
            "env_id": task.task_id,
            **({"module": name.rpartition(":")[0]} if ":" in name else {}),
            "env_kwargs": {
                "obs_mode": "none",
                "reward_mode": task.reward_mode,
                "control_mode": plain_mode(task.control_mode),
                "sim_backend": "physx_cpu",
            },
            "max_episode_steps": task.max_episode_steps,
        },
        "source_type": source,
        "source_desc": source_desc,
        "layout": describe_layout(task.layout),
        "simulation": describe_simulation(task),
        **({"guessed": guessed} if guessed else {}),
    }


def _compared(header: Mapping[str, Any]) -> dict[str, Any]:
    about = {name: value for name, value in header.items() if name not in NOT_COMPARED}
    if isinstance(info := about.get("env_info"), dict):
        about["env_info"] = {name: value for name, value in info.items() if name != "module"}
    return about


def _expect_file_or_nothing(path: Path) -> None:
    """Refuse a path at which there is something that is no file, before anything is recorded."""
    if os.path.lexists(path) and path.exists():
        try:
            open_regular(path).close()
        except UnreadableFileError as error:
            raise RecordingError(f"cannot write {path}: {error.strerror}") from error


def _control_mode(task: MultiRobotTask) -> str | dict[str, str]:
    """Return the control mode as native writes it: by robot where there are several.

    Where the arms of a robot have modes of their own, it is the mode by arm.
    """
    mode, keys = task.control_mode, observation_keys(task.layout)
    if isinstance(mode, str):
        return mode if None in keys.values() else {str(key): mode for key in keys.values()}
    modes = {task.layout.arm_name(arm): own for arm, own in mode.items()}
    by_arm = {
        arm: modes.get(arm, modes.get(task.layout.owner(arm), CONTROL_MODES[0]))
        for arm in task.layout.arms
    }
    if None in keys.values() or set(by_arm) != set(task.layout):
        return by_arm
    return {str(keys[robot]): own for robot, own in by_arm.items()}

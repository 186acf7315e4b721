"""Finished episodes as one small h5 file each, and how they are joined into one."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Generator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py

from robots import RecordingError
from rollouts.episode import REBUILT, Episode

PARTIAL = ".partial"

_PART = "traj_0"  # the only episode of a part, which is nearly in ManiSkill's format itself
_HEADER = "header"  # attribute of a part; in a recording each of its entries is an attribute
_FORMAT = "v108"  # HDF5 1.8, the first in which attributes may be larger than 64 kB


@dataclass(frozen=True)
class Stored:
    """Where an episode is stored.

    Attributes:
        path: The h5 file.
        group: Its group there.
        about: Its entry in the json, without ``episode_id``.
    """

    path: Path
    group: str
    about: Mapping[str, Any]


@dataclass(frozen=True)
class PartWriter:
    """Writes finished episodes into a folder; worker processes each have a copy.

    Attributes:
        folder: Where to write.
        header: What the episodes have in common; every part carries it.
        control_mode: Control mode as ManiSkill writes it: by robot where there are several.
    """

    folder: Path
    header: Mapping[str, Any]
    control_mode: str | dict[str, str]
    _text: str = field(init=False, repr=False)
    _split: str = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Write as text once what all parts say."""
        split = {name: robot["action"] for name, robot in self.header["layout"].items()}
        object.__setattr__(self, "_text", json.dumps(self.header))
        object.__setattr__(self, "_split", json.dumps(split))

    def write(self, episode: Episode) -> None:
        """Write one episode; it is there, whole, when this returns, or not at all.

        Raises:
            RecordingError: If it cannot be written.
        """
        self.store(episode.seed, self.encode(episode))

    def store(self, seed: int, part: bytes) -> None:
        """Write an episode that was encoded, perhaps on another machine; else as `write`."""
        path = part_path(self.folder, seed)
        partial = path.with_name(f"{path.name}.{os.getpid()}{PARTIAL}")
        with disk_errors(path):
            try:
                partial.write_bytes(part)
                os.replace(partial, path)
            except OSError:
                with suppress(OSError):
                    partial.unlink()
                raise

    def encode(self, episode: Episode) -> bytes:
        """Return what `write` writes."""
        # In memory, because HDF5 does not recover from a disk that is full.
        with h5py.File(
            "part", "w", driver="core", backing_store=False, libver=(_FORMAT, "latest")
        ) as file:
            file.attrs[_HEADER] = self._text
            group = file.create_group(_PART)
            group.attrs["action_split"] = self._split
            group.attrs["episode"] = json.dumps(self._about(episode))
            group.create_dataset("actions", data=episode.actions)
            for kind, entries in episode.states.items():
                for name, rows in entries.items():
                    group.create_dataset(f"env_states/{kind}/{name}", data=rows)
            for name in ("rewards", "success", "terminated", "truncated"):
                group.create_dataset(name, data=getattr(episode, name))
            file.flush()
            return file.id.get_file_image()

    def _about(self, episode: Episode) -> dict[str, Any]:
        return {
            "episode_seed": episode.seed,
            "control_mode": self.control_mode,
            "elapsed_steps": len(episode.actions),
            "reset_kwargs": {"seed": episode.seed, "options": REBUILT},
            "success": episode.solved,
        }


def part_path(folder: Path, seed: int) -> Path:
    """Return the part of a seed; names sort as seeds do."""
    return folder / f"seed-{seed:010d}.h5"


def seed_of(part: Path) -> int:
    """Return the seed of a part, from its name."""
    return int(part.stem.removeprefix("seed-"))


def list_parts(folder: Path) -> list[Path]:
    """Return the parts in a folder, sorted by seed; none if there is no folder."""
    return sorted(folder.glob("seed-*.h5"))


def read_stored(path: Path) -> tuple[dict[str, Any], list[Stored]]:
    """Return the header of a file that was written here, and its episodes.

    Raises:
        RecordingError: If it was not written here, or is damaged.
    """
    try:
        with h5py.File(path, "r") as file:
            header = {name: json.loads(text) for name, text in file.attrs.items()}
            header = header.get(_HEADER, header)
            stored = [
                Stored(path, name, json.loads(group.attrs["episode"]))
                for name, group in file.items()
            ]
    except (OSError, RuntimeError, KeyError, ValueError, TypeError, AttributeError) as error:
        raise RecordingError(
            f"{path} is no recording of this library, or it is damaged: {error}"
        ) from error
    return header, stored


def join(path: Path, header: Mapping[str, Any], episodes: Sequence[Stored]) -> None:
    """Write episodes into one h5 file, numbered in the order given, in place of what is there.

    Args:
        path: The file; it is replaced in one step, when the new one is complete and on the disk.
        header: What the episodes have in common.
        episodes: What to join; some may be in the present file, the others are parts.

    Raises:
        RecordingError: If it cannot be written, or an episode not be read; nothing is changed.
    """
    partial = path.with_name(path.name + PARTIAL)
    with disk_errors(path):
        try:
            with ExitStack() as stack:
                file = stack.enter_context(h5py.File(partial, "w", libver=(_FORMAT, "latest")))
                for name, value in header.items():
                    file.attrs[name] = json.dumps(value)
                present = stack.enter_context(h5py.File(path, "r")) if path.exists() else None
                for number, stored in enumerate(episodes):
                    if present is not None and stored.path == path:
                        present.copy(stored.group, file, f"traj_{number}")
                    else:
                        with h5py.File(stored.path, "r") as part:
                            part.copy(stored.group, file, f"traj_{number}")
            _sync(partial)
            os.replace(partial, path)
        except BaseException:
            with suppress(OSError):
                partial.unlink()
            raise


def json_text(summary: Mapping[str, Any]) -> str:
    """Return a json file's text."""
    return json.dumps(summary, indent=1) + "\n"


def write_json(path: Path, summary: Mapping[str, Any]) -> None:
    """Replace a json file in one step.

    Raises:
        RecordingError: If it cannot be written.
    """
    partial = path.with_name(path.name + PARTIAL)
    with disk_errors(path):
        try:
            partial.write_text(json_text(summary))
            os.replace(partial, path)
        except OSError:
            with suppress(OSError):
                partial.unlink()
            raise


@contextmanager
def disk_errors(path: Path) -> Generator[None]:
    """Turn what the disk refuses into one of our errors; h5py says it in several ways."""
    try:
        yield
    except RecordingError:
        raise
    except (OSError, RuntimeError, ValueError) as error:
        raise RecordingError(f"cannot write {path}: {_reason(error)}") from error


def _reason(error: Exception) -> str:
    """Return what the operating system said, out of the page that HDF5 makes of it."""
    number = re.search(r"errno = (\d+)", str(error))
    if number is not None:
        return os.strerror(int(number[1]))
    return (error.strerror if isinstance(error, OSError) else None) or str(error)


def _sync(path: Path) -> None:
    with path.open("rb") as stream:
        os.fsync(stream.fileno())

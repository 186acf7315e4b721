"""Finished episodes, each in a small file of its own until the recording ends.

A part is a line that says what it is, two lines of json, the bytes of its arrays, and a checksum of
all that. It is written
while episodes are played, where an h5 file of as many arrays would cost fifteen times as much.
"""

from __future__ import annotations

import json
import math
import os
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robots import RecordingError
from rollouts.disk import replaced
from rollouts.episode import REBUILT, Episode

_SUFFIX = ".part"
_EARLIER = ".h5"
_OPENING = b"robot-layouts episode 1\n"
_CHECKSUM = 4  # bytes


@dataclass(frozen=True)
class Stored:
    """What is stored of an episode.

    Attributes:
        attributes: Attributes of its group in the h5 file; ``episode`` is its entry in the json,
            without ``episode_id``.
        arrays: The arrays of that group by their names there, as ``env_states/actors/cube``.
    """

    attributes: Mapping[str, str]
    arrays: Mapping[str, NDArray[Any]]

    @property
    def about(self) -> dict[str, Any]:
        """Its entry in the json, without ``episode_id``."""
        return json.loads(self.attributes["episode"])


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
    _text: bytes = field(init=False, repr=False)
    _split: str = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Write as text once what all parts say."""
        split = {name: robot["action"] for name, robot in self.header["layout"].items()}
        object.__setattr__(self, "_text", json.dumps(self.header).encode())
        object.__setattr__(self, "_split", json.dumps(split))

    def write(self, episode: Episode) -> None:
        """Write one episode; it is there, whole, when this returns, or not at all.

        Raises:
            RecordingError: If it cannot be written.
        """
        self.store(episode.seed, self.encode(episode))

    def store(self, seed: int, part: bytes) -> None:
        """Write an episode that was encoded, perhaps on another machine; else as `write`."""
        with replaced(part_path(self.folder, seed), f".{os.getpid()}") as partial:
            partial.write_bytes(part)

    def encode(self, episode: Episode) -> bytes:
        """Return what `write` writes."""
        arrays = _arrays(episode)
        about = {
            "attributes": {
                "action_split": self._split,
                "episode": json.dumps(self._about(episode)),
            },
            "arrays": [(name, rows.dtype.str, rows.shape) for name, rows in arrays.items()],
        }
        numbers = [rows.tobytes() for rows in arrays.values()]
        content = b"".join(
            [_OPENING, self._text, b"\n", json.dumps(about).encode(), b"\n", *numbers]
        )
        return content + _checksum(content)

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
    return folder / f"seed-{seed:010d}{_SUFFIX}"


def seed_of(part: Path) -> int:
    """Return the seed of a part, from its name."""
    return int(part.stem.removeprefix("seed-"))


def list_parts(folder: Path) -> list[Path]:
    """Return the parts in a folder, sorted by seed; none if there is no folder."""
    return sorted(folder.glob(f"seed-*{_SUFFIX}"))


def list_earlier_parts(folder: Path) -> list[Path]:
    """Return the parts that an earlier version left in a folder, which are not read any more."""
    return sorted(folder.glob(f"seed-*{_EARLIER}"))


def read_part(path: Path) -> tuple[bytes, Stored]:
    """Return the header of a part, as json, and its episode.

    Raises:
        RecordingError: If it is damaged.
        OSError: If it cannot be read.
    """
    content = path.read_bytes()
    whole, checksum = content[:-_CHECKSUM], content[-_CHECKSUM:]
    if not whole.startswith(_OPENING) or checksum != _checksum(whole):
        raise RecordingError(f"{path} is damaged, or not an episode of this library")
    header, about, numbers = whole.removeprefix(_OPENING).split(b"\n", 2)
    said = json.loads(about)
    arrays: dict[str, NDArray[Any]] = {}
    start = 0
    for name, kind, shape in said["arrays"]:
        rows = np.frombuffer(numbers, kind, math.prod(shape), start)
        arrays[name] = rows.reshape(shape).copy()  # which also aligns it
        start += rows.nbytes
    return header, Stored(said["attributes"], arrays)


def _arrays(episode: Episode) -> dict[str, NDArray[Any]]:
    arrays: dict[str, NDArray[Any]] = {"actions": episode.actions}
    for kind, entries in episode.states.items():
        arrays.update({f"env_states/{kind}/{name}": rows for name, rows in entries.items()})
    for name in ("rewards", "success", "terminated", "truncated"):
        arrays[name] = getattr(episode, name)
    return arrays


def _checksum(content: bytes) -> bytes:
    return zlib.crc32(content).to_bytes(_CHECKSUM, "little")

"""A small recording to damage, made once per process, and ways to read it."""

from __future__ import annotations

import functools
import json
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np

import tasks
from robot_layouts.data.reading.recording import Recording
from robot_layouts.data.recording.recorder import Recorder
from tasks.episode import play

if TYPE_CHECKING:
    from robot_layouts.data.reading.recording import Trajectory
    from robot_layouts.data.recording.recorder import Recorder
    from tasks import TaskEnv

AREA = "recordings"
TASK, ACTIONS, LENGTHS, SEEDS = "PushT-v1", 7, (3, 4, 5), (10, 11, 12)
BODY = "env_states/actors/Tee"
SECRET = b"root:x:0:0:the secret of another file:/root:/bin/sh\n" * 40


@functools.cache
def task() -> TaskEnv:
    """Return the task that was recorded."""
    return tasks.make(TASK, obs_mode="none")


@functools.cache
def episodes() -> tuple[Any, ...]:
    """Return the episodes that were recorded."""
    rng = np.random.default_rng(0)
    return tuple(
        play(task(), seed, rng.uniform(-1, 1, (steps, ACTIONS)).astype(np.float32))
        for seed, steps in zip(SEEDS, LENGTHS, strict=True)
    )


@functools.cache
def contents() -> tuple[bytes, bytes]:
    """Return the bytes of the recording: those of the h5 file and those of the json."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "trajectory.h5"
        with recorder(path) as recording:
            for episode in episodes():
                recording.add(episode)
        return path.read_bytes(), path.with_suffix(".json").read_bytes()


def recorder(path: Path, **how: bool) -> Recorder:
    """Begin a recording, or go on with it."""
    return Recorder(path, task(), **how)


def recording(folder: Path) -> Path:
    """Put the recording into a folder; return its h5 file."""
    path = folder / "trajectory.h5"
    path.write_bytes(contents()[0])
    path.with_suffix(".json").write_bytes(contents()[1])
    return path


@contextmanager
def edited(path: Path) -> Iterator[h5py.File]:
    """Open the h5 file to change it as its author might, who would write no checksums."""
    with h5py.File(path, "r+") as file:
        yield file
        for name in file:
            if file.get(name, getlink=True).__class__ is h5py.HardLink:
                file[name].attrs.pop("checksum", None)


def edit_json(path: Path, edit: Callable[[dict[str, Any]], None]) -> None:
    """Change the json beside an h5 file."""
    beside = path.with_suffix(".json")
    summary = json.loads(beside.read_bytes())
    edit(summary)
    beside.write_text(json.dumps(summary))


def read(path: Path) -> list[Trajectory]:
    """Read all that a replay or an export would."""
    with Recording(path) as file:
        file.expect(TASK, ACTIONS)
        return list(file)


def read_edited(folder: Path, edit: Callable[[h5py.File, Path], None]) -> None:
    """Change the h5 file, read it, and assert that nothing of another file was read."""
    path = recording(folder)
    (folder / "secret").write_bytes(SECRET)
    with edited(path) as file:
        edit(file, folder)
    for episode in read(path):
        for rows in (episode.actions, episode.rewards):
            assert rows is None or SECRET[:8] not in rows.tobytes(), "read another file"


def expect_whole(path: Path) -> None:
    """Assert that a recording holds what was recorded, to the last bit."""
    found = read(path)
    assert [episode.seed for episode in found] == list(SEEDS)
    for episode, recorded in zip(found, episodes(), strict=True):
        np.testing.assert_array_equal(episode.actions, recorded.actions)
        np.testing.assert_array_equal(episode.rewards, recorded.rewards)
        assert episode.states is not None
        for kind, entries in recorded.states.items():
            for name, rows in entries.items():
                np.testing.assert_array_equal(episode.states[kind][name], rows)


def go_on(path: Path) -> str:
    """Go on with a recording: record what is missing, and assert that all is there, bit for bit.

    Returns:
        What was damaged and recorded again, in words.
    """
    with recorder(path, resume=True) as again:
        damaged = len(again.damaged)
        for episode in episodes():
            if episode.seed not in again.seeds:
                again.add(episode)
    assert path.read_bytes() == contents()[0]
    assert path.with_suffix(".json").read_bytes() == contents()[1]
    return f"{damaged} damaged, recorded again; the files are the same, byte for byte"

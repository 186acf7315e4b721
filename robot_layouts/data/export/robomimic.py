"""Writes a robomimic dataset: one hdf5 file with a group per demonstration."""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from robot_layouts.core.writing import DiskFile
from robot_layouts.data.export.columns import (
    POSE,
    ColumnReader,
    Columns,
    DatasetWriter,
    Floats,
    Frames,
    Watch,
)
from robot_layouts.data.export.shots import PictureChannel
from robots.control_modes import plain_mode
from tasks.engine.cameras import Size, expect_apart
from tasks.engine.columns import ROBOMIMIC, picture_column, robomimic_columns
from tasks.episode import States

FILE_NAME = "low_dim.hdf5"  # what robomimic calls observations without pictures
FILE_WITH_PICTURES = "image.hdf5"  # and with them
GYM = 2  # robomimic's number for environments made by gym
LEVEL = 1  # of compression: drawing takes long, not this
VALIDATION_EVERY = 10  # the last of each ten demonstrations is for validation


class RobomimicWriter(DatasetWriter):
    """Writes episodes one after the other; the file is complete when it is closed."""

    def __init__(
        self,
        folder: Path,
        reader: ColumnReader,
        origin: Mapping[str, Any],
        channels: Sequence[PictureChannel] = (),
        *,
        size: Size | None = None,
    ) -> None:
        """Begin the file.

        Args:
            folder: See `DatasetWriter`.
            reader: See `DatasetWriter`.
            origin: See `DatasetWriter`.
            channels: Which pictures there are of every moment.
            size: Width and height of cameras' pictures (pixels) if not their own.

        Raises:
            TaskError: If pictures of two cameras would be called the same.
        """
        super().__init__(folder, reader, origin)
        self._size = size
        self._names = {c: picture_column(ROBOMIMIC, c.camera, c.texture) for c in channels}
        expect_apart(self._names.values())
        name = FILE_WITH_PICTURES if channels else FILE_NAME
        self._disk = DiskFile(folder / name, "w+")
        self._file = h5py.File(self._disk, "w")
        self._data = self._file.create_group("data")
        self._total, self._solved = 0, list[str]()

    def add(self, columns: Columns, frames: Frames, watch: Watch, text: str | None) -> None:
        """See `DatasetWriter.add`."""
        with self._disk.refusals():
            name, steps = f"demo_{len(self._data)}", len(columns)
            demo = self._data.create_group(name)
            demo.attrs["num_samples"] = steps
            demo.attrs["episode_id"] = columns.episode_id
            if columns.seed is not None:
                demo.attrs["seed"] = columns.seed
            if text is not None:
                demo.attrs["ep_meta"] = json.dumps({"lang": text})
            states = flat_states(columns.states)
            demo["actions"] = columns.actions
            demo["states"] = states[:-1]
            demo["dones"] = columns.done.astype(np.int64)
            if columns.rewards is not None:
                demo["rewards"] = columns.rewards
            if columns.source is not None:
                demo.attrs["source"] = json.dumps(columns.source)
            if columns.actor is not None:
                demo["actor"] = columns.actor
            if columns.corrections is not None:
                demo["corrections"] = columns.corrections
            tcp_poses = self._reader.tcp_poses(columns)
            observed = robomimic_columns(columns.qpos, columns.qvel, tcp_poses, columns.bodies)
            for key, rows in observed.items():
                demo[f"obs/{key}"] = rows[:-1]
                demo[f"next_obs/{key}"] = rows[1:]
            for key, rows in (columns.points or {}).items():
                demo[f"obs/points_{key}"] = rows[:-1]
                demo[f"next_obs/points_{key}"] = rows[1:]
            self._add_pictures(demo, steps, frames, watch)
            if "state_layout" not in self._data.attrs:
                self._data.attrs["state_layout"] = json.dumps(state_layout(columns.states))
            if columns.success is not None and columns.success[-1]:
                self._solved.append(name)
            self._total += steps

    def note(self, about: Mapping[str, Any]) -> None:
        """See `DatasetWriter.note`."""
        with self._disk.refusals():
            self._data[f"demo_{len(self._data) - 1}"].attrs.update(about)

    def _add_pictures(self, demo: Any, steps: int, frames: Frames, watch: Watch) -> None:
        """Write what is seen before and after each step, ``obs`` and ``next_obs``.

        A picture that stands in both is compressed once.
        """
        arrays = {
            channel: [_pictures(demo, f"{o}/{name}", steps, channel) for o in ("obs", "next_obs")]
            for channel, name in self._names.items()
        }
        for moment, frame in enumerate(frames):
            for channel, (before, after) in arrays.items():
                packed = zlib.compress(frame[channel].tobytes(), LEVEL)
                if moment < steps:
                    before.id.write_direct_chunk((moment, 0, 0, 0), packed)
                if moment > 0:
                    after.id.write_direct_chunk((moment - 1, 0, 0, 0), packed)
            watch(moment + 1)

    def _let_go(self) -> None:
        with self._disk, self._disk.refusals():
            self._file.close()

    def _complete(self) -> None:
        self._data.attrs["total"] = self._total
        self._data.attrs["env_args"] = json.dumps(self._environment())
        self._data.attrs["names"] = json.dumps(self._column_names())
        self._data.attrs["recording"] = json.dumps(self._origin)
        demos = [f"demo_{i}" for i in range(len(self._data))]
        valid = [demo for i, demo in enumerate(demos) if i % VALIDATION_EVERY == 9]
        valid = valid or demos[1:][-1:]  # of few demonstrations the last; of one none
        masks = {
            "train": [demo for demo in demos if demo not in set(valid)],
            "valid": valid,
            "success": self._solved,
        }
        for name, chosen in masks.items():
            if chosen:
                self._file[f"mask/{name}"] = np.array(chosen, dtype="S")

    def _environment(self) -> dict[str, Any]:
        """Return robomimic's description of the environment; the keywords are `tasks.make`'s."""
        task = self._reader.task
        return {
            "env_name": task.task_id,
            "type": GYM,
            "env_kwargs": {
                "robots": {place: p.robot.name for place, p in task.layout.items()},
                "control_mode": plain_mode(task.control_mode),
                "reward_mode": task.reward_mode,
                "control_frequency": task.scenario.control_frequency,
            }
            | ({} if self._size is None else {"camera_size": list(self._size)}),
        }

    def _column_names(self) -> dict[str, Sequence[str]]:
        """Return what each number of the datasets is called, by dataset."""
        names: dict[str, Sequence[str]] = {"actions": self._reader.action_names}
        layout = self._reader.task.layout
        for arm in layout.arms:
            place = arm.partition(".")[0]
            joints = layout[place].robot.joints
            names |= {f"{place}_qpos": joints, f"{place}_qvel": joints, f"{arm}_tcp_pose": POSE}
        return names | {"object": self._reader.body_names}


def state_layout(states: States) -> list[dict[str, Any]]:
    """Return which numbers of a flat state belong to which entry of the state dict, in order."""
    layout: list[dict[str, Any]] = []
    start = 0
    for kind, entries in states.items():
        for name, rows in entries.items():
            stop = start + rows.shape[1]
            layout.append({"entry": f"{kind}/{name}", "start": start, "stop": stop})
            start = stop
    return layout


def flat_states(states: States) -> Floats:
    """Return a state dict as rows, (T + 1, k), in the order of `state_layout`."""
    return np.concatenate([rows for entries in states.values() for rows in entries.values()], 1)


def _pictures(demo: Any, name: str, steps: int, channel: PictureChannel) -> Any:
    shape = channel.shape
    return demo.create_dataset(
        name,
        (steps, *shape),
        channel.dtype,
        chunks=(1, *shape),
        compression="gzip",
        compression_opts=LEVEL,
    )

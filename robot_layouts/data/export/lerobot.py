"""Writes a LeRobot dataset, format v3.0: parquet files, mp4 files, and json that describes them."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from robot_layouts.data.export.columns import ColumnReader, Columns, DatasetWriter, Frames, Watch
from robot_layouts.data.export.lerobot_files import (
    DATA_PATH,
    EPISODES_PATH,
    VIDEO_PATH,
    FileLimits,
    ParquetFiles,
    PictureWriter,
    describe_numbers,
    flatten,
)
from robot_layouts.data.export.shots import PictureChannel
from tasks.engine.columns import lerobot_columns

VERSION = "v3.0"
EPISODES_AT_ONCE = 500  # whose descriptions are written together

Number = NDArray[np.generic]


class LeRobotWriter(DatasetWriter):
    """Writes episodes one after the other; the dataset is complete when it is closed."""

    def __init__(
        self,
        folder: Path,
        reader: ColumnReader,
        origin: Mapping[str, Any],
        channels: Sequence[PictureChannel] = (),
        *,
        task_text: str,
        fps: int,
        images: bool = False,
        limits: FileLimits | None = None,
    ) -> None:
        """Begin a dataset.

        Args:
            folder: See `DatasetWriter`.
            reader: See `DatasetWriter`.
            origin: See `DatasetWriter`.
            channels: Which pictures there are of every moment.
            task_text: What is to be done, in a sentence, where an episode does not say it.
            fps: Control steps per second.
            images: Whether pictures are png images, and not videos.
            limits: How much goes into one file.

        Raises:
            TaskError: If no video can have a picture's size.
        """
        super().__init__(folder, reader, origin)
        self._task_text, self._fps, self._limits = task_text, fps, limits or FileLimits()
        self._data = ParquetFiles(folder, DATA_PATH, self._limits)
        self._episodes = ParquetFiles(folder, EPISODES_PATH, self._limits)
        self._pictures = PictureWriter(folder, channels, fps, self._limits, images=images)
        self._rows: list[dict[str, Any]] = []
        self._numbers: dict[str, list[Number]] = {}
        self._features: dict[str, dict[str, Any]] = {}
        self._texts: dict[str, int] = {}
        self._origins: list[dict[str, Any]] = []
        self._frames = 0

    def add(self, columns: Columns, frames: Frames, watch: Watch, text: str | None) -> None:
        """See `DatasetWriter.add`."""
        number, steps = len(self._origins), len(columns)
        text = self._task_text if text is None else text
        task = self._texts.setdefault(text, len(self._texts))
        features = self._frame_features(columns, number, task)
        if not self._features:
            self._features = {key: about for key, (about, _) in features.items()}
        numbers = {key: values for key, (_, values) in features.items()}
        pictures = self._pictures.add(frames, watch)
        row: dict[str, Any] = {
            "episode_index": number,
            "tasks": [text],
            "length": steps,
            "dataset_from_index": self._frames,
            "dataset_to_index": self._frames + steps,
        }
        row |= self._data.write(_table(numbers, pictures.columns)).keys("data") | pictures.where
        statistics = {key: describe_numbers(values) for key, values in numbers.items()}
        for key, described in (statistics | pictures.statistics).items():
            row |= {f"stats/{key}/{name}": values for name, values in flatten(described)}
        self._rows.append(row)
        if len(self._rows) == EPISODES_AT_ONCE:
            self._write_rows()
        for key, values in numbers.items():
            self._numbers.setdefault(key, []).append(values)
        said = {"source": columns.source} if columns.source is not None else {}
        self._origins.append({"episode_id": columns.episode_id, "seed": columns.seed, **said})
        self._frames += steps

    def note(self, about: Mapping[str, Any]) -> None:
        """See `DatasetWriter.note`."""
        self._origins[-1] |= about

    def _frame_features(
        self, columns: Columns, number: int, task: int
    ) -> dict[str, tuple[dict[str, Any], Number]]:
        """Return description and values, (T, k), of every feature that is no picture.

        A row holds the state before a step, the step's action, and its result.
        """
        steps = len(columns)
        frames = np.arange(steps)
        reader, whole = self._reader, np.full(steps, 0)
        observed = lerobot_columns(columns.qpos, columns.qvel, columns.bodies)
        vectors: list[tuple[str, Sequence[str], Number]] = [
            ("action", reader.action_names, columns.actions),
            *((key, self._names(key), rows[:-1]) for key, rows in observed.items()),
        ]
        if columns.corrections is not None:
            vectors.append(("corrections", reader.action_names, columns.corrections))
        scalars: list[tuple[str, Number | None]] = [
            ("next.reward", columns.rewards),
            ("next.success", columns.success),
            ("next.done", columns.done),
            ("actor", columns.actor),
            ("timestamp", (frames / self._fps).astype(np.float32)),
            ("frame_index", frames),
            ("episode_index", whole + number),
            ("index", frames + self._frames),
            ("task_index", whole + task),
        ]
        features = {
            key: (_feature("float32", len(names), list(names)), values)
            for key, names, values in vectors
        }
        for key, values in scalars:
            if values is not None:
                features[key] = (_feature(values.dtype.name, 1, None), values[:, None])
        return features

    def _names(self, observed: str) -> Sequence[str]:
        """Return what each number of a feature that is observed is called."""
        is_bodies = observed == "observation.environment_state"
        return self._reader.body_names if is_bodies else self._reader.joint_names

    def _write_rows(self) -> None:
        for row in self._rows:
            row |= self._episodes.place.keys("meta/episodes")
        self._episodes.write(pa.Table.from_pylist(self._rows))
        self._rows.clear()

    def _let_go(self) -> None:
        self._data.close()
        self._episodes.close()
        self._pictures.close()

    def _complete(self) -> None:
        if self._rows:
            self._write_rows()
        described = {
            key: describe_numbers(np.concatenate(values)) for key, values in self._numbers.items()
        }
        described |= self._pictures.describe()
        _write_json(
            self._folder / "meta/stats.json",
            {key: dict(flatten(statistics)) for key, statistics in described.items()},
        )
        _write_tasks(self._folder / "meta/tasks.parquet", list(self._texts))
        _write_json(self._folder / "meta/info.json", self._info())
        _write_json(
            self._folder / "meta/recording.json", {**self._origin, "episodes": self._origins}
        )

    def _info(self) -> dict[str, Any]:
        episodes, layout = len(self._origins), self._reader.task.layout
        return {
            "codebase_version": VERSION,
            "robot_type": "+".join(placement.robot.name for placement in layout.values()),
            "total_episodes": episodes,
            "total_frames": self._frames,
            "total_tasks": len(self._texts),
            "chunks_size": self._limits.files,
            "data_files_size_in_mb": self._limits.data_megabytes,
            "video_files_size_in_mb": self._limits.video_megabytes,
            "fps": self._fps,
            "splits": {"train": f"0:{episodes}"},
            "data_path": DATA_PATH,
            "video_path": VIDEO_PATH if self._pictures.filmed else None,
            "features": self._features | self._pictures.features(),
        }


def _feature(dtype: str, size: int, names: list[str] | None) -> dict[str, Any]:
    return {"dtype": dtype, "shape": [size], "names": names}


def _table(numbers: Mapping[str, Number], pictures: Mapping[str, Any]) -> Any:
    return pa.table({key: _array(values) for key, values in numbers.items()} | {**pictures})


def _array(values: Number) -> Any:
    """Return one list per row, or one number where a row has only one, as LeRobot expects."""
    flat, size = pa.array(values.ravel()), values.shape[1]
    return flat if size == 1 else pa.FixedSizeListArray.from_arrays(flat, size)


def _write_json(path: Path, content: Mapping[str, Any]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(content, indent=4, ensure_ascii=False) + "\n", encoding="utf-8")


def _write_tasks(path: Path, texts: Sequence[str]) -> None:
    """Write the tasks as a table that pandas reads with the texts as its index."""
    described = {
        "index_columns": ["task"],
        "column_indexes": [],
        "columns": [
            {"name": name, "field_name": name, "pandas_type": kind, "numpy_type": numpy_kind}
            | {"metadata": None}
            for name, kind, numpy_kind in (
                ("task_index", "int64", "int64"),
                ("task", "unicode", "object"),
            )
        ],
    }
    table = pa.table({"task_index": list(range(len(texts))), "task": list(texts)})
    pq.write_table(table.replace_schema_metadata({"pandas": json.dumps(described)}), path)

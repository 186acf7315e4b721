"""Writes a LeRobot dataset, format v3.0: parquet files, mp4 files, and json that describes them."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from rollouts.export.columns import ColumnReader, Columns
from rollouts.export.pictures import CODEC, PIXEL_FORMAT, SHAPE, VideoFile
from rollouts.export.statistics import (
    PictureStatistics,
    Statistics,
    describe_numbers,
    flatten,
)
from rollouts.export.writer import DatasetWriter
from tasks.engine.columns import CAMERA, lerobot_columns

VERSION = "v3.0"
FILE = "chunk-{chunk_index:03d}/file-{file_index:03d}"
DATA_PATH = f"data/{FILE}.parquet"
EPISODES_PATH = f"meta/episodes/{FILE}.parquet"
VIDEO_PATH = f"videos/{{video_key}}/{FILE}.mp4"
MEGABYTE = 2**20
EPISODES_AT_ONCE = 500  # whose descriptions are written together

Number = NDArray[np.generic]


@dataclass(frozen=True)
class Limits:
    """How much goes into one file; the numbers are LeRobot's own.

    Attributes:
        data_megabytes: Size at which a parquet file is followed by another (MiB, uncompressed).
        video_megabytes: Size at which an mp4 file is followed by another (MiB).
        files: Files of one chunk folder.
    """

    data_megabytes: float = 100
    video_megabytes: float = 200
    files: int = 1000


@dataclass
class Place:
    """Which file of which chunk is being written."""

    chunk_index: int = 0
    file_index: int = 0

    def advance(self, files: int) -> None:
        """Go on to the next file, of ``files`` per chunk."""
        self.chunk_index, self.file_index = divmod(
            self.chunk_index * files + self.file_index + 1, files
        )


class LeRobotWriter(DatasetWriter):
    """Writes episodes one after the other; the dataset is complete when it is closed."""

    def __init__(
        self,
        folder: Path,
        reader: ColumnReader,
        *,
        task_text: str,
        fps: int,
        origin: Mapping[str, Any],
        limits: Limits | None = None,
    ) -> None:
        """Begin a dataset.

        Args:
            folder: An empty folder.
            reader: Names the columns.
            task_text: What is to be done, in a sentence.
            fps: Control steps per second.
            origin: What is kept of where the episodes come from; anything that json can hold.
            limits: How much goes into one file.
        """
        self._folder, self._reader, self._fps = folder, reader, fps
        self._task_text, self._origin = task_text, origin
        self._limits = limits or Limits()
        size = self._limits.data_megabytes * MEGABYTE
        self._data = _ParquetFiles(folder, DATA_PATH, size, self._limits.files)
        self._episodes = _ParquetFiles(folder, EPISODES_PATH, size, self._limits.files)
        self._rows: list[dict[str, Any]] = []
        self._numbers: dict[str, list[Number]] = {}
        self._features: dict[str, dict[str, Any]] = {}
        self._pictures = PictureStatistics()
        self._video: VideoFile | None = None
        self._video_place = Place()
        self._origins: list[dict[str, Any]] = []
        self._frames = 0

    def add(
        self,
        columns: Columns,
        pictures: Iterable[NDArray[np.uint8]] | None,
        watch: Callable[[int], None] = lambda frame: None,
    ) -> None:
        """Write one episode.

        Args:
            columns: The episode, of T steps.
            pictures: T pictures, or None in a dataset without video.
            watch: Called with the number of pictures written.
        """
        number, steps = len(self._origins), len(columns)
        features = self._frame_features(columns, number)
        if not self._features:
            self._features = {key: about for key, (about, _) in features.items()}
        numbers = {key: values for key, (_, values) in features.items()}
        row: dict[str, Any] = {
            "episode_index": number,
            "tasks": [self._task_text],
            "length": steps,
            "dataset_from_index": self._frames,
            "dataset_to_index": self._frames + steps,
        }
        row |= _keys("data", self._data.write(_table(numbers)))
        statistics = {key: describe_numbers(values) for key, values in numbers.items()}
        if pictures is not None:
            found, where = self._film(pictures, watch)
            row |= where
            statistics[CAMERA] = found
        for key, described in statistics.items():
            row |= {f"stats/{key}/{name}": values for name, values in flatten(described)}
        self._rows.append(row)
        if len(self._rows) == EPISODES_AT_ONCE:
            self._write_rows()
        for key, values in numbers.items():
            self._numbers.setdefault(key, []).append(values)
        said = {"source": columns.source} if columns.source is not None else {}
        self._origins.append({"episode_id": columns.episode_id, "seed": columns.seed, **said})
        self._frames += steps

    def _frame_features(
        self, columns: Columns, number: int
    ) -> dict[str, tuple[dict[str, Any], Number]]:
        """Return description and values, (T, k), of every feature that is no video.

        A row holds the state before a step, the step's action, and what came of it.
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
            ("task_index", whole),
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

    def _film(
        self, pictures: Iterable[NDArray[np.uint8]], watch: Callable[[int], None]
    ) -> tuple[Statistics, dict[str, Any]]:
        video = self._next_video()
        begin, statistics = video.seconds, PictureStatistics()
        for picture in pictures:
            video.add(picture)
            statistics.add(picture)
            watch(statistics.pictures)
        self._pictures.include(statistics)
        where = _keys(f"videos/{CAMERA}", self._video_place)
        where[f"videos/{CAMERA}/from_timestamp"] = begin
        where[f"videos/{CAMERA}/to_timestamp"] = video.seconds
        return statistics.describe(), where

    def _next_video(self) -> VideoFile:
        """Return the file for the next episode; a file holds whole episodes."""
        if self._video is not None:
            if self._video.size < self._limits.video_megabytes * MEGABYTE:
                return self._video
            self._video.close()
            self._video_place.advance(self._limits.files)
        path = VIDEO_PATH.format(video_key=CAMERA, **vars(self._video_place))
        self._video = VideoFile(self._folder / path, self._fps)
        return self._video

    def _write_rows(self) -> None:
        for row in self._rows:
            row |= _keys("meta/episodes", self._episodes.place)
        self._episodes.write(pa.Table.from_pylist(self._rows))
        self._rows.clear()

    def _let_go(self) -> None:
        self._data.close()
        self._episodes.close()
        if self._video is not None:
            self._video.close()

    def _complete(self) -> None:
        if self._rows:
            self._write_rows()
        described = {
            key: describe_numbers(np.concatenate(values)) for key, values in self._numbers.items()
        }
        if self._video is not None:
            described[CAMERA] = self._pictures.describe()
        _write_json(
            self._folder / "meta/stats.json",
            {key: dict(flatten(statistics)) for key, statistics in described.items()},
        )
        _write_tasks(self._folder / "meta/tasks.parquet", [self._task_text])
        _write_json(self._folder / "meta/info.json", self._info())
        _write_json(
            self._folder / "meta/recording.json", {**self._origin, "episodes": self._origins}
        )

    def _info(self) -> dict[str, Any]:
        filmed = self._video is not None
        if filmed:
            self._features[CAMERA] = _video_feature(self._fps)
        episodes, layout = len(self._origins), self._reader.task.layout
        return {
            "codebase_version": VERSION,
            "robot_type": "+".join(placement.robot.name for placement in layout.values()),
            "total_episodes": episodes,
            "total_frames": self._frames,
            "total_tasks": 1,
            "chunks_size": self._limits.files,
            "data_files_size_in_mb": self._limits.data_megabytes,
            "video_files_size_in_mb": self._limits.video_megabytes,
            "fps": self._fps,
            "splits": {"train": f"0:{episodes}"},
            "data_path": DATA_PATH,
            "video_path": VIDEO_PATH if filmed else None,
            "features": self._features,
        }


class _ParquetFiles:
    """Numbered parquet files; each is followed by another when it is full."""

    def __init__(self, folder: Path, pattern: str, size: float, files: int) -> None:
        self._folder, self._pattern = folder, pattern
        self._size, self._files = size, files
        self.place, self._bytes = Place(), 0
        self._writer: pq.ParquetWriter | None = None

    def write(self, table: Any) -> Place:
        """Write a table as one row group; return its place."""
        place = Place(**vars(self.place))
        if self._writer is None:
            path = self._folder / self._pattern.format(**vars(place))
            path.parent.mkdir(parents=True, exist_ok=True)
            self._writer = pq.ParquetWriter(path, table.schema)
        self._writer.write_table(table, row_group_size=len(table))
        self._bytes += table.nbytes
        if self._bytes >= self._size:
            self.close()
            self.place.advance(self._files)
        return place

    def close(self) -> None:
        """Finish the file that is being written."""
        if self._writer is not None:
            self._writer.close()
        self._writer, self._bytes = None, 0


def _feature(dtype: str, size: int, names: list[str] | None) -> dict[str, Any]:
    return {"dtype": dtype, "shape": [size], "names": names}


def _video_feature(fps: int) -> dict[str, Any]:
    height, width, channels = SHAPE
    return {
        "dtype": "video",
        "shape": [height, width, channels],
        "names": ["height", "width", "channels"],
        "info": {
            "video.height": height,
            "video.width": width,
            "video.codec": CODEC,
            "video.pix_fmt": PIXEL_FORMAT,
            "video.is_depth_map": False,
            "video.fps": fps,
            "video.channels": channels,
            "has_audio": False,
        },
    }


def _table(numbers: Mapping[str, Number]) -> Any:
    return pa.table({key: _array(values) for key, values in numbers.items()})


def _array(values: Number) -> Any:
    """Return one list per row, or one number where a row has only one, as LeRobot expects."""
    flat, size = pa.array(values.ravel()), values.shape[1]
    return flat if size == 1 else pa.FixedSizeListArray.from_arrays(flat, size)


def _keys(prefix: str, place: Place) -> dict[str, Any]:
    return {f"{prefix}/{name}": index for name, index in vars(place).items()}


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

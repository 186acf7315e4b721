"""Which numbered file of a LeRobot dataset holds what, and when the next one begins."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq

FILE = "chunk-{chunk_index:03d}/file-{file_index:03d}"
DATA_PATH = f"data/{FILE}.parquet"
EPISODES_PATH = f"meta/episodes/{FILE}.parquet"
VIDEO_PATH = f"videos/{{video_key}}/{FILE}.mp4"
MEGABYTE = 2**20


@dataclass(frozen=True)
class Limits:
    """How much goes into one file; the numbers are LeRobot's own.

    Attributes:
        data_megabytes: Size at which a parquet file is followed by another (MiB, uncompressed).
        video_megabytes: Size at which an mp4 file is followed by another (MiB, about).
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

    def keys(self, prefix: str) -> dict[str, Any]:
        """Return what an episode's description says of it."""
        return {f"{prefix}/{name}": index for name, index in vars(self).items()}


class ParquetFiles:
    """Numbered parquet files; each is followed by another when it is full."""

    def __init__(self, folder: Path, pattern: str, limits: Limits) -> None:
        """Begin with the first.

        Args:
            folder: The dataset.
            pattern: Path of a file in it, with the names of `Place` in braces.
            limits: When a file is full.
        """
        self._folder, self._pattern, self._limits = folder, pattern, limits
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
        if self._bytes >= self._limits.data_megabytes * MEGABYTE:
            self.close()
            self.place.advance(self._limits.files)
        return place

    def close(self) -> None:
        """Finish the file that is being written."""
        if self._writer is not None:
            self._writer.close()
        self._writer, self._bytes = None, 0

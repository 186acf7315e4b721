"""Files of a LeRobot dataset: numbered tables and videos, which of them holds what, statistics.

Pictures are videos, or png images in the tables; depth always is.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from robot_layouts.data.export.shots import DEPTH, RGB, Frame, Picture, PictureChannel
from robots import TaskError
from tasks.engine.columns import LEROBOT, picture_column

FILE = "chunk-{chunk_index:03d}/file-{file_index:03d}"
DATA_PATH = f"data/{FILE}.parquet"
EPISODES_PATH = f"meta/episodes/{FILE}.parquet"
VIDEO_PATH = f"videos/{{video_key}}/{FILE}.mp4"
MEGABYTE = 2**20
CODEC = "h264"
PIXEL_FORMAT = "yuv420p"
# A keyframe every second frame, as LeRobot has them, so that any frame is near one; no frames
# that refer to later ones, so that frame k is shown at k / fps exactly.
ENCODING = ["-g", "2", "-bf", "0", "-crf", "23", "-preset", "veryfast", "-movflags", "+faststart"]
PIXELS_PER_BYTE = 8  # of small pictures; large ones take less
SIDES = 2  # widths and heights are multiples of it: colour is stored for four pixels at once
SIDE_NAMES = ["height", "width", "channels"]
PNG_LEVEL = 1  # of zlib: drawing takes long, not this
QUANTILES = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}
LEVELS = 256  # of a colour of a picture
DEPTH_LEVELS = 65536  # of a distance (mm)
_IMAGE = pa.struct([("bytes", pa.binary()), ("path", pa.string())])

Statistics = dict[str, NDArray[np.float64]]


@dataclass(frozen=True)
class FileLimits:
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

    def __init__(self, folder: Path, pattern: str, limits: FileLimits) -> None:
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


@dataclass
class EpisodePictures:
    """What the pictures of an episode add to a dataset.

    Attributes:
        columns: Columns of its data.
        where: What its description says of the videos that it is in.
        statistics: By feature.
    """

    columns: dict[str, Any] = field(default_factory=dict[str, Any])
    where: dict[str, Any] = field(default_factory=dict[str, Any])
    statistics: dict[str, Statistics] = field(default_factory=dict[str, Statistics])


class PictureWriter:
    """Writes the pictures of episodes, all of the same channels."""

    def __init__(
        self,
        folder: Path,
        channels: Sequence[PictureChannel],
        fps: int,
        limits: FileLimits,
        *,
        images: bool,
    ) -> None:
        """Begin.

        Args:
            folder: The dataset.
            channels: Which pictures there are of every step.
            fps: Control steps per second.
            limits: How much goes into one file.
            images: Whether pictures are png images, and not videos.

        Raises:
            TaskError: If no video can have a picture's size.
        """
        kinds = {RGB: _Images if images else _Videos, DEPTH: _Images}
        self._writers = {c: kinds[c.texture](folder, c, fps, limits) for c in channels}

    def add(self, frames: Iterable[Frame], watch: Callable[[int], None]) -> EpisodePictures:
        """Write the pictures of an episode.

        Args:
            frames: One for each step.
            watch: Called with the number of steps whose pictures are written.
        """
        counted = {channel: _statistics(channel) for channel in self._writers}
        for writer in self._writers.values():
            writer.begin()
        for number, frame in enumerate(frames, 1):
            for channel, writer in self._writers.items():
                writer.add(frame[channel])
                counted[channel].add(frame[channel])
            watch(number)
        found = EpisodePictures()
        for channel, writer in self._writers.items():
            writer.finish(found)
            writer.total.include(counted[channel])
            found.statistics[writer.key] = counted[channel].describe()
        return found

    def features(self) -> dict[str, dict[str, Any]]:
        """Return the description of every feature."""
        return {writer.key: writer.feature() for writer in self._writers.values()}

    def describe(self) -> dict[str, Statistics]:
        """Return the statistics of all episodes, by feature."""
        return {writer.key: writer.total.describe() for writer in self._writers.values()}

    @property
    def filmed(self) -> bool:
        """Whether there are videos."""
        return any(isinstance(writer, _Videos) for writer in self._writers.values())

    def close(self) -> None:
        """Finish every file."""
        for writer in self._writers.values():
            writer.close()


class _Videos:
    """Mp4 files of one channel, which hold whole episodes."""

    def __init__(self, folder: Path, channel: PictureChannel, fps: int, limits: FileLimits) -> None:
        if channel.width % SIDES or channel.height % SIDES:
            raise TaskError(
                f"pictures of {channel.camera} have {channel.width} × {channel.height} pixels;"
                " videos need even numbers: choose another size, or images"
            )
        self.key = picture_column(LEROBOT, channel.camera, channel.texture)
        self.total = _statistics(channel)
        self._folder, self._channel, self._fps, self._limits = folder, channel, fps, limits
        self._place, self._begin, self._frames = Place(), 0, 0
        self._writer: Any = None

    def begin(self) -> None:
        """Take the file of the next episode."""
        height, width, _ = self._channel.shape
        size = self._frames * height * width // PIXELS_PER_BYTE  # on disk, it may come later
        if self._writer is not None and size >= self._limits.video_megabytes * MEGABYTE:
            self.close()
            self._place.advance(self._limits.files)
        if self._writer is None:
            import imageio.v2 as imageio

            path = self._folder / VIDEO_PATH.format(video_key=self.key, **vars(self._place))
            path.parent.mkdir(parents=True, exist_ok=True)
            self._writer = imageio.get_writer(
                path,
                fps=self._fps,
                codec="libx264",
                quality=None,
                pixelformat=PIXEL_FORMAT,
                macro_block_size=SIDES,
                output_params=ENCODING,
            )
        self._begin = self._frames

    def add(self, picture: Picture) -> None:
        """Write a frame."""
        self._writer.append_data(picture.astype(np.uint8, copy=False))
        self._frames += 1

    def finish(self, episode: EpisodePictures) -> None:
        """Say where the episode is."""
        prefix = f"videos/{self.key}"
        episode.where |= self._place.keys(prefix)
        episode.where[f"{prefix}/from_timestamp"] = self._begin / self._fps
        episode.where[f"{prefix}/to_timestamp"] = self._frames / self._fps

    def feature(self) -> dict[str, Any]:
        """Return LeRobot's description."""
        height, width, channels = self._channel.shape
        return {
            "dtype": "video",
            "shape": [height, width, channels],
            "names": SIDE_NAMES,
            "info": {
                "video.height": height,
                "video.width": width,
                "video.codec": CODEC,
                "video.pix_fmt": PIXEL_FORMAT,
                "video.is_depth_map": False,
                "video.fps": self._fps,
                "video.channels": channels,
                "has_audio": False,
            },
        }

    def close(self) -> None:
        """Finish the file."""
        if self._writer is not None:
            self._writer.close()
        self._writer, self._frames = None, 0


class _Images:
    """A column of png images, which lose nothing; depth has 16 bits."""

    def __init__(self, folder: Path, channel: PictureChannel, fps: int, limits: FileLimits) -> None:
        self.key = picture_column(LEROBOT, channel.camera, channel.texture)
        self.total = _statistics(channel)
        self._channel, self._images = channel, list[bytes]()

    def begin(self) -> None:
        """Begin an episode."""
        self._images = []

    def add(self, picture: Picture) -> None:
        """Encode an image."""
        self._images.append(png(picture))

    def finish(self, episode: EpisodePictures) -> None:
        """Add the episode's column."""
        rows = [{"bytes": image, "path": None} for image in self._images]
        episode.columns[self.key] = pa.array(rows, _IMAGE)

    def feature(self) -> dict[str, Any]:
        """Return LeRobot's description."""
        shape = list(self._channel.shape)
        depth = {"info": {"is_depth_map": True, "depth_unit": "mm"}}
        described = {"dtype": "image", "shape": shape, "names": SIDE_NAMES}
        return described | (depth if self._channel.texture == DEPTH else {})

    def close(self) -> None:
        """Do nothing: the tables hold them."""


def png(picture: Picture) -> bytes:
    """Return a picture as a png file: 8 bits per colour, or 16 bits of distance (mm)."""
    from PIL import Image

    pixels: NDArray[Any] = picture if picture.shape[2] == 3 else depth_levels(picture)[..., 0]
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, "PNG", compress_level=PNG_LEVEL)
    return file.getvalue()


def depth_levels(picture: Picture) -> NDArray[np.uint16]:
    """Return distances (mm) as 16 bits without a sign; those beyond 32.767 m are right, too."""
    return picture.astype(np.int16, copy=False).view(np.uint16)


def _statistics(channel: PictureChannel) -> PictureStatistics:
    return PictureStatistics() if channel.texture == RGB else PictureStatistics(1, DEPTH_LEVELS, 1)


def describe_numbers(numbers: NDArray[np.generic]) -> Statistics:
    """Return the statistics of each column.

    Args:
        numbers: Shape (T, k), T of 1 or more; flags count as 0 and 1.

    Returns:
        ``min``, ``max``, ``mean``, ``std`` and the quantiles, each (k,), and ``count``, (1,).
    """
    values = numbers.astype(np.float64)
    found = {
        "min": values.min(0),
        "max": values.max(0),
        "mean": values.mean(0),
        "std": values.std(0),
        "count": np.array([len(values)]),
    }
    quantiles = np.quantile(values, list(QUANTILES.values()), axis=0)
    return found | dict(zip(QUANTILES, quantiles, strict=True))


class PictureStatistics:
    """Counts how often each level occurs in each channel; everything else follows from that."""

    def __init__(
        self, channels: int = 3, levels: int = LEVELS, largest: float = LEVELS - 1
    ) -> None:
        """Begin with no pictures.

        Args:
            channels: Numbers of a pixel.
            levels: Their values are 0 to this number - 1.
            largest: The value that counts as 1 in what is described.
        """
        self.pictures, self._largest = 0, largest
        self._counts = np.zeros((channels, levels), np.int64)

    def add(self, picture: NDArray[np.integer[Any]]) -> None:
        """Count a picture, (height, width, channels)."""
        self.pictures += 1
        unsigned = picture.view(np.uint16) if picture.dtype == np.int16 else picture
        for counts, channel in zip(self._counts, np.moveaxis(unsigned, 2, 0), strict=True):
            counts += np.bincount(channel.ravel(), minlength=len(counts))

    def include(self, others: PictureStatistics) -> None:
        """Count the pictures that others counted, too."""
        self.pictures += others.pictures
        self._counts += others._counts

    def describe(self) -> Statistics:
        """Return statistics of each channel, each (channels, 1, 1), and ``count``.

        Colours are scaled to [0, 1].
        """
        levels = np.arange(self._counts.shape[1]) / self._largest
        weights = self._counts / self._counts.sum(1, keepdims=True)
        mean = weights @ levels
        columns = {
            "min": np.array([levels[np.flatnonzero(counts)[0]] for counts in self._counts]),
            "max": np.array([levels[np.flatnonzero(counts)[-1]] for counts in self._counts]),
            "mean": mean,
            "std": np.sqrt((weights * (levels - mean[:, None]) ** 2).sum(1)),
            **{
                name: np.array([_quantile(levels, counts, share) for counts in self._counts])
                for name, share in QUANTILES.items()
            },
        }
        found = {name: column.reshape(-1, 1, 1) for name, column in columns.items()}
        return found | {"count": np.array([self.pictures])}


def flatten(statistics: Statistics) -> Iterable[tuple[str, list[object]]]:
    """Yield each statistic's name and its values as nested lists."""
    for name, values in statistics.items():
        yield name, values.tolist()


def _quantile(levels: NDArray[np.float64], counts: NDArray[np.int64], share: float) -> float:
    """Return a quantile of levels that occur ``counts`` times each, linear between neighbours."""
    rank = share * (counts.sum() - 1)
    below, above = np.searchsorted(counts.cumsum(), [np.floor(rank), np.ceil(rank)], side="right")
    return float(levels[below] + (rank - np.floor(rank)) * (levels[above] - levels[below]))

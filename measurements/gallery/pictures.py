"""The gallery's pictures: portraits of robots and clips of tasks, as WebP."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from measurements.gallery.camera import Picture
from measurements.gallery.clip import FRAMES_PER_SECOND, Performance
from measurements.gallery.markdown import clip_path, portrait_path
from measurements.gallery.portrait import Sitter
from measurements.gallery.record import GalleryError, Record
from measurements.gallery.shapes import seen_as_shapes
from measurements.gallery.sources import can_be_drawn
from robots import MissingPackageError, RobotRegistry
from robots.common.writing import write_whole
from simulation.rendering.pictures import vulkan_problem

LARGEST_PORTRAIT, LARGEST_CLIP = 25_000, 200_000  # bytes
QUALITIES = (82, 75, 65, 55, 45, 35, 25)
END_SHOWN = 1500  # ms


class Artist:
    """Draws and keeps pictures, all with one render system: it goes with the last world."""

    def __init__(self, record: Record, folder: Path) -> None:
        """Look whether anything can be drawn.

        Args:
            record: Which episodes experts solve.
            folder: The gallery's.

        Raises:
            GalleryError: If there is no Vulkan driver.
            MissingPackageError: If there is no pillow.
        """
        if (problem := vulkan_problem()) is not None:
            raise GalleryError(f"no pictures can be drawn: {problem}")
        try:
            import PIL  # noqa: F401  # pyright: ignore[reportUnusedImport]
        except ImportError as error:
            words = "pictures need pillow: pip install 'robot-layouts[view]'"
            raise MissingPackageError(words) from error
        self._record, self._folder = record, folder
        self._kept: Any = None

    def draw_robot(self, name: str) -> None:
        """Draw a robot's portrait; of one that has no visual meshes, its collision shapes.

        Raises:
            AssetError: If its files cannot be had.
            UnwritableFileError: If the picture cannot be written.
        """
        robot = RobotRegistry.load(name)
        with TemporaryDirectory() as folder:
            drawn = robot if can_be_drawn(robot) else seen_as_shapes(robot, Path(folder))
            sitter = Sitter(drawn)
            self._kept = self._kept or sitter
            content = _smallest([sitter.portrait()], LARGEST_PORTRAIT)
        write_whole(self._folder / portrait_path(name), content)

    def film_task(self, task_id: str) -> None:
        """Film the first episode that a task's expert solves.

        Raises:
            GalleryError: If the record has none.
            AssetError: If robot files cannot be had.
            UnwritableFileError: If the clip cannot be written.
        """
        performance = Performance(task_id, self._record.task(task_id).expert.first_solved)
        self._kept = self._kept or performance
        content = _smallest(performance.film(), LARGEST_CLIP)
        write_whole(self._folder / clip_path(task_id), content)


def _smallest(pictures: list[Picture], limit: int) -> bytes:
    """Return pictures as one file of at most so many bytes, in the best quality that has it.

    Raises:
        GalleryError: If it has more even in the worst quality.
    """
    from PIL import Image

    images = [Image.fromarray(picture) for picture in pictures]
    for quality in QUALITIES:
        content = _webp(images, quality)
        if len(content) <= limit:
            return content
    raise GalleryError(f"a picture has more than {limit:,} bytes")


def _webp(images: list[Any], quality: int) -> bytes:
    stream, first, others = BytesIO(), images[0], images[1:]
    moving: dict[str, Any] = {}
    if others:
        each = 1000 // FRAMES_PER_SECOND
        durations = [*[each] * len(others), END_SHOWN]
        moving = {"save_all": True, "append_images": others, "duration": durations, "loop": 0}
    first.save(stream, "WEBP", quality=quality, method=6, **moving)
    return stream.getvalue()

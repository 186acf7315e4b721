"""All pages of the gallery: written, or compared with those that there are."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

from measurements.gallery.index_page import index_page
from measurements.gallery.markdown import (
    INDEX,
    clip_path,
    portrait_path,
    robot_path,
    task_path,
)
from measurements.gallery.record import COMMAND, Record
from measurements.gallery.robot_page import robot_page
from measurements.gallery.sources import Sources, files_of, robots, task_classes
from measurements.gallery.task_page import task_page
from robots.common.writing import write_whole

WRITE = "python -m measurements.gallery"


def all_pages(record: Record, folder: Path) -> dict[str, str]:
    """Return every page by its path in the gallery's folder.

    Args:
        record: What was measured.
        folder: The gallery's, for the pictures that are in it.

    Raises:
        GalleryError: If the record lacks a task or a robot.
        ResultsError: If another record cannot be read.
    """
    sources = Sources.read(record, folder)
    pages = {INDEX: index_page(sources)}
    pages |= {task_path(name): task_page(cls, sources) for name, cls in task_classes().items()}
    pages |= {robot_path(name): robot_page(robot, sources) for name, robot in robots().items()}
    return {path: _text(lines) for path, lines in pages.items()}


def write_pages(record: Record, folder: Path) -> int:
    """Write every page, and remove those of tasks and robots that there are no more.

    Returns:
        How many there are.

    Raises:
        GalleryError: If the record lacks a task or a robot.
        UnwritableFileError: If a page cannot be written.
    """
    pages = all_pages(record, folder)
    for path, text in pages.items():
        write_whole(folder / path, text)
    for path in _pages_there(folder) - set(pages):
        (folder / path).unlink()
    return len(pages)


def complaints(record: Record, folder: Path) -> Iterator[str]:
    """Yield what is stale or missing, and the command that mends it.

    Raises:
        GalleryError: If the record lacks a task or a robot.
    """
    pages = all_pages(record, folder)
    for path, text in pages.items():
        if not (folder / path).is_file():
            yield f"{path} is missing; run `{WRITE}`"
        elif (folder / path).read_text(encoding="utf-8") != text:
            yield f"{path} is stale; run `{WRITE}`"
    for path in sorted(_pages_there(folder) - set(pages)):
        yield f"{path} is of no task or robot; run `{WRITE}`"
    pictures = _pictures()
    for path, name in pictures.items():
        if not (folder / path).is_file():
            yield f"{path} is missing; run `{WRITE} --pictures {name}`"
    for path in sorted(Sources.read(record, folder).pictures - set(pictures)):
        yield f"{path} is of no task or robot; remove it"
    yield from _changed_since(record)


def _text(lines: Iterable[str]) -> str:
    return "\n".join(lines).rstrip() + "\n"


def _pages_there(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*.md")}


def _pictures() -> dict[str, str]:
    """Return the path of every picture that there is to be, and of what it is."""
    found = {clip_path(task_id): task_id for task_id in task_classes()}
    return found | {portrait_path(name): name for name in robots()}


def _changed_since(record: Record) -> Iterator[str]:
    """Yield the robots whose URDF is another one than when it was read."""
    for name, robot in robots().items():
        package, urdf = files_of(robot)
        if package.file(urdf).sha256 != record.robot(name).urdf_sha256:
            yield f"the URDF of {name} has changed; run `{COMMAND} {name}`"

"""Makes the recordings and exports of a recipe, and compares their bytes with it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated

from robot_layouts.core.cli import Folder, Word
from robot_layouts.core.commands import notice, printable
from robot_layouts.core.progress import Progress
from robot_layouts.core.writing import write_whole
from robot_layouts.data.export.dataset import Export, export
from robot_layouts.data.playing.command_options import (
    GOES_ON,
    Players,
    RecordingPath,
    megabytes,
    stoppable,
    tell,
)
from robot_layouts.data.playing.environment import versions
from robot_layouts.data.playing.executor import Executor
from robot_layouts.data.playing.scheduler import Event
from robot_layouts.data.reading.json_files import FILE_SIZE
from robot_layouts.data.recipe import (
    Recipe,
    RecordingRecipe,
    load_recipe,
    recipe_text,
    unknown_recording,
)
from robot_layouts.data.recording.record import Summary, record
from robots import RecordingError


def build(
    recipe: RecordingRecipe,
    folder: Path,
    executor: Executor,
    on_event: Callable[[Summary, Event | None], None] = lambda summary, event: None,
) -> Summary:
    """Make a recording and its exports; what is there already is kept.

    Args:
        recipe: How it is made.
        folder: Where its folder is made, and those of its exports.
        executor: Who plays, and draws pictures.
        on_event: See `record`.

    Returns:
        What was recorded.

    Raises:
        RecordingError: If a folder cannot be written, or what was recorded differs from the recipe.
        RobotLayoutsError: See `record` and `export`.
    """
    place = folder / recipe.name
    how = dict(recipe.how)
    summary = record(recipe.task, recipe.seeds, place, executor, on_event=on_event, **how)
    if summary.failed:
        return summary
    if differing := recipe.differing(place):
        raise RecordingError(
            f"{place} is not what the recipe is of: {', '.join(differing)} differ; made_with says"
            " with which versions it was made"
        )
    for name, options in recipe.exports.items():
        if not (folder / name).exists():  # an export appears whole
            wanted = Export(place, out=folder / name, **options)
            export(wanted, executor=executor if wanted.camera_names else None)
    return summary


def build_command(
    recipe: Annotated[Path, Word("RECIPE")],
    *,
    out: Folder,
    only: Sequence[Annotated[str, Word("NAME")]] = (),
    trust: bool = False,
    players: Players,
) -> int:
    """Make the recordings and exports of a recipe, the same to the last bit.

    Where the recipe knows the SHA-256 of the files, they are compared. The same command goes on
    where it was stopped or killed. Exit code: 0 if all was made, 1 if not, or if bytes differ, 2
    for bad usage, 130 if interrupted.

    Args:
        recipe: A YAML file; see `data recipe`.
        out: Folder in which each recording and export has one.
        only: Make these recordings alone.
        trust: Import the modules of tasks and policies that it names.
        players: Who plays.

    Raises:
        RobotLayoutsError: If the recipe is invalid, or something cannot be made.
    """
    read = load_recipe(recipe, trust=trust)
    names = [one.name for one in read.recordings]
    for name in only:
        if name not in names:
            raise unknown_recording(read, name)
    _compare_versions(read)
    complete = True
    for one in read.recordings:
        if not only or one.name in only:
            summary = _build_shown(one, out, players.executor())
            complete &= not summary.failed
            print(printable(str(summary)))
            if one.files and not summary.failed:
                print("every file is that of the recipe, to the last bit")
    return 0 if complete else 1


def _build_shown(recipe: RecordingRecipe, out: Path, executor: Executor) -> Summary:
    line = Progress(len(recipe.seeds), "episodes")

    def show(summary: Summary, event: Event | None) -> None:
        if event is not None:
            tell(line, event, "is not recorded")
        line.update(summary.already + len(summary.played), f"recording {recipe.name}")

    with stoppable(lambda: GOES_ON), line:
        return build(recipe, out, executor, show)


def _compare_versions(recipe: Recipe) -> None:
    """Say which versions are not those of the recipe: bits may differ then."""
    here = versions(recipe.made_with)
    other = [
        f"{name} {version}, here {here.get(name, 'none')}"
        for name, version in recipe.made_with.items()
        if here.get(name) != version
    ]
    if other:
        notice(f"the recipe was made with {'; '.join(other)}")


def recipe_command(
    recording: RecordingPath,
    *,
    out: Annotated[Path, Word("RECIPE")],
    name: str = "recording",
    file_size: Annotated[float, Word("MB", megabytes)] = FILE_SIZE,
) -> None:
    """Write the recipe of a recording, with which it is made again.

    Exit code: 0 if it was written, 1 if not, 2 for bad usage.

    Args:
        recording: The folder of a recording, or one on the Hub.
        out: The recipe, a YAML file.
        name: Of the recording, whose folder is called so.
        file_size: The --file-size with which it was recorded.

    Raises:
        RobotLayoutsError: If it cannot be read, or not be recorded again.
    """
    write_whole(out, recipe_text(recording, name, out.parent, file_size))
    print(f"{out}: `robot-layouts data build {out} --out DIR` makes it again")

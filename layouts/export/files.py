"""What an export leaves behind: names of files, folders, and a note on licences."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import contextmanager, suppress
from itertools import count
from pathlib import Path

from objects import ObjectDescriptor
from robot_layouts.core.writing import written_whole
from robots import LayoutError, RobotDescriptor, UrdfLocator
from robots.assets.assembled import AssembledUrdf
from robots.assets.manifest import load_manifest
from robots.descriptor import UrdfSource

USD_ENDINGS = (".usd", ".usda", ".usdc")
LICENCES = "LICENCES.md"  # a note on those of robot files


def expect_ending(path: str | os.PathLike[str], what: str, *endings: str) -> Path:
    """Return the path of a file to be.

    Args:
        path: The path.
        what: What is saved, for the message.
        endings: What its name may end in.

    Raises:
        LayoutError: If it ends otherwise.
    """
    target = Path(path)
    name = target.name.lower()
    if name in endings or not name.endswith(endings):
        raise LayoutError(
            f"cannot save {what} as {target.name!r}; the name must end in {', '.join(endings)}"
        )
    return target


class Names:
    """Gives out names, none of them twice, whatever the case of their letters."""

    def __init__(self, forbidden: str = r"[^\w.-]") -> None:
        """Give out names.

        Args:
            forbidden: Pattern of a character that no name may have; ``_`` takes its place.
        """
        self._forbidden = re.compile(forbidden, re.ASCII)
        self._taken: set[str] = set()

    def new(self, wanted: str) -> str:
        """Return a name that is free: the one wanted, or it with a number behind it."""
        plain = self._forbidden.sub("_", wanted)
        numbered = (plain if i == 1 else f"{plain}_{i}" for i in count(1))
        name = next(name for name in numbered if name.lower() not in self._taken)
        self._taken.add(name.lower())
        return name


@contextmanager
def replaced_folder(folder: Path, is_own: Callable[[Path], bool], advice: str) -> Generator[Path]:
    """Give a folder to fill; at the end it takes the place of what an earlier export left.

    Args:
        folder: The folder to be.
        is_own: Tells of what lies in a folder of that name whether an export leaves such.
        advice: What to do if there is something else, for the message.

    Raises:
        LayoutError: If the folder holds something else, which would be lost.
        UnwritableFileError: If it cannot be written.
    """
    strange: list[str] = []
    with suppress(FileNotFoundError):  # none, or another export is just replacing it
        if folder.is_dir():
            strange = [found.name for found in sorted(folder.iterdir()) if not is_own(found)]
    if strange:
        raise LayoutError(
            f"{folder} would be replaced, but holds {', '.join(strange)}, which no export of a"
            f" layout leaves; move it, or {advice}"
        )
    with written_whole(folder, over=True) as made:
        made.mkdir(parents=True)
        yield made


def licence_note(robots: Iterable[RobotDescriptor], things: Iterable[ObjectDescriptor] = ()) -> str:
    """Return a page that says under what licence the files of some robots and things are.

    Args:
        robots: The robots, of which each is listed once.
        things: The things, likewise.
    """
    lines = [f"- {robot.name}: {words}" for robot in robots for _, words in licences_of(robot)]
    lines = list(dict.fromkeys([*lines, *(f"- {one.name}: {one.licence}" for one in things)]))
    head = (
        "# Robot files\n\nThe meshes and numbers of robots are made of files that others wrote."
        " They are not this package's, and stay under their licences:\n"
    )
    return "\n".join([head, *lines, ""])


def short_licences(robots: Iterable[RobotDescriptor]) -> tuple[str, ...]:
    """Return the short names of the licences of some robots' files, each once."""
    return tuple(dict.fromkeys(name for robot in robots for name, _ in licences_of(robot)))


def licences_of(robot: RobotDescriptor) -> Iterator[tuple[str, str]]:
    """Yield the licence of each part of a robot: its short name, and what to know about it."""
    return _licences(robot.urdf)


def _licences(source: UrdfSource) -> Iterator[tuple[str, str]]:
    if isinstance(source, AssembledUrdf):
        for part in (source.body, *(part.urdf for part in source.parts)):
            yield from _licences(part)
    elif isinstance(source, UrdfLocator):
        origin = load_manifest().package(source.package).origin
        yield origin.licence, f"{origin.licence} ({origin.licence_note})"
    else:
        words = "of a file of the user's own; its author decides the licence"
        yield "unknown", words

"""Which robot a word means: a listed name, the path of a URDF or MJCF, or ``MODULE:NAME``."""

from __future__ import annotations

import os
import sys
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from robot_layouts.core.errors import AssetError, DescriptorError, closest_match
from robot_layouts.core.importing import imported
from robot_layouts.core.paths import absolute
from robot_layouts.core.quoting import shown
from robots.assets.locator import LocalUrdf
from robots.descriptor import RobotDescriptor
from robots.mjcf.locator import ENDINGS, LocalMjcf, is_mjcf
from robots.registry import ROBOTS, RobotRegistry, checked_robot

if TYPE_CHECKING:
    from robots.guess import Guess

FORMS = (
    "a name (`robot-layouts robots list` has all), the path of a URDF or MJCF, or MODULE:NAME of"
    " a RobotDescriptor of yours"
)
"""What a robot goes by, for messages and help."""

_modules: dict[RobotDescriptor, str] = {}  # MODULE:NAME of each robot that was named so


def is_path(word: object, folder: str | os.PathLike[str] = "") -> bool:
    """Return whether a word is the path of a URDF or MJCF, and no other name of a robot.

    Args:
        word: The word.
        folder: What a path is relative to; the present folder unless it is given.
    """
    if isinstance(word, os.PathLike):
        return True
    if not isinstance(word, str):
        return False
    if word.partition("?")[0].endswith((".urdf", ".xacro", *ENDINGS)):
        return True
    return os.sep in word and os.path.isfile(os.path.join(folder, word))


def named_robot(word: str | os.PathLike[str]) -> RobotDescriptor:
    """Return the robot that a word of the user's means; see `FORMS`.

    From a path the robot is guessed. The module of ``MODULE:NAME`` is imported, so that this is
    not for words of files: those go through `robot_in_file`.

    Raises:
        UnknownNameError: If no robot has that name.
        AssetError: If the file or a mesh of it is missing, or it describes no robot.
        DescriptorError: If nothing moves in it, or a module has no such robot.
        MissingPackageError: If it is an MJCF, and MuJoCo is not installed.
    """
    if is_path(word):
        return guessed_robot(word).descriptor
    if isinstance(word, str) and ":" in word:
        return _of_module(word)
    if isinstance(word, str) and word not in ROBOTS:
        raise ROBOTS.unknown(word, f"A robot goes by {FORMS}.")
    return RobotRegistry.load(word)  # type: ignore[arg-type]  # which says what it takes


def guessed_robot(path: str | os.PathLike[str]) -> Guess:
    """Return what is guessed from a URDF or MJCF; see `named_robot` for the errors."""
    _expect_file(absolute(path, "the path of a robot"))
    from robots.from_urdf import guess_descriptor

    return guess_descriptor(path)


def robot_in_file(word: str, place: str, folder: Path) -> RobotDescriptor:
    """Return the robot that a file, such as a layout's, names for a place.

    A file chooses no code that runs: the module of ``MODULE:NAME`` has to be imported already, and
    a xacro template expanded, as they are once the user has named them.

    Args:
        word: The file's word; a path is relative to its folder.
        place: The place, for the message.
        folder: The file's folder.

    Raises:
        DescriptorError: If code would run that the user has not named.
        RobotLayoutsError: As `named_robot`.
    """
    from robots.urdf.cleaning.xacro_files import template_of, was_expanded
    from robots.urdf.summary import is_template_file

    module = word.partition(":")[0]
    if is_path(word, folder):
        path = absolute(word if word.startswith("~") else folder / word, f"the robot of {place!r}")
        path = Path(os.path.normpath(path))
        _expect_file(path)
        if not is_mjcf(path) and is_template_file(path) and not was_expanded(*template_of(path)):
            raise _unnamed(word, place, "a xacro template", f"guess {word} from Python")
        return named_robot(path)
    if ":" in word and module not in sys.modules:
        raise _unnamed(word, place, f"code of the module {module!r}", f"import {module}")
    return named_robot(word)


def written_robot(robot: RobotDescriptor, folder: Path) -> str | None:
    """Return the word by which `robot_in_file` gives an equal robot; None if there is none.

    Args:
        robot: The robot.
        folder: Where the file will be; a path is relative to it.
    """
    if word := _modules.get(robot):
        return word
    if robot.name in ROBOTS and ROBOTS[robot.name] == robot:
        return robot.name
    if not isinstance(robot.urdf, LocalUrdf | LocalMjcf):
        return None
    path = absolute(robot.urdf.path, f"the path of {robot.name}")
    try:
        if named_robot(path) != robot:
            return None
    except (AssetError, DescriptorError):  # it is no longer what it was
        return None
    word = Path(os.path.relpath(path, folder.absolute())).as_posix()
    return word if is_path(word) else f"./{word}"


def _expect_file(path: Path) -> None:
    """Refuse the path of a file that is not there, and name the one that it is most like."""
    from robots.urdf.cleaning.xacro_files import template_of

    file = template_of(path)[0]
    if not os.path.lexists(file):
        beside: list[str] = []
        with suppress(OSError, ValueError):  # the folder is not there, either
            beside = os.listdir(file.parent)
        match = closest_match(file.name, beside)
        hint = f"Did you mean {match!r}?" if match else f"A robot goes by {FORMS}."
        raise AssetError(f"there is no file {shown(str(file))}. {hint}")


def _of_module(word: str) -> RobotDescriptor:
    """Return the robot of ``MODULE:NAME``, and remember what it goes by."""
    found = imported(word, "robot", DescriptorError, f"A robot goes by {FORMS}.")
    robot = checked_robot(found, word)
    if robot.name not in ROBOTS.lines or ROBOTS[robot.name] != robot:
        _modules[robot] = word
    return robot


def _unnamed(word: str, place: str, what: str, otherwise: str) -> DescriptorError:
    return DescriptorError(
        f"{word!r} is {what}, and a file chooses no code that runs: name it with the command, as"
        f" {place}={word} (--robots {place}={word} where there is that option), or"
        f" {otherwise} before"
    )

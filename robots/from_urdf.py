"""``robot-layouts robots guess``: a descriptor from a URDF or MJCF, and the reasons."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping, Sequence
from contextlib import redirect_stdout
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any

from robot_layouts.core.cli import Folder, Word, main_of
from robot_layouts.core.commands import start
from robot_layouts.core.errors import (
    AssetError,
    DescriptorError,
    MissingPackageError,
    UnknownNameError,
)
from robot_layouts.core.paths import absolute
from robots.assets.locator import LocalUrdf
from robots.guess import Guess, guess
from robots.guessing.hints import NOTHING, Hints, hints_of
from robots.mjcf.locator import LocalMjcf, is_mjcf
from robots.urdf.cleaning.xacro_files import template_of, with_arguments
from robots.urdf.reading import model_of
from robots.urdf.srdf import read_semantics

__all__ = ["Guess", "guess_descriptor", "main"]

URDF, MJCF = "urdf", "mjcf"  # as robot_descriptions has them, too


def guess_descriptor(
    path_or_name: str | os.PathLike[str],
    name: str | None = None,
    *,
    form: str | None = None,
    xacro: Mapping[str, object] | None = None,
    srdf: str | os.PathLike[str] | None = None,
    folder: str | os.PathLike[str] | None = None,
    **overrides: Any,
) -> Guess:
    """Guess a robot's descriptor from its URDF or its MJCF; nothing is fetched for a path.

    Args:
        path_or_name: A URDF or an MJCF on this machine, or a name of the package
            robot_descriptions, which clones the robot's repository if it has not before. A xacro
            template will do, if the package xacro is installed.
        name: Registry name; None takes that of the URDF or MJCF.
        form: ``"urdf"`` or ``"mjcf"``; None goes by the ending, ``.xml`` and ``.mjcf`` for an MJCF.
        xacro: Arguments of the template, as in ``{"prefix": "left_"}``.
        srdf: An SRDF, whose groups are the arms and grippers, whose chains end in TCPs, and whose
            states and disabled pairs are taken over. None takes disabled pairs of one beside the
            URDF that is called as it, and nothing else.
        folder: A folder whose files may be read, too, such as that of a package which lies
            neither around nor beside the file.
        **overrides: Fields of `robots.RobotDescriptor` that are known better than guessed.
            ``limbs={"left": "1"}`` calls the guessed limb 1 so; limbs that are left out are held.

    Returns:
        The guess: ``.descriptor``, ``.reasons``, and ``.module()``, the data module to paste.

    Raises:
        AssetError: If the file or a mesh of it is missing, or it describes no robot.
        DescriptorError: If nothing moves, or an override contradicts the rest.
        MissingPackageError: If a name is given and robot_descriptions is not installed, a template
            and xacro is not, or an MJCF and MuJoCo is not.
        UnknownNameError: If robot_descriptions has no robot of that name, or the SRDF names a
            group, link or joint that does not exist.
    """
    path = _find(path_or_name, form)
    opened = None if folder is None else str(absolute(folder, "folder"))
    if form == MJCF or (form is None and is_mjcf(path)):
        if xacro or srdf:
            what = "arguments of xacro" if xacro else "SRDF"
            raise DescriptorError(f"{path} is an MJCF, which takes no {what}")
        from robots.mjcf.conversion import convert

        mjcf = LocalMjcf(str(path), opened)
        mjcf.locate()
        return guess(mjcf, name, overrides, file=path, hints=convert(path).hints)
    source = LocalUrdf(str(with_arguments(path, xacro or {})), opened)
    return guess(source, name, overrides, hints=_semantics(source, srdf) if srdf else NOTHING)


def _semantics(source: LocalUrdf, srdf: str | os.PathLike[str]) -> Hints:
    """Return what an SRDF makes known of the robot of a URDF."""
    file = absolute(srdf, "the path of the SRDF")
    return hints_of(read_semantics(file, model_of(source.locate())), file.name)


def _argument(text: str) -> tuple[str, str]:
    key, equals, value = text.partition("=")
    if not key or not equals:
        raise ValueError(f"{text!r} is not KEY=VALUE, such as prefix=left_")
    return key, value


def print_guess(
    urdf: Annotated[str, Word("PATH")],
    *,
    name: str | None = None,
    module: bool = False,
    xacro: Annotated[Sequence[tuple[str, str]], Word("KEY=VALUE", _argument, action="append")] = (),
    srdf: Annotated[str, Word("FILE")] | None = None,
    folder: Folder | None = None,
    all: bool = False,
) -> None:
    """Guess a robot's descriptor from its URDF or MJCF, and say what weakens it.

    Args:
        urdf: A URDF or an MJCF (.xml) on this machine, or a name of the package
            robot_descriptions, such as panda_description or panda_mj_description.
        name: Registry name of the robot (the name in its file).
        module: Print the data module to paste.
        xacro: Argument of a xacro template; may be given again.
        srdf: SRDF with the robot's groups, states and disabled pairs.
        folder: Folder whose files may be read, too, such as that of a package elsewhere.
        all: Say all that was guessed, and why.

    Raises:
        RobotLayoutsError: If the file is unusable, or there is no robot of that name.
    """
    found = guess_descriptor(urdf, name, xacro=dict(xacro), srdf=srdf, folder=folder)
    print(found.module().rstrip("\n") if module else found if all else found.summary())


def _find(path_or_name: str | os.PathLike[str], form: str | None) -> Path:
    """Return the path, or what robot_descriptions has of that name."""
    path = absolute(path_or_name, f"the path of the {(form or URDF).upper()}")
    path = Path(os.path.normpath(path))
    is_name = isinstance(path_or_name, str) and path_or_name.isidentifier()
    if os.path.exists(template_of(path)[0]) or not is_name:
        return path
    return _described(str(path_or_name), form)


def _described(name: str, form: str | None) -> Path:
    if find_spec("robot_descriptions") is None:
        raise MissingPackageError(
            f"there is no file {name}; names of robots are looked up in the package"
            " robot_descriptions, which is not installed: pip install robot_descriptions"
        )
    catalogue: Any = import_module("robot_descriptions._descriptions").DESCRIPTIONS
    forms = (form,) if form else (URDF, MJCF)
    has = {
        key: [f for f in forms if getattr(about, f"has_{f}")] for key, about in catalogue.items()
    }
    known = [key for key, found in has.items() if found]
    if name not in known:
        hint = "`robot_descriptions list` has all."
        what = " or ".join(f"{'an' if f == MJCF else 'a'} {f.upper()}" for f in forms)
        raise UnknownNameError(f"robot of robot_descriptions with {what}", name, known, hint)
    try:
        with redirect_stdout(sys.stderr):  # clones, or finds its clone, and talks about it
            module: Any = import_module(f"robot_descriptions.{name}")
    except Exception as error:  # git's own errors, of a package that need not be installed here
        raise AssetError(f"robot_descriptions could not bring {name}: {error}") from error
    path = getattr(module, f"{has[name][0].upper()}_PATH", None)
    if path is None:
        raise AssetError(f"{name} of robot_descriptions is a xacro template, not a URDF")
    return Path(path)


main = main_of(print_guess, "robots guess")

if __name__ == "__main__":
    start(main)

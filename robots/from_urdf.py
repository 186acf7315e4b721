"""`python -m robots.from_urdf PATH`: guesses a descriptor from a URDF, and says why.

PATH is a URDF on this machine, or a name of the package robot_descriptions, such as
`panda_description`, which keeps its own copies of robots.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Mapping, Sequence
from contextlib import redirect_stdout
from difflib import get_close_matches
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from robots.common.commands import exit_code, program, start
from robots.common.errors import AssetError, MissingPackageError, UnknownNameError
from robots.common.paths import absolute
from robots.guess import Guess, guess
from robots.urdf.cleaning.xacro_files import template_of, with_arguments

__all__ = ["Guess", "guess_descriptor", "main"]


def guess_descriptor(
    path_or_name: str | os.PathLike[str],
    name: str | None = None,
    *,
    xacro: Mapping[str, object] | None = None,
    **overrides: Any,
) -> Guess:
    """Guess a robot's descriptor from its URDF; nothing is fetched for a path.

    Args:
        path_or_name: A URDF on this machine, or a name of the package robot_descriptions, which
            clones the robot's repository if it has not before. A xacro template will do, if the
            package xacro is installed.
        name: Registry name; None takes that of the URDF.
        xacro: Arguments of the template, as in ``{"prefix": "left_"}``.
        **overrides: Fields of `robots.RobotDescriptor` that are known better than guessed.

    Returns:
        The guess: ``.descriptor``, ``.reasons``, and ``.module()``, the data module to paste.

    Raises:
        AssetError: If the URDF or a mesh of it is missing, or it describes no robot.
        DescriptorError: If nothing moves, or an override contradicts the rest.
        MissingPackageError: If a name is given and robot_descriptions is not installed, or a
            template and xacro is not.
        UnknownNameError: If robot_descriptions has no URDF of that name.
    """
    return guess(with_arguments(_find(path_or_name), xacro or {}), name, overrides)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the guess, or with ``--module`` the data module to paste.

    Returns:
        0, or 1 if the URDF is unusable, or 2 if there is no robot of that name.
    """
    parser = argparse.ArgumentParser(prog=program("robots.from_urdf"), description=__doc__)
    parser.add_argument("urdf", metavar="PATH", help="URDF, or name in robot_descriptions")
    parser.add_argument("--name", help="registry name of the robot")
    parser.add_argument("--module", action="store_true", help="print the data module to paste")
    parser.add_argument(
        "--xacro",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        type=_argument,
        help="argument of a xacro template; may be given again",
    )
    options = parser.parse_args(arguments)
    return exit_code(lambda: _print(options))


def _print(options: argparse.Namespace) -> None:
    found = guess_descriptor(options.urdf, options.name, xacro=dict(options.xacro))
    print(found.module().rstrip("\n") if options.module else found)


def _argument(text: str) -> tuple[str, str]:
    key, equals, value = text.partition("=")
    if not key or not equals:
        raise argparse.ArgumentTypeError(f"{text!r} is not KEY=VALUE, such as prefix=left_")
    return key, value


def _find(path_or_name: str | os.PathLike[str]) -> Path:
    """Return the path, or what robot_descriptions has of that name."""
    path = absolute(path_or_name, "the path of the URDF")
    is_name = isinstance(path_or_name, str) and path_or_name.isidentifier()
    if os.path.exists(template_of(path)[0]) or not is_name:
        return path
    return _described(str(path_or_name))


def _described(name: str) -> Path:
    if find_spec("robot_descriptions") is None:
        raise MissingPackageError(
            f"there is no file {name}; names of robots are looked up in the package"
            " robot_descriptions, which is not installed: pip install robot_descriptions"
        )
    catalogue: Any = import_module("robot_descriptions._descriptions").DESCRIPTIONS
    with_urdf = [key for key, about in catalogue.items() if about.has_urdf]
    if name not in with_urdf:
        near = get_close_matches(name, with_urdf, n=8, cutoff=0.4)
        hint = f"These are the closest of {len(with_urdf)}; `robot_descriptions list` has them all."
        raise UnknownNameError("robot of robot_descriptions with a URDF", name, near, hint)
    try:
        with redirect_stdout(sys.stderr):  # clones, or finds its clone, and talks about it
            module: Any = import_module(f"robot_descriptions.{name}")
    except Exception as error:  # git's own errors, of a package that need not be installed here
        raise AssetError(f"robot_descriptions could not bring {name}: {error}") from error
    path = getattr(module, "URDF_PATH", None)
    if path is None:
        raise AssetError(f"{name} of robot_descriptions is a xacro template, not a URDF")
    return Path(path)


if __name__ == "__main__":
    start(main)

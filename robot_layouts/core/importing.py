"""Modules by name: of packages that need not be installed, and of users: ``MODULE:NAME``."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from robot_layouts.core.catalogue import reason
from robot_layouts.core.errors import MissingPackageError, RobotLayoutsError, closest_match
from robot_layouts.core.own_packages import PACKAGES


def optional(module: str, what: str, extra: str) -> Any:
    """Return a module of a package that need not be installed.

    Args:
        module: Its name.
        what: What needs which package, for the message.
        extra: What installs it with this library.

    Raises:
        MissingPackageError: If it is not installed.
    """
    try:
        return import_module(module)
    except ImportError as error:
        words = f"{what}: pip install 'robot-layouts[{extra}]'"
        raise MissingPackageError(words) from error


def imported(word: str, what: str, error: type[RobotLayoutsError], hint: str = "") -> Any:
    """Return what ``MODULE:NAME`` names, and import the module; a name may be ``NAME.NAME``.

    Args:
        word: The word.
        what: What is looked for, in a word that an error uses.
        error: What is raised.
        hint: Last sentence of its message.

    Raises:
        RobotLayoutsError: If it cannot be imported, or the module has nothing of that name.
    """
    module, _, attribute = word.partition(":")
    more = f". {hint}" if hint else ""
    try:
        found: Any = import_module(module)
        for part in attribute.split("."):
            if not hasattr(found, part):
                raise error(f"no {what} {word!r}: {_lacking(found, module, attribute, part, more)}")
            found = getattr(found, part)
    except RobotLayoutsError:
        raise
    except (Exception, SystemExit) as cause:  # whatever the user's own code does
        raise error(f"no {what} {word!r}: {reason(cause)}{more}") from cause
    return found


def _lacking(found: Any, module: str, attribute: str, part: str, more: str) -> str:
    """Say that a module has no such attribute, and why that may be."""
    if (package := module.partition(".")[0]) in PACKAGES:
        more = f"; {package!r} is a package of this library: rename a module of yours"
    elif match := closest_match(part, dir(found)):
        more = f". Did you mean {match!r}?"
    return f"module {module!r} has no attribute {attribute!r}{more}"

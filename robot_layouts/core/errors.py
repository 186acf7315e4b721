"""The one family of errors that the whole library raises."""

from __future__ import annotations

import copyreg
import difflib
import os
from collections.abc import Iterable

from robot_layouts.core.quoting import shortened, shown

_LONGEST_NAME = 1000  # characters; nothing that long is a slip of the pen
_LISTED, _ALIKE = 20, 5  # choices that a message lists; of more than 20, the 5 most alike


class RobotLayoutsError(Exception):
    """Base of every error raised on purpose by this library."""

    def __str__(self) -> str:
        """Return the message as written (``KeyError`` would show its repr), but never pages."""
        return shortened(str(self.args[0])) if self.args else ""

    def __reduce__(self) -> tuple[object, ...]:
        """Pickle by what it holds, so that worker processes can send it home."""
        return (copyreg.__newobj__, (type(self), *self.args), vars(self))  # pyright: ignore


class UnknownNameError(RobotLayoutsError, KeyError):
    """A name that is not in a catalogue; the message names the closest match and the choices."""

    def __init__(self, kind: str, name: object, choices: Iterable[str], hint: str = "") -> None:
        """Compose the message.

        Args:
            kind: What was looked up, in the singular (``"robot"``).
            name: The name that was not found.
            choices: Every name that would have been accepted.
            hint: A last sentence, such as how to add a name.
        """
        self.kind, self.name, self.choices = kind, name, tuple(choices)
        super().__init__(unknown_name_message(kind, name, self.choices, hint))


class DescriptorError(RobotLayoutsError, ValueError):
    """A robot descriptor that contradicts itself or the URDF it describes."""


class LayoutError(RobotLayoutsError, ValueError):
    """A layout that cannot be built: duplicate names, bad poses, unknown keyframes."""


class ActionError(RobotLayoutsError, ValueError):
    """An action of the wrong shape or type, or with numbers that are not finite."""


class AssetError(RobotLayoutsError, OSError):
    """Robot files that could not be found or did not match the manifest."""


class UnreadableFileError(RobotLayoutsError, OSError):
    """A file that cannot be read: it is missing, no regular file, too large, or not as it says."""

    def __init__(
        self, path: str | os.PathLike[str], reason: str, number: int | None = None
    ) -> None:
        """Compose the message.

        Args:
            path: The file.
            reason: What is wrong with it; also the error's ``strerror``.
            number: The error's ``errno``.
        """
        super().__init__(f"cannot read {os.fspath(path)}: {reason}")
        self.filename, self.strerror, self.errno = path, reason, number

    def __reduce__(self) -> tuple[object, ...]:
        """Pickle by what it was composed of: an ``OSError`` holds that apart."""
        return (type(self), (self.filename, self.strerror, self.errno))


class UnwritableFileError(RobotLayoutsError, OSError):
    """A file that cannot be written; what was there before stays."""


class MotionError(RobotLayoutsError, ValueError):
    """A motion, or what is asked of one, that contradicts itself or the layout."""


class NoPlanError(RobotLayoutsError, RuntimeError):
    """A motion that was not found, with the reason."""

    def __init__(self, message: str, reason: str, missing: float = 0.0) -> None:
        """Compose the error.

        Args:
            message: What was asked, what stands in the way, and what would help.
            reason: ``"start in collision"``, ``"goal in collision"``, ``"unreachable"``,
                ``"cut off"`` (something is in the way, whichever way round) or ``"not found"``.
            missing: How far a goal that is unreachable stays away (m).
        """
        super().__init__(message)
        self.reason, self.missing = reason, missing


class SimulationError(RobotLayoutsError, RuntimeError):
    """A world that cannot be built or stepped as asked."""


class DivergedError(SimulationError):
    """Physics that diverged: something is nowhere, or flies off."""


class TaskError(RobotLayoutsError, ValueError):
    """A task asked for something that it does not offer (a mode, a field, a robot)."""


class RecordingError(RobotLayoutsError, OSError):
    """A recording that cannot be written or read."""


class MissingPackageError(RobotLayoutsError, ImportError):
    """An optional package that the call needs is not installed; the message names the command."""


def closest_match(name: object, choices: Iterable[str]) -> str | None:
    """Return the choice most like ``name`` (ignoring case), or None if nothing is close."""
    return next(iter(_alike(name, choices, 1, 0.5)), None)


def refuse(problems: Iterable[str], error: type[RobotLayoutsError]) -> None:
    """Raise an error that says the first of some problems, if there is one.

    Args:
        problems: What is wrong, a sentence each; looked for no further than the first.
        error: What is raised.

    Raises:
        RobotLayoutsError: The given error.
    """
    for problem in problems:
        raise error(problem)


def unknown_name_message(kind: str, name: object, choices: Iterable[str], hint: str = "") -> str:
    """Say that ``name`` is not a ``kind``, the closest match, and all choices or those like it."""
    choices = tuple(choices)
    match = closest_match(name, choices)
    suggestion = f"Did you mean {match!r}?" if match else ""
    listing = f"Choices: {', '.join(choices) or 'none'}."
    if len(choices) > _LISTED:
        near = _alike(name, choices, _ALIKE, 0.4)
        listing = f"The closest of {len(choices)}: {', '.join(near)}." if near else ""
    parts = (f"unknown {kind} {shown(name)}.", suggestion, listing, hint)
    return " ".join(part for part in parts if part)


def _alike(name: object, choices: Iterable[str], most: int, cutoff: float) -> list[str]:
    """Return the choices that are like a name (ignoring case), the closest first."""
    by_lower = {choice.lower(): choice for choice in choices}
    text = str(name)
    if len(text) > _LONGEST_NAME:
        return []
    found = difflib.get_close_matches(text.lower(), by_lower, n=most, cutoff=cutoff)
    return [by_lower[choice] for choice in found]


def missing_name(module: str, name: str, names: Iterable[str]) -> AttributeError:
    """Return what a module's ``__getattr__`` raises for a name that is missing.

    Args:
        module: The module.
        name: What it was asked for.
        names: What it has.
    """
    names = sorted(names)
    match = closest_match(name, names)
    suggestion = f" Did you mean {match!r}?" if match else ""
    return AttributeError(f"{module} has no {name!r}.{suggestion} It has {', '.join(names)}.")

"""A note on the licences of robot files, for what takes copies of them along."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from robots import RobotDescriptor, UrdfLocator
from robots.assets.assembled import AssembledUrdf
from robots.assets.manifest import load_manifest
from robots.descriptor import UrdfSource


def licence_note(robots: Iterable[RobotDescriptor]) -> str:
    """Return a page that says under what licence the files of some robots are.

    Args:
        robots: The robots, of which each is listed once.
    """
    lines = dict.fromkeys(
        f"- {robot.name}: {line}" for robot in robots for line in _licences(robot.urdf)
    )
    head = (
        "# Robot files\n\nThe meshes and numbers of robots are made of files that others wrote."
        " They are not this package's, and stay under their licences:\n"
    )
    return "\n".join([head, *lines, ""])


def short_licences(robots: Iterable[RobotDescriptor]) -> tuple[str, ...]:
    """Return the short names of the licences of some robots' files, each once."""
    names = (name for robot in robots for name in _names(robot.urdf))
    return tuple(dict.fromkeys(names))


def _licences(source: UrdfSource) -> Iterator[str]:
    for part in _parts(source):
        if isinstance(part, UrdfLocator):
            origin = load_manifest().package(part.package).origin
            yield f"{origin.licence} ({origin.licence_note})"
        else:
            yield "of a file of the user's own; whoever wrote it says under what licence it is"


def _names(source: UrdfSource) -> Iterator[str]:
    for part in _parts(source):
        if isinstance(part, UrdfLocator):
            yield load_manifest().package(part.package).origin.licence
        else:
            yield "unknown"


def _parts(source: UrdfSource) -> Iterator[UrdfSource]:
    if isinstance(source, AssembledUrdf):
        yield from _parts(source.body)
        for part in source.parts:
            yield from _parts(part.urdf)
    else:
        yield source

"""Finds the files that a URDF refers to by names that nearly fit."""

from __future__ import annotations

import os
import posixpath
import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from functools import cache
from itertools import chain
from pathlib import Path
from xml.etree.ElementTree import Element

from robot_layouts.core.errors import AssetError, UnreadableFileError
from robot_layouts.core.files import read_regular
from robots.urdf.paths import DEEPEST_PACKAGE, is_workspace, opened_folders, parents, resolve
from robots.urdf.text import parse_xml

MAX_PACKAGE_BYTES = 1 << 20  # of a package.xml
MOST_FOLDERS = 500  # that are looked into on each level of a search for packages

_FIND = re.compile(r"(?:file://)?\$\(find\s+([^)\s]+)\s*\)/*(.*)", re.DOTALL)
_GAZEBO = "model://"

State = tuple[str, int, int, int]
"""A file: its path, inode, size and time of change."""


def file_states(references: Iterable[str], urdf: str) -> tuple[State, ...]:
    """Return what changes with the files that a URDF refers to; nothing of those that are missing.

    Args:
        references: As they stand in the URDF.
        urdf: Its path.
    """
    states: list[State] = []
    for reference in references if posixpath.isabs(urdf) else ():
        with suppress(AssetError, OSError, ValueError):
            path = resolve(reference, urdf, os.path.isfile)
            status = os.stat(path)
            states.append((path, status.st_ino, status.st_size, status.st_mtime_ns))
    return tuple(states)


def repair_references(root: Element, urdf: str) -> Iterator[str]:
    """Have every reference that leads nowhere lead to the one file that it may mean.

    Args:
        root: The ``<robot>``.
        urdf: Its path; one that is relative refers to nothing on this machine.
    """
    repaired: dict[str, str] = {}
    packages = cache(lambda name: _packages(name, posixpath.dirname(urdf)))
    for element in (*root.iter("mesh"), *root.iter("texture")):
        reference = element.get("filename", "")
        if reference.strip() and posixpath.isabs(urdf) and not _leads(reference, urdf):
            found = repaired.get(reference) or next(_meant(reference, urdf, packages), "")
            if found:
                repaired[reference] = found
                element.set("filename", found)
    if repaired:
        reference, found = next(iter(repaired.items()))
        more = f", and {len(repaired) - 1} like it" if len(repaired) > 1 else ""
        yield f"the file {reference!r} was found as {found!r}{more}"


def find_package(name: str, folder: str) -> str:
    """Return the folder of a package; nothing if there is none.

    It is looked for around and beside a folder, in its workspace, and in what was opened to it.

    Args:
        name: As its package.xml gives it, or else its folder.
        folder: Absolute path.
    """
    named = (f"{parent}/{name}" for parent in _holders(folder))
    return next(chain(_packages(name, folder), filter(os.path.isdir, named)), "")


def package_of(reference: str) -> str:
    """Return the name of the package that a reference names; nothing if it names none."""
    text = next(_spellings(reference))
    return text.removeprefix("package://").partition("/")[0] if "package://" in text else ""


def _leads(reference: str, urdf: str) -> bool:
    """Tell whether a reference leads to a file that the URDF may refer to."""
    try:
        return os.path.isfile(resolve(reference, urdf, os.path.isfile))
    except (AssetError, ValueError):
        return False


def _meant(reference: str, urdf: str, packages: Callable[[str], list[str]]) -> Iterator[str]:
    """Yield references to files that a reference may mean, none of which leads where it may not."""
    folder = posixpath.dirname(urdf)
    for text in dict.fromkeys(_spellings(reference)):
        if _leads(text, urdf):
            yield text
        for path, package in _paths(text, folder, packages):
            if found := _on_disk(path):
                near = Path(os.path.relpath(found, folder)).as_posix()
                holder = posixpath.commonpath((folder, package)) if package else ""
                holder = posixpath.dirname(package) if holder == package else holder
                far = f"package://{posixpath.relpath(found, holder)}" if package else ""
                yield from (other for other in (near, far) if other and _leads(other, urdf))


def _spellings(reference: str) -> Iterator[str]:
    """Yield what a reference may be short for, or a slip of."""
    text = reference.strip().replace("\\", "/").replace("package:///", "package://")
    if match := _FIND.fullmatch(text):
        text = f"package://{match[1]}/{match[2]}"
    if text.startswith(_GAZEBO):
        text = f"package://{text.removeprefix(_GAZEBO)}"
    yield text
    if "://" not in text and not text.startswith("/"):
        yield f"package://{text}"  # the scheme may have been left out
    if text.startswith("file://") and not text.startswith("file:///"):
        yield text.removeprefix("file://")


def _paths(
    reference: str, folder: str, packages: Callable[[str], list[str]]
) -> Iterator[tuple[str, str]]:
    """Yield absolute paths that a reference may mean, and the package that it names, if any.

    The case of letters is not yet that of the files. No ``..`` leads out of a package.
    """
    scheme, separator, rest = reference.partition("://")
    if not separator:
        yield posixpath.normpath(posixpath.join(folder, reference)), ""
    elif scheme == "package" and ".." not in rest.split("/"):
        name, _, inside = rest.partition("/")
        named = [
            f"{holder}/{entry}"
            for holder in _holders(folder)
            for entry in _listing(holder)
            if entry.lower() == name.lower()
        ]
        for package in (*packages(name), *named):
            yield posixpath.normpath(f"{package}/{inside}"), package


def _holders(folder: str) -> list[str]:
    """Return the folders in which packages may lie: around a folder, and what was opened to it."""
    opened = opened_folders(folder)
    return [folder, *parents(folder)[:-1], *opened, *map(posixpath.dirname, opened)]


def _packages(name: str, folder: str) -> list[str]:
    """Return the folders whose package.xml has a name.

    They lie around a folder, in it or near its package; else in its workspace, or in what was
    opened to it. The package is the nearest folder around with a package.xml; where there is none,
    the folder.
    """
    around = [folder, *parents(folder)]
    own = [parent for parent in around if os.path.isfile(f"{parent}/package.xml")]
    beside = own[0] if own else folder
    near = (_below(place, 1) for place in (folder, beside, posixpath.dirname(beside)))
    workspaces = [parent for parent in around if is_workspace(parent, os.path.exists)]
    far = (_below(place, DEEPEST_PACKAGE) for place in (*workspaces, *opened_folders(folder)))
    found = [place for place in chain(own, *near) if _package_name(place) == name]
    return found or [place for place in chain(*far) if _package_name(place) == name]


def _below(folder: str, levels: int) -> Iterator[str]:
    """Yield the folders with a package.xml below a folder; none is looked for in another."""
    waiting = [folder]
    for _ in range(levels):
        inner = [f"{place}/{name}" for place in waiting for name in _listing(place)[:MOST_FOLDERS]]
        waiting = []
        for place in inner[:MOST_FOLDERS]:
            if os.path.isfile(f"{place}/package.xml"):
                yield place
            elif os.path.isdir(place):
                waiting.append(place)


def _package_name(folder: str) -> str:
    path = f"{folder}/package.xml"
    try:
        root = parse_xml(read_regular(path, MAX_PACKAGE_BYTES), path, "a package.xml")
    except (AssetError, UnreadableFileError):
        return ""
    return (root.findtext("name") or "").strip()


def _on_disk(path: str) -> str:
    """Return the one file whose path differs at most by the case of letters, or nothing."""
    if os.path.isfile(path):
        return path
    parts = path.split("/")
    known = next(n for n in range(len(parts), 0, -1) if os.path.isdir("/".join(parts[:n]) or "/"))
    found = "/".join(parts[:known])
    for part in parts[known:]:
        alike = [name for name in _listing(found) if name.lower() == part.lower()]
        if len(alike) != 1:
            return ""
        found = f"{found}/{alike[0]}"
    return found if os.path.isfile(found) else ""


def _listing(folder: str) -> list[str]:
    try:
        return sorted(os.listdir(folder))
    except OSError:
        return []

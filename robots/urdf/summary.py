"""The text of a URDF as XML, and the files that it refers to."""

from __future__ import annotations

import os
import posixpath
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from xml.etree import ElementTree

from robot_layouts.core.errors import AssetError, UnreadableFileError
from robot_layouts.core.files import read_regular
from robots.urdf.cleaning.cleaning import Cleaned, clean, is_template
from robots.urdf.cleaning.references import find_package, package_of
from robots.urdf.cleaning.xacro_files import XACRO, expand, template_of
from robots.urdf.paths import Exists, is_allowed, resolve
from robots.urdf.text import parse_xml

MAX_URDF_BYTES = 32 << 20


@dataclass(frozen=True)
class UrdfReferences:
    """Mesh files of a URDF, as paths with forward slashes, sorted.

    Attributes:
        collision: Meshes that physics needs.
        visual: Meshes and textures that only pictures need.
    """

    collision: tuple[str, ...]
    visual: tuple[str, ...]


def read_urdf(path: Path) -> bytes:
    """Return the contents of a URDF, repaired where it is clear how, or of an SRDF.

    Raises:
        AssetError: If it cannot be read, is no regular file, is larger than `MAX_URDF_BYTES`, is
            no XML, or is a template that cannot be expanded.
        MissingPackageError: If it is a template and xacro is not installed.
    """
    return _read(path) if path.suffix == ".srdf" else read_cleaned(path).xml


def read_cleaned(path: Path) -> Cleaned:
    """Return the contents of a URDF, repaired where it is clear how, and what was repaired.

    Args:
        path: A URDF or a xacro template, with its arguments if it has some; see
            `robots.urdf.cleaning.xacro_files.with_arguments`.

    Raises:
        AssetError: As `read_urdf`.
        MissingPackageError: As `read_urdf`.
    """
    return clean(read_written(path), path.as_posix())


def read_written(path: Path) -> bytes:
    """Return the contents of a URDF as they are, or of a template as it is expanded.

    Args:
        path: As of `read_cleaned`.

    Raises:
        AssetError: As `read_urdf`.
        MissingPackageError: As `read_urdf`.
    """
    file, arguments = template_of(path)
    contents = _read(file)
    if arguments or is_template(contents, str(file)):
        contents = expand(file, arguments).xml
    return contents


def is_template_file(path: Path) -> bool:
    """Tell whether `read_urdf` has to expand a file: a xacro template, with or without arguments.

    Raises:
        AssetError: If it cannot be read, or is no XML.
    """
    file, arguments = template_of(path)
    return bool(arguments) or is_template(_read(file), str(file))


def _read(path: Path) -> bytes:
    try:
        return read_regular(path, MAX_URDF_BYTES)
    except UnreadableFileError as error:
        kind = "SRDF" if path.suffix == ".srdf" else "URDF"
        raise AssetError(f"cannot read the {kind} {path}: {error.strerror}") from error


def read_references(xml: bytes, urdf: str, exists: Exists = lambda path: False) -> UrdfReferences:
    """Return the files a URDF refers to, as paths in the same folder tree as ``urdf``.

    Args:
        xml: The URDF's contents.
        urdf: Its path, relative to the package or absolute.
        exists: Whether a path exists.

    Raises:
        AssetError: If it is no URDF, or refers to files that it may not refer to; see
            `robots.urdf.paths`.
    """
    found = {
        kind: {resolve(file, urdf, exists) for file in sorted(files)}
        for kind, files in _named_files(xml, urdf).items()
    }
    return UrdfReferences(
        collision=tuple(sorted(found["collision"])),
        visual=tuple(sorted(found["visual"] - found["collision"])),
    )


def expect_files(xml: bytes, urdf: str, *, pictures: bool) -> None:
    """Refuse a URDF that lacks files which it refers to.

    Args:
        xml: The URDF's contents.
        urdf: Its absolute path.
        pictures: Whether the visual meshes are needed too.

    Raises:
        AssetError: As `read_references`, or if a file is not there; says of a package that is not
            there what to do about it.
    """
    named = _named_files(xml, urdf)
    wanted = named["collision"] | (named["visual"] if pictures else set())
    paths = {file: resolve(file, urdf, os.path.isfile) for file in sorted(wanted)}
    missing = {file: path for file, path in paths.items() if not os.path.isfile(path)}
    for package in filter(None, map(package_of, missing)):
        found = find_package(package, posixpath.dirname(urdf))
        if not found:
            raise AssetError(
                f"{urdf} refers to files of the package {package!r}, which is neither around nor"
                " beside it, nor in its workspace: put it there, with its package.xml, or name the"
                " folder that it lies in: folder=… (--folder DIR)"
            )
        if not os.path.isfile(f"{found}/package.xml") and not is_allowed(
            f"{found}/", posixpath.dirname(urdf), os.path.isfile
        ):
            raise AssetError(
                f"{urdf} refers to files of the package {package!r}; {found} is called so, but has"
                f" no package.xml: put one there, or let it be read with folder={found!r}"
            )
    if missing:
        listing = ", ".join(sorted(set(missing.values())))
        raise AssetError(f"{urdf} refers to files that do not exist: {listing}")


@lru_cache(maxsize=64)
def _named_files(xml: bytes, urdf: str) -> dict[str, set[str]]:
    """Return the meshes and textures that a URDF names, by what needs them."""
    root = parse_urdf(xml, urdf)
    found = {
        kind: {
            element.get("filename", "")
            for file in ("mesh", "texture")
            for element in root.iterfind(f".//{kind}//{file}")
        }
        for kind in ("collision", "visual")
    }
    found["visual"] |= {file.get("filename", "") for file in root.iterfind("./material/texture")}
    return found


def root_of(urdf: Path) -> ElementTree.Element:
    """Return the ``<robot>`` element of a URDF, repaired where it is clear how, or of an SRDF.

    Raises:
        AssetError: As `read_urdf` and `parse_urdf`.
        MissingPackageError: As `read_urdf`.
    """
    return parse_urdf(read_urdf(urdf), urdf.as_posix())


def parse_urdf(xml: bytes, urdf: str) -> ElementTree.Element:
    """Return the ``<robot>`` element of a URDF.

    Raises:
        AssetError: If the text is no XML, declares entities, holds no robot, or is a template.
    """
    root = parse_xml(xml, urdf, "a URDF")
    if root.tag != "robot":
        raise AssetError(f"{urdf} is not a URDF: it holds <{root.tag}>, not <robot>")
    if any([f"{XACRO}}}" in element.tag for element in root.iter()]):  # quicker than one by one
        raise AssetError(f"{urdf} is a xacro template; only a file of its own is expanded")
    return root

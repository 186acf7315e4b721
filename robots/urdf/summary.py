"""The text of a URDF as XML, the files that it refers to, and one number that stands for them."""

from __future__ import annotations

import hashlib
import os
import posixpath
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from xml.etree import ElementTree

from robot_layouts.core.errors import AssetError, UnreadableFileError
from robot_layouts.core.files import read_regular
from robots.descriptor import UrdfSource
from robots.urdf.cleaning.cleaning import Cleaned, clean, is_template
from robots.urdf.cleaning.references import find_package, package_of
from robots.urdf.cleaning.xacro_files import XACRO, expand, template_of
from robots.urdf.mesh_files import MAX_MESH_BYTES
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


def srdf_beside(urdf: Path) -> Path | None:
    """Return the SRDF of a URDF's name, or None if there is none.

    It lies beside the URDF, or in a folder ``srdf`` beside the URDF's, as in ROS packages.
    """
    beside = urdf.with_suffix(".srdf")
    for srdf in (beside, urdf.parent.parent / "srdf" / beside.name):
        if os.path.lexists(srdf):
            return srdf
    return None


def asset_fingerprint(source: UrdfSource) -> str:
    """Return a SHA-256, in hex, over every file that physics reads.

    These are the URDF, the SRDF beside it if there is one, and the collision meshes, each with
    its path relative to the URDF; where on this machine they are makes no difference. Of a xacro
    template it is what the template makes, and the paths in that.

    Args:
        source: Where the URDF comes from; files are fetched and checked as for a simulation.

    Raises:
        AssetError: If a file cannot be found or read.
    """
    lines = (f"{digest}  {name}\n" for name, digest in _checksums(source))
    return hashlib.sha256("".join(lines).encode()).hexdigest()


def asset_checksums(source: UrdfSource, *, pictures: bool = False) -> dict[str, str]:
    """Return the SHA-256, in hex, of each of these files, by its path relative to the URDF.

    Args:
        source: Where the URDF comes from.
        pictures: Whether to add the visual meshes that it names.

    Raises:
        AssetError: If a file cannot be found or read.
    """
    return dict(_checksums(source, pictures=pictures))


def _checksums(source: UrdfSource, *, pictures: bool = False) -> list[tuple[str, str]]:
    urdf = source.locate(pictures=pictures)
    beside = _beside(urdf, pictures=pictures)
    try:
        contents = [(urdf, read_written(urdf))]
        contents += ((path, read_regular(path, MAX_MESH_BYTES)) for path in beside)
    except UnreadableFileError as error:
        raise AssetError(str(error)) from error
    return [
        (Path(os.path.relpath(path, urdf.parent)).as_posix(), hashlib.sha256(data).hexdigest())
        for path, data in contents
    ]


def _beside(urdf: Path, *, pictures: bool) -> list[Path]:
    references = read_references(read_urdf(urdf), urdf.as_posix(), exists=os.path.isfile)
    srdf = srdf_beside(urdf)
    visual = references.visual if pictures else ()
    return [*([srdf] if srdf else []), *map(Path, (*references.collision, *visual))]

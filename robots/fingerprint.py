"""One number that tells whether two robots are built from the same files."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

from robot_layouts.core.errors import AssetError, UnreadableFileError
from robot_layouts.core.files import read_regular
from robots.descriptor import UrdfSource
from robots.urdf.mesh_files import MAX_MESH_BYTES
from robots.urdf.srdf import srdf_beside
from robots.urdf.summary import read_references, read_urdf, read_written


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

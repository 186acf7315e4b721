"""An MJCF that the user keeps on disk, as the source of a robot's URDF."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from robots.assets.locator import LocalUrdf, opened_path

ENDINGS = (".xml", ".mjcf")


def is_mjcf(path: str | os.PathLike[str]) -> bool:
    """Tell whether a path is that of an MJCF, by its ending."""
    return os.fspath(path).lower().endswith(ENDINGS)


def local_source(path: str | os.PathLike[str]) -> LocalMjcf | LocalUrdf:
    """Return the source of a URDF that is, or is made of, a file of the user's."""
    return LocalMjcf(path) if is_mjcf(path) else LocalUrdf(path)


@dataclass(frozen=True)
class LocalMjcf:
    """An MJCF that the user keeps on disk; making one touches nothing.

    Attributes:
        path: Path of the MJCF; ``~`` is the home directory.
        folder: A folder whose files may be read, too.
    """

    path: str | os.PathLike[str]
    folder: str | os.PathLike[str] | None = None

    def locate(self, *, pictures: bool = False) -> Path:
        """Return the path of a URDF made of the MJCF, in the local copy of robot files.

        It lies in a folder that is named by what it was made of, with its meshes. MuJoCo is needed
        only where that folder is not there yet.

        Args:
            pictures: Whether the visual meshes are needed too; they always are there.

        Raises:
            AssetError: If the MJCF or a file of it cannot be read, refers to files that it may not
                refer to, or has what no URDF can have.
            DescriptorError: If nothing moves in it.
            MissingPackageError: If MuJoCo is needed and not installed.
            UnwritableFileError: If the folder cannot be written.
        """
        from robots.mjcf.conversion import locate

        return locate(opened_path(self.path, self.folder))

"""Where a robot's files are on this machine."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from robot_layouts.core.errors import AssetError


@dataclass(frozen=True)
class UrdfLocator:
    """A URDF listed in the manifest of robot files; making one touches nothing.

    Attributes:
        package: Package of the manifest, for example ``"maniskill_panda"``.
        file: Path of the URDF inside the package.
    """

    package: str
    file: str

    def locate(self, *, pictures: bool = False) -> Path:
        """Return the path of the URDF with every file it needs beside it, fetched and checked.

        Args:
            pictures: Whether the visual meshes are needed too.

        Raises:
            UnknownNameError: If the manifest has no such package or URDF.
            AssetError: If a file could not be had from any source; names each and why.
        """
        from robots.assets.fetching import locate

        return locate(self.package, self.file, pictures=pictures)


@dataclass(frozen=True)
class FileLocator:
    """A file of the manifest that belongs to no robot; making one touches nothing.

    Attributes:
        package: Package of the manifest.
        file: Path of the file inside the package.
    """

    package: str
    file: str

    def locate(self) -> Path:
        """Return the path of the file, fetched and checked.

        Raises:
            UnknownNameError: If the manifest has no such package or file.
            AssetError: If it could not be had from any source; says why of each.
        """
        from robots.assets.fetching import locate_file

        return locate_file(self.package, self.file)


@dataclass(frozen=True)
class LocalUrdf:
    """A URDF that the user keeps on disk; making one touches nothing.

    Attributes:
        path: Path of the URDF; ``~`` is the home directory. A xacro template will do, with its
            arguments behind it: ``arm.urdf.xacro?prefix=left_``.
    """

    path: str | os.PathLike[str]

    def locate(self, *, pictures: bool = False) -> Path:
        """Return the absolute path of the URDF after a look at the meshes it refers to.

        Args:
            pictures: Whether the visual meshes are needed too.

        Raises:
            AssetError: If the URDF or a mesh is missing, it describes no robot (see
                `robots.urdf.reading.read_model`), or refers to files that it may not refer to (see
                `robots.urdf.paths`).
        """
        from robots.urdf.reading import read_model
        from robots.urdf.summary import read_references, read_urdf

        path = Path(self.path).expanduser().absolute()
        xml = read_urdf(path)
        read_model(xml, path.as_posix())
        references = read_references(xml, path.as_posix(), exists=os.path.isfile)
        wanted = references.collision + (references.visual if pictures else ())
        missing = [mesh for mesh in wanted if not os.path.isfile(mesh)]
        if missing:
            raise AssetError(f"{path} refers to files that do not exist: {', '.join(missing)}")
        return path

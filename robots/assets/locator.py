"""Where a robot's files are on this machine."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from robot_layouts.core.paths import absolute

# What stands around robots in pictures; physics needs none of it.
SCENERY = "maniskill_tabletop"  # a package of the manifest
# What bodies of ManiSkill's tasks are made of.
HUMANOID_THINGS = "maniskill_humanoid_things"
KITCHEN = "maniskill_kitchen_counter"
ASSEMBLY = "maniskill_fmb"
TASK_FILES = (ASSEMBLY, HUMANOID_THINGS, KITCHEN)


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
            AssetError: If no source has a file; says why of each source.
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

    def __str__(self) -> str:
        """Return package and file."""
        return f"{self.package}/{self.file}"

    def locate(self) -> Path:
        """Return the path of the file, fetched and checked.

        Raises:
            UnknownNameError: If the manifest has no such package or file.
            AssetError: If no source has it; says why of each source.
        """
        from robots.assets.fetching import locate_file

        return locate_file(self.package, self.file)


@dataclass(frozen=True)
class LocalUrdf:
    """A URDF that the user keeps on disk; making one touches nothing.

    Attributes:
        path: Path of the URDF; ``~`` is the home directory. A xacro template will do, with its
            arguments behind it: ``arm.urdf.xacro?prefix=left_``.
        folder: A folder whose files may be read, too: that of a package which lies elsewhere.
    """

    path: str | os.PathLike[str]
    folder: str | os.PathLike[str] | None = None

    def locate(self, *, pictures: bool = False) -> Path:
        """Return the absolute path of the URDF after a look at the meshes it refers to.

        Args:
            pictures: Whether the visual meshes are needed too.

        Raises:
            AssetError: If the URDF or a mesh is missing, it describes no robot (see
                `robots.urdf.reading.read_model`), or refers to files that it may not refer to (see
                `robots.urdf.paths`).
        """
        from robots.urdf.reading import model_of
        from robots.urdf.summary import expect_files, read_urdf

        path = opened_path(self.path, self.folder)
        model_of(path)
        expect_files(read_urdf(path), path.as_posix(), pictures=pictures)
        return path


def opened_path(path: str | os.PathLike[str], folder: str | os.PathLike[str] | None) -> Path:
    """Return the absolute path of a user's file, for which a folder is opened if one is given.

    Raises:
        AssetError: If there is no such folder.
    """
    from robots.urdf.paths import open_folder

    file = Path(path).expanduser().absolute()
    if folder is not None:
        open_folder(file.as_posix(), absolute(folder, "folder").as_posix())
    return file


TABLE = FileLocator(SCENERY, "scene_builder/table/assets/table.glb")
GROUND_TEXTURE = FileLocator(SCENERY, "building/assets/grid_texture.png")
KITCHEN_COUNTER = FileLocator(KITCHEN, "kitchen_counter.glb")
APPLE_BODY, APPLE, BOWL_BODY, BOWL = (
    FileLocator(HUMANOID_THINGS, file)
    for file in (
        "apple_1.ply",
        "apple_1.glb",
        "frl_apartment_bowl_07.ply",
        "frl_apartment_bowl_07.glb",
    )
)
CARDBOARD_BOX = FileLocator(HUMANOID_THINGS, "cardboard_box/textured.obj")  # with these two:
CARDBOARD_BOX_LOOKS = (
    FileLocator(HUMANOID_THINGS, "cardboard_box/box.mtl"),
    FileLocator(HUMANOID_THINGS, "cardboard_box/01.png"),
)
_U = "blue_u", "purple_u", "green_bridge"  # parts whose looks are files of their own
ASSEMBLY_BODIES = tuple(
    FileLocator(ASSEMBLY, file)
    for file in (
        *(f"{part}.ply" for part in _U),
        "board_1.glb",
        "reorienting_fixture.glb",
        "yellow_peg.glb",
    )
)
ASSEMBLY_LOOKS = tuple(FileLocator(ASSEMBLY, f"{part}.glb") for part in _U)

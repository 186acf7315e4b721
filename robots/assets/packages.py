"""Packages on the package index whose wheels hold files: data, and where one is installed."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import metadata
from importlib.util import find_spec
from pathlib import Path

from robot_layouts.core.errors import AssetError


class SourceError(AssetError):
    """Why one source could not give every file it was asked for."""


@dataclass(frozen=True)
class IndexPackage:
    """A package on the package index whose wheel holds files of robots or objects.

    Attributes:
        name: Name on the index, and of a source on the command line.
        robots: Folder of its robots, one folder each, inside the wheel; empty if it has objects.
        prefix: What the names of packages of the manifest begin with that are its robots' folders.
        megabytes: Size of the wheel, roughly.
        hub_dataset: Hugging Face dataset that holds a copy of its files, if one does.
        mount: Folder that its URDFs believe to be in, as ``package://`` has it, if they do.
    """

    name: str
    robots: str
    prefix: str
    megabytes: int
    hub_dataset: str | None = None
    mount: str | None = None


MANI_SKILL = IndexPackage(
    "mani_skill",
    robots="mani_skill/assets/robots",
    prefix="maniskill_",
    megabytes=100,
    hub_dataset="RoboVerseOrg/roboverse_data",
)
EXAMPLE_ROBOT_DATA = IndexPackage(
    "example-robot-data",
    robots="cmeel.prefix/share/example-robot-data/robots",
    prefix="example_",
    megabytes=131,
    mount="example-robot-data/robots",
)
METAWORLD = IndexPackage("metaworld", robots="", prefix="metaworld_", megabytes=37)
PYBULLET = IndexPackage("pybullet", robots="", prefix="pybullet_", megabytes=103)
ROBOSUITE = IndexPackage("robosuite", robots="", prefix="robosuite_", megabytes=157)
OBJECT_PACKAGES = (METAWORLD, PYBULLET, ROBOSUITE)
INDEX_PACKAGES = (MANI_SKILL, EXAMPLE_ROBOT_DATA, *OBJECT_PACKAGES)


def find_package(name: str) -> Path:
    """Return the folder that a package is installed in, without importing it.

    Args:
        name: Its name on the index.

    Raises:
        SourceError: If it is not installed.
    """
    spec = find_spec(name) if name.isidentifier() else None
    locations = list(spec.submodule_search_locations or ()) if spec is not None else []
    if locations:
        return Path(locations[0]).parent
    try:
        return Path(str(metadata.distribution(name).locate_file("")))
    except metadata.PackageNotFoundError:
        raise SourceError(f"{name} is not installed") from None

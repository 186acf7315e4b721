"""``robot-layouts objects fetch``: brings the files of packages' objects to this machine."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

from objects.packaged import PACKAGED
from robot_layouts.core.cli import Word
from robot_layouts.core.errors import UnknownNameError
from robot_layouts.core.paths import default_root
from robots.assets.fetching import default_sources, ensure
from robots.assets.manifest import AssetFile, load_manifest
from robots.assets.store import AssetStore
from robots.fetch_assets import print_files, union

NAME = Word("OBJECT", about="a name of the second list that `robot-layouts objects list` prints")


def fetch(
    objects: Sequence[Annotated[str, NAME]] = (), *, check: bool = False, offline: bool = False
) -> int:
    """Bring the files of objects to this machine, or check them, and print their licences.

    Exit code: 0 if every file is there and right, 1 if not, 2 for bad usage.

    Args:
        objects: Objects to fetch (default: all).
        check: Fetch nothing, only list what is missing or wrong.
        offline: Never use the network.

    Raises:
        RobotLayoutsError: If there is no such object, or no source has a file.
    """
    needs = {name: object_files(name) for name in objects or PACKAGED}
    store = AssetStore(default_root())
    if not check:
        ensure(union(needs), store, default_sources(offline=offline))
    return print_files(needs, store)


def object_files(name: str) -> tuple[AssetFile, ...]:
    """Return the files that an object of a package needs, all its members included.

    Raises:
        UnknownNameError: If no package brings it.
    """
    if name not in PACKAGED:
        raise UnknownNameError("object of a package", name, PACKAGED)
    one = PACKAGED[name]
    package = load_manifest().package(one.package)
    mains = {one.file.format(number) for number in range(one.members)}
    return tuple(file for file in package.files if mains & {*file.physics})

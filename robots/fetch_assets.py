"""``robot-layouts robots fetch``: brings robot files to this machine, or lists what is missing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated

from robot_layouts.core.cli import Word, main_of
from robot_layouts.core.commands import UsageError, print_error, printable, start
from robot_layouts.core.errors import RobotLayoutsError
from robot_layouts.core.paths import absolute, default_root
from robots.assets.fetching import default_sources, ensure
from robots.assets.locator import SCENERY, TASK_FILES, UrdfLocator
from robots.assets.manifest import INDEX_PACKAGES, AssetFile, load_manifest
from robots.assets.sources import AssetSource, HubSource, InstalledPackage, LocalCopy, PackageWheel
from robots.assets.store import AssetStore, FileState, size
from robots.descriptor import RobotDescriptor
from robots.named import FORMS, named_robot
from robots.registry import RobotRegistry

ROBOT_PACKAGES = [package for package in INDEX_PACKAGES if package.robots]
SOURCES = ("local", "hf", *(package.name for package in ROBOT_PACKAGES), "wheel")
ONLINE_SOURCES = ("hf", "wheel")


def fetch(
    robots: Sequence[Annotated[str, Word("ROBOT", about=FORMS)]] = (),
    *,
    check: bool = False,
    offline: bool = False,
    source: Annotated[str, Word(choices=SOURCES)] | None = None,
    dest: Annotated[str, Word("DIR")] | None = None,
    physics_only: bool = False,
    revision: Annotated[str, Word("REV")] | None = None,
) -> int:
    """Bring the files of robots to this machine, or check them.

    Exit code: 0 if every file is there and right, 1 if not, 2 for bad usage.

    Args:
        robots: Robots to fetch (default: all, with scenery and what tasks are made of, or as far as
            --source has them).
        check: Fetch nothing, only list what is missing or wrong.
        offline: Never use the network.
        source: Use this source alone.
        dest: Folder to fill, instead of the usual local copy.
        physics_only: Leave out what only pictures need.
        revision: Branch, tag or commit of the Hub's dataset (default: $ROBOT_LAYOUTS_HF_REVISION,
            or main).

    Raises:
        RobotLayoutsError: If a robot does not exist, or no source has a file.
    """
    if offline and source in ONLINE_SOURCES:
        raise UsageError(f"--source {source} needs the network, which --offline rules out")
    pictures = not physics_only
    failures: list[RobotLayoutsError] = []
    if robots:
        chosen = [named_robot(name) for name in robots]
    else:
        chosen, failures = RobotRegistry.load_all()
    needs = {robot.name: robot_files(robot, pictures=pictures) for robot in chosen}
    if pictures and not robots:
        needs["scenery"] = load_manifest().package(SCENERY).files
    for name in TASK_FILES if not robots else ():
        files = load_manifest().package(name).files
        needs[name] = tuple(file for file in files if pictures or file.physics)
    store = AssetStore(default_root() if dest is None else absolute(dest, "--dest"))
    sources = _sources(source, store, offline=offline, revision=revision)
    if source and not robots:
        needs = {name: files for name, files in needs.items() if _holds_all(sources, files)}
    if not check:
        ensure(union(needs), store, sources)
    code = print_files(needs, store)
    for failure in failures:
        print_error(failure)
    return 1 if failures else code


def _holds_all(sources: Sequence[AssetSource], files: Sequence[AssetFile]) -> bool:
    return all(any(source.holds(file) for source in sources) for file in files)


def robot_files(robot: RobotDescriptor, *, pictures: bool) -> tuple[AssetFile, ...]:
    """Return the files that a robot needs; one with a URDF of the user's own needs none.

    Args:
        robot: The robot.
        pictures: Whether it will also be drawn.

    Raises:
        UnknownNameError: If the manifest has no such package or URDF.
    """
    if not isinstance(robot.urdf, UrdfLocator):
        return ()
    return load_manifest().package(robot.urdf.package).needed(robot.urdf.file, pictures=pictures)


def describe_file(file: AssetFile, store: AssetStore) -> str:
    """Return one line: state, path, size, what it is for."""
    use = "physics" if file.physics else "pictures"
    return f"{store.state(file).value}: {file} ({size(file.bytes)}, {use})"


def _sources(
    source: str | None, store: AssetStore, *, offline: bool, revision: str | None
) -> list[AssetSource]:
    if source is None:
        elsewhere = [LocalCopy(default_root())] if store.root != default_root() else []
        return elsewhere + default_sources(offline=offline, revision=revision)
    chosen: dict[str, list[AssetSource]] = {
        "local": [LocalCopy(default_root())],
        "hf": [HubSource(revision=revision)],
        "wheel": [PackageWheel(package) for package in ROBOT_PACKAGES],
        **{package.name: [InstalledPackage(package)] for package in ROBOT_PACKAGES},
    }
    return chosen[source]


def union(needs: Mapping[str, Sequence[AssetFile]]) -> list[AssetFile]:
    """Return all files that are needed, once each.

    Args:
        needs: Files by what needs them.
    """
    return list(dict.fromkeys(file for files in needs.values() for file in files))


def print_files(needs: Mapping[str, Sequence[AssetFile]], store: AssetStore) -> int:
    """Print which files can be used, and under what licence; return 1 if some cannot, else 0.

    Args:
        needs: Files by what needs them.
        store: Where they are.
    """
    print(printable(f"robot files in {store.root}"))
    for robot, files in needs.items():
        bad = len(store.unusable(files))
        total = f"{len(files)} files, {size(sum(file.bytes for file in files))}"
        print(
            f"  {robot}: " + (f"{bad} of {total} cannot be used" if bad else f"complete, {total}")
        )
    files = union(needs)
    for file in files:
        if store.state(file) is not FileState.VERIFIED:
            print(f"    {describe_file(file, store)}")
    for origin in {file.origin: None for file in files}:
        print(f"  {origin.name}: licence {origin.licence}: {origin.licence_note}")
    return 1 if store.unusable(files) else 0


main = main_of(fetch, "robots fetch")

if __name__ == "__main__":
    start(main)

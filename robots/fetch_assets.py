"""``robot-layouts robots fetch``: brings robot files to this machine, or lists what is missing."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from robots.assets import scenery
from robots.assets.fetching import default_sources, ensure
from robots.assets.locator import UrdfLocator
from robots.assets.manifest import AssetFile, load_manifest
from robots.assets.packages import INDEX_PACKAGES
from robots.assets.progress import size
from robots.assets.sources import (
    REVISION_VARIABLE,
    AssetSource,
    HubSource,
    InstalledPackage,
    LocalCopy,
    PackageWheel,
)
from robots.assets.store import AssetStore, FileState
from robots.common.commands import print_error, printable, start
from robots.common.console import main_of
from robots.common.errors import RobotLayoutsError
from robots.common.paths import absolute, default_root
from robots.descriptor import RobotDescriptor
from robots.named import FORMS, named_robot
from robots.registry import RobotRegistry

SOURCES = ("local", "hf", *(package.name for package in INDEX_PACKAGES), "wheel")
ONLINE_SOURCES = ("hf", "wheel")


def run(options: argparse.Namespace) -> int:
    """Run the command; returns 0 if every file is there and right, 1 if not.

    Raises:
        RobotLayoutsError: If a robot does not exist, or a file cannot be had.
    """
    if options.offline and options.source in ONLINE_SOURCES:
        options.refuse(f"--source {options.source} needs the network, which --offline rules out")
    pictures = not options.physics_only
    failures: list[RobotLayoutsError] = []
    if options.robots:
        robots = [named_robot(name) for name in options.robots]
    else:
        robots, failures = RobotRegistry.load_all()
    needs = {robot.name: robot_files(robot, pictures=pictures) for robot in robots}
    if pictures and not options.robots:
        needs["scenery"] = load_manifest().package(scenery.PACKAGE).files
    chosen = options.dest
    store = AssetStore(default_root() if chosen is None else absolute(chosen, "--dest"))
    sources = _sources(options, store)
    if options.source and not options.robots:
        needs = {name: files for name, files in needs.items() if _holds_all(sources, files)}
    if not options.check:
        ensure(_union(needs), store, sources, trust=options.trust_source)
    code = _report(needs, store)
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
    """Return one line: state, path, size, what it is for, where it came from."""
    state = store.state(file)
    use = "physics" if file.physics else "pictures"
    fetched = store.record().get(str(file)) if state.usable else None
    source = fetched["source"] if fetched else None
    return f"{state.value}: {file} ({size(file.bytes)}, {use}{f'; {source}' if source else ''})"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.epilog = "Exit code: 0 if every file is there and right, 1 if not, 2 for bad usage."
    parser.set_defaults(refuse=parser.error)
    add = parser.add_argument
    which = f"robots to fetch; if none is named, all, or all that --source has; ROBOT: {FORMS}"
    add("robots", nargs="*", metavar="ROBOT", help=which)
    add("--check", action="store_true", help="fetch nothing, only list what is missing or wrong")
    add("--offline", action="store_true", help="never use the network")
    add("--source", choices=SOURCES, help="use this source alone")
    add("--dest", metavar="DIR", help="folder to fill, instead of the usual local copy")
    add("--physics-only", action="store_true", help="leave out what only pictures need")
    add(
        "--trust-source",
        action="store_true",
        help="accept files that differ from the manifest, and mark them",
    )
    add(
        "--revision",
        metavar="REV",
        help=f"branch, tag or commit of the Hub's dataset (default ${REVISION_VARIABLE} or main)",
    )


def _sources(options: argparse.Namespace, store: AssetStore) -> list[AssetSource]:
    if options.source is None:
        elsewhere = [LocalCopy(default_root())] if store.root != default_root() else []
        return elsewhere + default_sources(offline=options.offline, revision=options.revision)
    states = FileState if options.trust_source else (FileState.VERIFIED,)
    present = [state for state in states if state is not FileState.MISSING]
    chosen: dict[str, list[AssetSource]] = {
        "local": [LocalCopy(default_root(), states=present)],
        "hf": [HubSource(revision=options.revision)],
        "wheel": [PackageWheel(package) for package in INDEX_PACKAGES],
        **{package.name: [InstalledPackage(package)] for package in INDEX_PACKAGES},
    }
    return chosen[options.source]


def _union(needs: dict[str, tuple[AssetFile, ...]]) -> list[AssetFile]:
    return list(dict.fromkeys(file for files in needs.values() for file in files))


def _report(needs: dict[str, tuple[AssetFile, ...]], store: AssetStore) -> int:
    print(printable(f"robot files in {store.root}"))
    for robot, files in needs.items():
        bad = len(store.unusable(files))
        total = f"{len(files)} files, {size(sum(file.bytes for file in files))}"
        print(
            f"  {robot}: " + (f"{bad} of {total} cannot be used" if bad else f"complete, {total}")
        )
    files = _union(needs)
    for file in files:
        if store.state(file) is not FileState.VERIFIED:
            print(f"    {describe_file(file, store)}")
    for origin in {file.origin: None for file in files}:
        print(f"  {origin.name}: licence {origin.licence}: {origin.licence_note}")
    return 1 if store.unusable(files) else 0


main = main_of("robots fetch")

if __name__ == "__main__":
    start(main)

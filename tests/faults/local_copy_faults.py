"""Folders of robot files in which something else stands than should."""

from __future__ import annotations

import os
import resource
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

from robot_layouts.core.paths import default_root
from robots.assets.fetching import ensure
from robots.assets.sources import LocalCopy
from robots.assets.store import AssetStore, FileState
from tests.faults.fault import GOES_ON, Fault, sparse
from tests.faults.tiny_files import (
    CONTENTS,
    FILES,
    MESH,
    another_copy,
    deadline,
    expect_all,
    fetch,
    fill,
    settings,
)

AREA = "fetching"
RIGHT = CONTENTS[MESH.path]


# What stands in place of a mesh, and what a local copy with it as a source says.
IN_PLACE: dict[str, Callable[[Path], object]] = {
    "a FIFO": os.mkfifo,
    "a link to itself": lambda path: path.symlink_to(path),
    "a link to /dev/zero": lambda path: path.symlink_to("/dev/zero"),
    "a link to a directory": lambda path: path.symlink_to("/tmp"),
    "5 GB of nothing": sparse,
    "half of it": lambda path: path.write_bytes(RIGHT[: len(RIGHT) // 2]),
    "one bit turned": lambda path: path.write_bytes(bytes([RIGHT[0] ^ 1]) + RIGHT[1:]),
}
ROOTS: dict[str, Callable[[Path], object]] = {
    "a file": lambda path: path.touch(),
    "a FIFO": os.mkfifo,
    "a link to itself": lambda path: path.symlink_to(path),
    "in a file": lambda path: (path.parent.rmdir(), path.parent.touch()),
}
NAMES = {
    "a home of nobody": "~nobody_here/files",
    "in /proc": "/proc/robot_files",
    "a name of 300 letters": "/tmp/" + "x" * 300,
}


def faults() -> Iterator[Fault]:
    """Go through this area's faults."""
    for what, put in IN_PLACE.items():
        yield Fault(AREA, f"in place of a robot file: {what}", partial(_exchanged, put), GOES_ON)
        yield Fault(AREA, f"a local copy to fetch from has {what}", partial(_as_source, put))
    yield Fault(AREA, "in place of a robot file: a directory", _directory)
    yield Fault(AREA, "in place of a package: a file", _package_is_a_file)
    for what, put in ROOTS.items():
        yield Fault(AREA, f"the local copy is {what}", partial(_root, put))
    for what, name in NAMES.items():
        yield Fault(AREA, f"ROBOT_LAYOUTS_ASSETS is {what}", partial(_named, name))
    for what, name in {
        "with a line break": "a\nb",
        "with spaces and quotes": " ' \" ",
        "no UTF-8": "caf\udce9",
        "with ..": "a/../b",
    }.items():
        yield Fault(AREA, f"ROBOT_LAYOUTS_ASSETS is {what}", partial(_odd_name, name), GOES_ON)
    for what, name, put in (
        ("the lock is a FIFO", ".lock", os.mkfifo),
        ("the scratch folder is a file", ".partial", Path.touch),
        ("the scratch folder is a link", ".partial", lambda path: path.symlink_to("/tmp")),
        ("a killed fetch left things behind", ".partial", _left_behind),
    ):
        yield Fault(AREA, what, partial(_beside, name, put), GOES_ON)
    yield Fault(AREA, "the lock is a directory", _lock_is_a_directory)
    yield Fault(AREA, "a disk that becomes full", _full_disk)
    yield Fault(AREA, "no file descriptors left", _no_descriptors)
    yield Fault(AREA, "no source at all", lambda folder: fetch(AssetStore(folder / "a"), []))
    yield Fault(
        AREA,
        "a local copy to fetch from that is not there",
        lambda folder: fetch(AssetStore(folder / "a"), [LocalCopy(folder / "b")]),
    )


def _exchanged(put: Callable[[Path], object], folder: Path) -> None:
    store = fill(AssetStore(folder / "assets"))
    store.path(MESH).unlink()
    put(store.path(MESH))
    with deadline():
        assert store.unusable(FILES) == [MESH]
        fetch(store, [another_copy(folder)])
    assert store.path(MESH).is_file()
    assert not store.path(MESH).is_symlink()


def _as_source(put: Callable[[Path], object], folder: Path) -> None:
    source = another_copy(folder)
    damaged = AssetStore(folder / "elsewhere")
    damaged.path(MESH).unlink()
    put(damaged.path(MESH))
    store = AssetStore(folder / "assets")
    with deadline():
        try:
            fetch(store, [source])
        finally:
            assert store.unusable(FILES) == [MESH]


def _directory(folder: Path) -> None:
    store = fill(AssetStore(folder / "assets"))
    store.path(MESH).unlink()
    (store.path(MESH) / "inside").mkdir(parents=True)
    assert store.state(MESH) is FileState.WRONG
    ensure(FILES, store, [another_copy(folder)])


def _package_is_a_file(folder: Path) -> None:
    store = AssetStore(folder / "assets")
    store.root.mkdir()
    (store.root / MESH.origin.name).touch()
    fetch(store, [another_copy(folder)])


def _root(put: Callable[[Path], object], folder: Path) -> None:
    root = folder / "in" / "assets"
    root.parent.mkdir()
    put(root)
    with deadline(), settings(folder, ROBOT_LAYOUTS_ASSETS=str(root)):
        ensure(FILES, AssetStore(default_root()), [another_copy(folder)])


def _named(name: str, folder: Path) -> None:
    with settings(folder, ROBOT_LAYOUTS_ASSETS=name):
        ensure(FILES, AssetStore(default_root()), [another_copy(folder)])


def _odd_name(name: str, folder: Path) -> None:
    before = Path.cwd()
    os.chdir(folder)
    try:
        with settings(folder, ROBOT_LAYOUTS_ASSETS=name):
            store = AssetStore(default_root())
            fetch(store, [another_copy(folder)])
    finally:
        os.chdir(before)
    assert store.root.is_absolute()
    expect_all(store)


def _beside(name: str, put: Callable[[Path], object], folder: Path) -> None:
    store = AssetStore(folder / "assets")
    store.root.mkdir()
    put(store.root / name)
    with deadline():
        fetch(store, [another_copy(folder)])


def _left_behind(path: Path) -> None:
    (path / "tmp123" / "mani_skill").mkdir(parents=True)
    (path / "tmp123" / "file").write_bytes(b"half a mesh")
    (path / "tmp123" / "link").symlink_to("/etc")


def _lock_is_a_directory(folder: Path) -> None:
    store = AssetStore(folder / "assets")
    (store.root / ".lock").mkdir(parents=True)
    fetch(store, [another_copy(folder)])


def _full_disk(folder: Path) -> None:
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    source, store = another_copy(folder), AssetStore(folder / "assets")
    resource.setrlimit(resource.RLIMIT_FSIZE, (3000, before[1]))
    try:
        fetch(store, [source])
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        assert store.state(FILES[0]) is FileState.VERIFIED
        assert not store.path(FILES[2]).exists()


def _no_descriptors(folder: Path) -> None:
    """Fetch in a process that may open nothing more."""
    script = (
        "import resource, sys\n"
        "from pathlib import Path\n"
        "from tests.faults.tiny_files import *\n"
        "import robots.assets.sources\n"
        "folder = Path(sys.argv[1])\n"
        "source, store = another_copy(folder), AssetStore(folder / 'assets')\n"
        "used = len(os.listdir('/proc/self/fd')) - 1\n"
        "resource.setrlimit(resource.RLIMIT_NOFILE, (used + 1, used + 1))\n"
        "try:\n"
        "    ensure(FILES, store, [source])\n"
        "except RobotLayoutsError as error:\n"
        "    print(error)\n"
    )
    from robots import RobotLayoutsError

    checkout = Path(__file__).parents[2]
    done = subprocess.run(
        [sys.executable, "-c", script, folder], capture_output=True, text=True, cwd=checkout
    )
    assert "Traceback" not in done.stderr, done.stderr
    raise RobotLayoutsError(done.stdout.strip())

"""Three small robot files, and where they are found: for faults of fetching."""

from __future__ import annotations

import hashlib
import io
import os
import re
import signal
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from pathlib import Path
from unittest import mock

from robots import AssetError, RobotLayoutsError
from robots.assets.fetching import ensure
from robots.assets.manifest import AssetFile, PackageOrigin
from robots.assets.sources import AssetSource, LocalCopy
from robots.assets.store import AssetStore, FileState
from tests.robots.hub_server import DATASET

ORIGIN = PackageOrigin(
    name="maniskill_tiny",
    folder="mani_skill/assets/robots/tiny",
    hub_dataset=DATASET,
    hub_folder="robots/maniskill_tiny",
    wheel="mani_skill==3.0.1",
    licence="Apache-2.0",
    licence_note="made up for tests, Apache License 2.0",
)
URDF = b"<robot name='tiny'><link name='base'/></robot>"
CONTENTS = {"tiny.urdf": URDF, "meshes/a.stl": b"solid a" * 400, "meshes/b.stl": b"solid b" * 500}
FILES = tuple(
    AssetFile(ORIGIN, path, len(data), hashlib.sha256(data).hexdigest(), ("tiny.urdf",))
    for path, data in CONTENTS.items()
)
MESH = FILES[1]


def fill(store: AssetStore) -> AssetStore:
    """Put the right files into a local copy, as a person would."""
    for file in FILES:
        store.path(file).parent.mkdir(parents=True, exist_ok=True)
        store.path(file).write_bytes(CONTENTS[file.path])
    return store


def another_copy(folder: Path) -> LocalCopy:
    """Return a source that has everything."""
    return LocalCopy(fill(AssetStore(folder / "elsewhere")).root)


def fetch(store: AssetStore, sources: Sequence[AssetSource]) -> None:
    """Fetch the files; whatever comes of it, nothing half-done stays behind."""
    try:
        ensure(FILES, store, sources)
    except AssetError as error:  # in the same words at every run
        raise AssetError(re.sub(r"(?<=127\.0\.0\.1:)\d{2,}", "…", str(error))) from error
    finally:
        assert not (store.root / ".partial").exists(), "the scratch folder is still there"
        states = {store.state(file) for file in FILES}
        assert states <= {FileState.VERIFIED, FileState.MISSING}, states
    expect_all(store)


def expect_all(store: AssetStore) -> None:
    """Assert that every file is there and right."""
    for file in FILES:
        assert store.state(file) is FileState.VERIFIED, file
        assert store.path(file).read_bytes() == CONTENTS[file.path]


@contextmanager
def settings(folder: Path, **given: str) -> Iterator[None]:
    """Keep away from the caches, network and settings of whoever runs this."""
    kept = {
        name: value
        for name, value in os.environ.items()
        if not name.startswith(("HF_", "PIP_", "ROBOT_LAYOUTS_"))
    }
    own = {
        "ROBOT_LAYOUTS_ASSETS": str(folder / "assets"),
        "HF_HOME": str(folder / "hf_home"),
        "HF_ENDPOINT": "http://127.0.0.1:9",  # nothing listens there
        "PIP_CONFIG_FILE": "/dev/null",
        "PIP_NO_INDEX": "1",
        "NO_PROXY": "127.0.0.1",
    }
    with mock.patch.dict(os.environ, {**kept, **own, **given}, clear=True):
        yield


@contextmanager
def deadline(seconds: int = 30) -> Iterator[None]:
    """Fail what hangs, without waiting for the tests' own limit."""

    def fail(*_: object) -> None:
        raise AssertionError(f"hangs: no end after {seconds} s")

    before = signal.signal(signal.SIGALRM, fail)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def run_main(main: Callable[[Sequence[str]], int], *words: str) -> str:
    """Run a command's ``main`` here and return what it printed.

    Raises:
        RobotLayoutsError: What it printed as its one error, if it refuses.
    """
    out, err = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(err):
        try:
            code = main(words)
        except SystemExit as end:  # of argparse
            code = end.code
    errors = [line for line in err.getvalue().splitlines() if "error: " in line]
    if code:
        assert code in (1, 2), code
        assert len(errors) == 1, f"{len(errors)} errors: {err.getvalue()}"
        raise RobotLayoutsError(errors[0].partition("error: ")[2])
    assert not errors, errors
    return out.getvalue()

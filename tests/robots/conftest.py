"""Robot files for the tests, and a place of its own for everything that a test fetches."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from robot_layouts.core.paths import default_root
from robots.assets import sources as asset_sources
from robots.assets.manifest import AssetFile, SourceError, find_package, load_manifest
from robots.assets.store import AssetStore, FileState
from tests.robots.hub_server import HubServer

REAL_ROOT = default_root()
PANDA = load_manifest().package("maniskill_panda")


def contents(file: AssetFile) -> bytes:
    """Return a robot file from the local copy or an installed mani_skill."""
    store = AssetStore(REAL_ROOT)
    if store.state(file) is FileState.VERIFIED:
        return store.path(file).read_bytes()
    return (find_package("mani_skill") / file.origin.folder / file.path).read_bytes()


@pytest.fixture(autouse=True)
def _own_places(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Keep tests away from the network, from the Hub's cache and from the developer's settings.

    Robots come from the local copy that all tests share; what fetches asks for a `store`.
    """
    for name in list(os.environ):
        if name.startswith(("HF_", "ROBOT_LAYOUTS_")):
            monkeypatch.delenv(name)
    monkeypatch.setenv("ROBOT_LAYOUTS_ASSETS", str(REAL_ROOT))
    monkeypatch.setenv("HF_HOME", str(tmp_path / "hf_home"))
    monkeypatch.setenv("HF_TOKEN", "hf_must_never_leave_this_machine")
    monkeypatch.setenv("HF_ENDPOINT", "http://127.0.0.1:9")  # nothing listens on "discard"
    monkeypatch.setenv("NO_PROXY", "127.0.0.1")


@pytest.fixture
def store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> AssetStore:
    """A local copy in which nothing is yet, in place of the shared one."""
    monkeypatch.setenv("ROBOT_LAYOUTS_ASSETS", str(tmp_path / "assets"))
    return AssetStore(tmp_path / "assets")


@pytest.fixture
def physics() -> tuple[AssetFile, ...]:
    """What a Panda needs without pictures."""
    return PANDA.needed("panda_v2.urdf", pictures=False)


@pytest.fixture
def fill() -> Callable[[AssetStore, tuple[AssetFile, ...]], None]:
    """Return a function that puts right files into a local copy, as a person would."""

    def put(store: AssetStore, files: tuple[AssetFile, ...]) -> None:
        for file in files:
            store.path(file).parent.mkdir(parents=True, exist_ok=True)
            store.path(file).write_bytes(contents(file))

    return put


@pytest.fixture
def hub(monkeypatch: pytest.MonkeyPatch, hub_client: None) -> Iterator[HubServer]:
    """A Hub that holds every Panda file but the large pictures."""
    small = [file for file in PANDA.files if file.bytes < 100_000]
    files = {f"{file.origin.hub_folder}/{file.path}": contents(file) for file in small}
    with HubServer(files) as server:
        monkeypatch.setenv("HF_ENDPOINT", server.endpoint)
        yield server


@pytest.fixture
def hub_client(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Give the Hub's client of this process a cache of its own, and little patience."""
    from huggingface_hub import constants

    monkeypatch.setattr(constants, "HF_HUB_CACHE", str(tmp_path / "hf_home" / "hub"))
    monkeypatch.setattr(constants, "HF_HUB_ETAG_TIMEOUT", 2)  # s
    monkeypatch.setattr(constants, "HF_HUB_DOWNLOAD_TIMEOUT", 2)  # s


@pytest.fixture
def no_mani_skill(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make this process believe that mani_skill is not installed."""

    def refuse(name: str) -> Path:
        raise SourceError(f"{name} is not installed")

    monkeypatch.setattr(asset_sources, "find_package", refuse)


@pytest.fixture
def read_only_folder(tmp_path: Path) -> Iterator[Path]:
    """A folder that even root cannot write to."""
    folder = tmp_path / "read_only"
    folder.mkdir()
    if os.geteuid() != 0:
        folder.chmod(0o555)
        yield folder
        folder.chmod(0o755)
        return
    mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "ro", "none", folder], check=False)
    if mounted.returncode != 0:
        pytest.skip("root may write anywhere here, and may not mount a read-only folder")
    yield folder
    subprocess.run(["umount", folder], check=True)

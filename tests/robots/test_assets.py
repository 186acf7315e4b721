"""The local copy: what is trusted, what is fetched again, what is refused, and in which words."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

import pytest

from robot_layouts.core import paths
from robot_layouts.core.paths import default_root
from robots import AssetError, RobotRegistry, UnknownNameError, UrdfLocator
from robots.assets.fetching import ensure
from robots.assets.manifest import INDEX_PACKAGES, MANI_SKILL, SourceError, load_manifest
from robots.assets.sources import InstalledPackage, LocalCopy
from robots.assets.store import AssetStore, FileState
from robots.urdf.summary import read_references
from tests.catalogue import every_robot
from tests.robots.conftest import REAL_ROOT, contents

pytestmark = pytest.mark.usefixtures("store")


class FakeSource:
    """Gives prepared contents, and keeps a record of what it was asked for."""

    name, title = "fake", "fake source"

    def __init__(self, given: dict[str, bytes], error: str = "") -> None:
        self.given, self.error, self.asked = given, error, []

    def holds(self, file) -> bool:
        return True

    def fetch(self, files, scratch, *, again):
        self.asked.append(([file.path for file in files], again))
        for file in files:
            if file.path in self.given:
                yield file, self.given[file.path]
        if self.error:
            raise SourceError(self.error)


def right(files) -> dict[str, bytes]:
    return {file.path: contents(file) for file in files}


@pytest.mark.parametrize("robot", every_robot())
@pytest.mark.parametrize("pictures", [False, True])
def test_locate_returns_a_urdf_whose_files_are_all_there(robot, pictures, monkeypatch):
    copies = [LocalCopy(REAL_ROOT), *(InstalledPackage(package) for package in INDEX_PACKAGES)]
    monkeypatch.setattr("robots.assets.fetching.default_sources", lambda: copies)
    locator = RobotRegistry.load(robot).urdf
    package = load_manifest().package(locator.package)
    drawn = pictures and locator.file not in package.undrawable
    urdf = locator.locate(pictures=drawn)
    references = read_references(urdf.read_bytes(), urdf.as_posix(), os.path.isfile)
    wanted = references.collision + (references.visual if drawn else ())
    assert wanted
    assert [path for path in wanted if not Path(path).is_file()] == []
    paths = {file.path for file in package.files}
    srdf = locator.file.replace(".urdf", ".srdf")
    assert urdf.with_suffix(".srdf").is_file() == (srdf in paths)


def test_locate_tries_the_hub_then_the_installed_package(capfd):
    UrdfLocator("maniskill_panda", "panda_stick.urdf").locate()
    said = capfd.readouterr().err
    assert said.index("Hugging Face Hub") < said.index("installed mani_skill: 11 of 11 files")
    assert "licence CC BY-NC 4.0" in said


def test_locate_names_the_closest_package_and_urdf():
    with pytest.raises(UnknownNameError, match="Did you mean 'maniskill_panda'"):
        UrdfLocator("maniskil_panda", "panda_v2.urdf").locate()
    with pytest.raises(UnknownNameError, match="Did you mean 'panda_v2.urdf'"):
        UrdfLocator("maniskill_panda", "panda_v2").locate()


def test_files_are_hashed_once_until_they_change(store, physics, fill, monkeypatch):
    fill(store, physics)
    hashed: list[int] = []
    sha256 = hashlib.sha256
    monkeypatch.setattr(hashlib, "sha256", lambda data: hashed.append(len(data)) or sha256(data))
    for _ in range(3):
        assert store.unusable(physics) == []
    assert sorted(hashed) == sorted(file.bytes for file in physics)


def test_a_changed_local_file_is_noticed_and_fetched_again(store, physics, fill):
    fill(store, physics)
    assert store.unusable(physics) == []
    mesh = physics[0]
    store.path(mesh).write_bytes(bytes(mesh.bytes))
    assert store.unusable(physics) == [mesh]
    source = FakeSource(right(physics))
    ensure(physics, store, [source])
    assert store.unusable(physics) == []
    assert source.asked == [([mesh.path], False)]


def test_a_wrong_file_is_asked_for_once_more_and_then_refused(store, physics):
    given = right(physics)
    given[physics[0].path] = b"something else"
    source = FakeSource(given)
    with pytest.raises(AssetError, match=f"fake source: refused, .*twice: {physics[0]}"):
        ensure(physics, store, [source])
    assert [again for _, again in source.asked] == [False, True]
    assert source.asked[1][0] == [physics[0].path]
    assert store.state(physics[0]) is FileState.MISSING


def test_the_next_source_is_asked_only_for_what_is_still_missing(store, physics):
    first = FakeSource(right(physics[:4]), error="ran dry")
    second = FakeSource(right(physics))
    ensure(physics, store, [first, second])
    assert second.asked == [([file.path for file in physics[4:]], False)]


def test_one_error_names_every_source_and_what_to_do(store, physics):
    sources = [FakeSource({}, error="is on fire"), FakeSource({}, error="is flooded")]
    with pytest.raises(AssetError) as error:
        ensure(physics, store, sources)
    text = str(error.value)
    for part in ("is on fire", "is flooded", str(store.root), "pip install mani_skill==3.0.1"):
        assert part in text
    assert text.count(": missing") == len(physics)


def test_nothing_is_written_when_nothing_is_needed(store, physics, fill):
    fill(store, physics)
    before = sorted(store.root.rglob("*"))
    ensure(physics, store, [])
    assert sorted(store.root.rglob("*")) == before


def test_a_file_is_exchanged_and_never_written_over(store, physics, fill, tmp_path):
    fill(store, physics)
    store.path(physics[0]).write_bytes(b"damaged")
    (tmp_path / "reader").hardlink_to(store.path(physics[0]))
    ensure(physics, store, [FakeSource(right(physics))])
    assert store.unusable(physics) == []
    assert (tmp_path / "reader").read_bytes() == b"damaged"


def test_a_read_only_destination_is_named(read_only_folder, physics):
    with pytest.raises(AssetError, match=rf"cannot write robot files to {read_only_folder}/x:"):
        ensure(physics, AssetStore(read_only_folder / "x"), [InstalledPackage(MANI_SKILL)])


def test_a_complete_read_only_copy_is_enough(store, physics, fill, monkeypatch):
    fill(store, physics)

    def refuse(*_: object, **__: object) -> None:
        raise OSError("Read-only file system")

    for name in ("mkdir", "replace", "rename", "unlink"):
        monkeypatch.setattr(f"os.{name}", refuse)
    ensure(physics, store, [])


def test_the_local_copy_is_where_it_is_said_to_be(monkeypatch, tmp_path):
    monkeypatch.setenv("ROBOT_LAYOUTS_ASSETS", "~/robot_files")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert default_root() == tmp_path / "robot_files"
    monkeypatch.setenv("ROBOT_LAYOUTS_ASSETS", "")
    assert default_root() == Path(paths.__file__).parents[2] / "assets_cache"
    monkeypatch.setattr(paths, "CHECKOUT_CACHE", tmp_path / "no_checkout")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    assert default_root() == tmp_path / "cache" / "robot-layouts"

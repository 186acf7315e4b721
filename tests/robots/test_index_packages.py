"""Robot files of a package other than mani_skill: installed, or through pip; made up here."""

from __future__ import annotations

import hashlib
import io
import sys
import zipfile
from pathlib import Path

import pytest

from benchmarks.manifest import build_manifest, build_package
from robots import AssetError
from robots.assets.fetching import ensure
from robots.assets.manifest import (
    EXAMPLE_ROBOT_DATA,
    MANI_SKILL,
    AssetFile,
    PackageOrigin,
    find_package,
    load_manifest,
)
from robots.assets.sources import InstalledPackage, PackageWheel
from robots.fetch_assets import main
from tests.robots.wheel_index import WheelIndex, without_pip_settings

pytestmark = pytest.mark.usefixtures("store")

URDF = b"""<robot name="toy"><link name="base"><collision><geometry>
<mesh filename="package://example-robot-data/robots/toy_description/meshes/base.stl"/>
</geometry></collision></link></robot>"""
README = b"# Toy\n\nlicense: MPL-2.0\n"
CONTENTS = {"urdf/toy.urdf": URDF, "meshes/base.stl": b"solid base", "README.md": README}
ORIGIN = PackageOrigin(
    name="example_toy_description",
    folder=f"{EXAMPLE_ROBOT_DATA.robots}/toy_description",
    wheel="example-robot-data==6.0.0",
    licence="MPL-2.0",
    licence_note="made up",
    mount="example-robot-data/robots/toy_description",
)
FILES = tuple(
    AssetFile(ORIGIN, path, len(data), hashlib.sha256(data).hexdigest(), ("urdf/toy.urdf",))
    for path, data in CONTENTS.items()
)
INFO = "example_robot_data-6.0.0.dist-info"
MEMBERS = {
    f"{INFO}/METADATA": b"Metadata-Version: 2.1\nName: example-robot-data\nVersion: 6.0.0\n",
    f"{INFO}/WHEEL": b"Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
    f"{INFO}/RECORD": b"",
    **{f"{ORIGIN.folder}/{path}": data for path, data in CONTENTS.items()},
}


@pytest.fixture
def installed(tmp_path, monkeypatch) -> Path:
    """A folder of Python packages that comes before all others, with this one in it."""
    site = tmp_path / "site"
    for name, data in MEMBERS.items():
        (site / name).parent.mkdir(parents=True, exist_ok=True)
        (site / name).write_bytes(data)
    monkeypatch.syspath_prepend(site)
    return site


def test_an_installed_package_is_found_without_being_imported(installed, store, capfd):
    assert find_package("example-robot-data") == installed
    ensure(FILES, store, [InstalledPackage(MANI_SKILL), InstalledPackage(EXAMPLE_ROBOT_DATA)])
    assert store.unusable(FILES) == []
    there = store.root / "example_toy_description/example-robot-data/robots/toy_description"
    assert (there / "urdf" / "toy.urdf").read_bytes() == URDF
    said = capfd.readouterr().err
    assert "installed example-robot-data: 3 of 3 files" in said
    assert "mani_skill" not in said, "a source is asked only for what it may have"
    assert "example_robot_data" not in sys.modules


def test_its_wheel_comes_through_pip(store, monkeypatch, capfd):
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w") as wheel:
        for name, data in MEMBERS.items():
            wheel.writestr(name, data)
    filename = "example_robot_data-6.0.0-py3-none-any.whl"
    with WheelIndex(archive.getvalue(), filename) as index, without_pip_settings():
        for name, value in index.settings().items():
            monkeypatch.setenv(name, value)
        ensure(FILES, store, [PackageWheel(MANI_SKILL), PackageWheel(EXAMPLE_ROBOT_DATA)])
        assert index.downloads == 1
    assert store.unusable(FILES) == []
    said = capfd.readouterr().err
    assert "example-robot-data wheel through pip: 3 of 3 files" in said
    assert "mani_skill" not in said


def test_without_any_source_the_package_is_named(store, monkeypatch):
    monkeypatch.setattr(sys, "path", [])
    with pytest.raises(AssetError) as error:
        ensure(FILES, store, [InstalledPackage(EXAMPLE_ROBOT_DATA)])
    for part in (
        "installed example-robot-data: example-robot-data is not installed",
        "`pip install example-robot-data==6.0.0`",
    ):
        assert part in str(error.value)


def test_a_folder_that_names_its_licence_in_its_readme_is_listed(installed):
    package = build_package(ORIGIN.name, installed, {"urdf/toy.urdf"})
    assert package.origin == PackageOrigin(
        **{**vars(ORIGIN), "licence_note": package.origin.licence_note}
    )
    assert "Mozilla Public License" in package.origin.licence_note
    assert {file.path: file.sha256 for file in package.files} == {
        file.path: file.sha256 for file in FILES
    }


def test_a_folder_without_a_licence_is_refused(installed):
    (installed / ORIGIN.folder / "README.md").write_text("# Toy")
    with pytest.raises(AssetError, match="names no licence"):
        build_package(ORIGIN.name, installed, {"urdf/toy.urdf"})


def test_what_is_not_installed_stays_in_the_manifest_as_it_was(monkeypatch):
    def refuse(name: str) -> Path:
        if name == EXAMPLE_ROBOT_DATA.name:
            raise AssetError(f"{name} is not installed")
        return find_package(name)

    monkeypatch.setattr("benchmarks.manifest.SourceError", AssetError)
    monkeypatch.setattr("benchmarks.manifest.find_package", refuse)
    assert build_manifest() == load_manifest()


def test_a_source_is_asked_for_all_robots_that_it_has_and_for_no_others(capsys):
    assert main(["--source", "mani_skill", "--check", "--physics-only"]) == 1
    said = capsys.readouterr().out
    assert "  dclaw: " in said
    assert "ur5" not in said

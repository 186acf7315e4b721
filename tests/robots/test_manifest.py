"""The manifest of robot files, and the command that writes it."""

from __future__ import annotations

import re
import resource
import shutil
from pathlib import Path, PurePosixPath

import pytest

from benchmarks import manifest as writer
from benchmarks.__main__ import main
from benchmarks.manifest import LARGEST_FILE, build_package, to_json
from robot_layouts.core.paths import CHECKOUT_CACHE
from robots import AssetError, UnknownNameError
from robots.assets import manifest
from robots.assets.manifest import AssetManifest, find_package, load_manifest


@pytest.fixture
def _fresh_manifest():
    load_manifest.cache_clear()
    yield
    load_manifest.cache_clear()


def test_the_manifest_survives_writing_and_reading():
    assert AssetManifest.from_json(to_json(load_manifest())) == load_manifest()


def test_the_tracked_manifest_is_what_mani_skill_holds(capsys):
    assert main(["manifest", "--check"]) == 0
    assert "is up to date" in capsys.readouterr().out


def test_a_stale_manifest_is_noticed_and_rewritten(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(writer, "CHECKOUT_CACHE", tmp_path)
    assert main(["manifest", "--check"]) == 1
    assert main(["manifest"]) == 0
    written = (tmp_path / "manifest.json").read_text()
    assert written == (CHECKOUT_CACHE / "manifest.json").read_text()


DUTIES = {
    "CC BY-NC 4.0": "name the authors, no commercial use",
    "Apache-2.0": "keep the licence file",
    "BSD": "keep the copyright notice",
    "BSD-3-Clause": "keep the copyright notice",
    "CC BY-NC-SA 4.0": "share what you change under the same terms",
    "MIT": "keep the copyright notice",
    "Zlib": "do not claim to be the author",
    "MPL-2.0": "what you change in the files stays under it",
}
WHEELS = {
    "maniskill_": "mani_skill==3.0.1",
    "example_": "example-robot-data==6.0.0",
    "gymnasium_": "gymnasium_robotics==1.4.2",
    "metaworld_": "metaworld==3.1.1",
    "pybullet_": "pybullet==3.2.7",
    "robosuite_": "robosuite==1.5.2",
}
APACHE = ("maniskill_koch", "maniskill_so100")


def test_every_package_says_its_origin_and_licence():
    packages = load_manifest().packages
    for package in packages.values():
        assert DUTIES[package.origin.licence] in package.origin.licence_note
        prefix = package.origin.name.partition("_")[0] + "_"
        assert package.origin.wheel == WHEELS[prefix]
    for name in (
        "maniskill_fetch",
        "maniskill_fmb",
        "maniskill_panda",
        "maniskill_tabletop",
        "maniskill_xarm7",
        *APACHE,
    ):
        licence = "Apache-2.0" if name in APACHE else "CC BY-NC 4.0"
        assert packages[name].origin.licence == licence


def test_a_licence_that_is_not_known_is_refused(tmp_path):
    folder = tmp_path / "mani_skill" / "assets" / "robots" / "toy"
    folder.mkdir(parents=True)
    (folder / "LICENSE").write_text("Ask me first.")
    with pytest.raises(AssetError, match="a licence this command does not know"):
        build_package("maniskill_toy", tmp_path, {"toy.urdf"})


def test_physics_is_small_and_the_camera_is_in_the_pictures():
    package = load_manifest().package("maniskill_panda")
    arms = ("panda_v2.urdf", "panda_v3.urdf", "panda_stick.urdf")
    physics = {file for urdf in arms for file in package.needed(urdf, pictures=False)}
    assert sum(file.bytes for file in physics) < 200_000
    pictures = {file.path for file in package.needed("panda_v3.urdf", pictures=True)}
    assert "realsense2_description/meshes/d415.stl" in pictures


def test_the_images_that_a_collada_mesh_names_are_pictures_too():
    package = load_manifest().package("maniskill_fetch")
    pictures = {file.path for file in package.needed("fetch.urdf", pictures=True)}
    assert "fetch_description/meshes/head_pan_uv.png" in pictures
    physics = {file.path for file in package.needed("fetch.urdf", pictures=False)}
    assert not [path for path in physics if path.endswith(".png")]


def test_a_package_that_is_no_folder_of_mani_skill_is_refused():
    with pytest.raises(AssetError, match="call it maniskill_<folder>"):
        build_package("robotiq", find_package("mani_skill"), {"x.urdf"})


def test_a_urdf_that_reaches_outside_its_folder_is_refused(tmp_path):
    folder = tmp_path / "mani_skill" / "assets" / "robots" / "toy"
    folder.mkdir(parents=True)
    mesh = "<collision><geometry><mesh filename='../other/x.stl'/></geometry></collision>"
    (folder / "toy.urdf").write_text(f"<robot name='toy'><link name='a'>{mesh}</link></robot>")
    with pytest.raises(
        AssetError, match=r"toy\.urdf refers to '\.\./other/x\.stl', which leads out"
    ):
        build_package("maniskill_toy", tmp_path, {"toy.urdf"})


def test_an_unknown_package_is_named():
    with pytest.raises(UnknownNameError, match="package of robot files 'panda'.*maniskill_panda"):
        load_manifest().package("panda")


@pytest.mark.usefixtures("_fresh_manifest")
def test_an_installation_reads_the_manifest_of_its_package(tmp_path, monkeypatch):
    installed = tmp_path / "site" / "robots"
    installed.mkdir(parents=True)
    monkeypatch.setattr(manifest, "CHECKOUT_CACHE", tmp_path / "site" / "assets_cache")
    monkeypatch.setattr(manifest.resources, "files", lambda package: Path(installed))
    with pytest.raises(AssetError, match="no manifest of robot files.*install robot-layouts"):
        load_manifest()
    shutil.copy(CHECKOUT_CACHE / "manifest.json", installed)
    assert "maniskill_panda" in load_manifest().packages


@pytest.mark.usefixtures("_fresh_manifest")
@pytest.mark.parametrize("text", ["[", "[]", "{}", '{"packages": {"panda": {}}}'])
def test_a_damaged_manifest_is_one_error(tmp_path, monkeypatch, text):
    monkeypatch.setattr(manifest, "CHECKOUT_CACHE", tmp_path)
    (tmp_path / "manifest.json").write_text(text)
    expected = rf"^the manifest of robot files {tmp_path}/manifest.json is damaged: .*"
    with pytest.raises(AssetError, match=expected):
        load_manifest()


def test_the_tracked_manifest_is_sound():
    """Nothing checks it at run time."""
    packages = load_manifest().packages
    assert packages
    for name, package in packages.items():
        origin = package.origin
        assert name == origin.name
        assert re.fullmatch(r"\w[\w-]{0,99}", name)
        assert re.fullmatch(r"\w[\w.-]*==\w[\w.!+-]*", origin.wheel)
        assert origin.licence.strip()
        assert origin.licence_note.strip()
        assert (origin.hub_dataset is None) == (origin.hub_folder is None)
        assert re.fullmatch(r"\w[\w.-]*/\w[\w.-]*", origin.hub_dataset or "owner/name")
        paths = [file.path for file in package.files]
        folders = {str(folder) for path in paths for folder in PurePosixPath(path).parents}
        assert paths == sorted(set(paths) - folders)
        for path in (*paths, origin.folder or "a", origin.hub_folder or "a", origin.mount or "a"):
            assert is_inside(path), path
        for file in package.files:
            assert type(file.bytes) is int
            assert 0 <= file.bytes <= LARGEST_FILE
            assert re.fullmatch("[0-9a-f]{64}", file.sha256)
            assert {*file.physics, *file.pictures} <= {*paths}
        assert all(isinstance(urdf, str) for urdf in package.undrawable)


def is_inside(path: str) -> bool:
    """Whether a path is one of plain names with forward slashes."""
    parts = path.split("/")
    plain = all(parts) and not {".", ".."} & {*parts} and "\\" not in path and path.isprintable()
    return plain and all(len(part.encode()) <= 255 for part in parts)


def test_a_manifest_that_cannot_be_written_stays_as_it_was(tmp_path, monkeypatch, capsys):
    (tmp_path / "manifest.json").write_text("the one before")
    monkeypatch.setattr(writer, "CHECKOUT_CACHE", tmp_path)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, before[1]))  # bytes
    try:
        assert main(["manifest"]) == 2
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert [path.name for path in tmp_path.iterdir()] == ["manifest.json"]
    assert (tmp_path / "manifest.json").read_text() == "the one before"
    assert capsys.readouterr().err.startswith(f"error: cannot write {tmp_path}/manifest.json")

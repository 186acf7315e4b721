"""Locators: a URDF of the manifest, and a URDF of the user's own."""

from __future__ import annotations

import dataclasses
import pickle

import pytest

from robots import AssetError, UnknownNameError, UrdfLocator
from robots.assets.locator import FileLocator, LocalUrdf
from robots.assets.manifest import load_manifest
from robots.assets.scenery import GROUND_TEXTURE, PACKAGE, TABLE

pytestmark = pytest.mark.usefixtures("store")

URDF = """<robot name="toy">
  <link name="base">
    <visual><geometry><mesh filename="meshes/base.glb"/></geometry></visual>
    <collision><geometry><mesh filename="package://meshes/base.stl"/></geometry></collision>
  </link>
</robot>"""


@pytest.fixture
def toy(tmp_path):
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "base.stl").touch()
    (tmp_path / "meshes" / "base.glb").touch()
    path = tmp_path / "toy.urdf"
    path.write_text(URDF)
    return path


@pytest.mark.parametrize(
    "locator",
    [
        UrdfLocator("no_package", "no.urdf"),
        LocalUrdf("/no/such"),
        FileLocator("no_package", "no.png"),
    ],
)
def test_a_locator_is_a_frozen_value_that_touches_nothing(locator):
    assert pickle.loads(pickle.dumps(locator)) == locator
    assert hash(dataclasses.replace(locator)) == hash(locator)
    with pytest.raises(dataclasses.FrozenInstanceError):
        setattr(locator, dataclasses.fields(locator)[0].name, "other")


def test_a_users_urdf_is_found_with_its_meshes(toy, monkeypatch):
    assert LocalUrdf(toy).locate(pictures=True) == toy
    monkeypatch.setenv("HOME", str(toy.parent))
    assert LocalUrdf("~/toy.urdf").locate() == toy
    monkeypatch.chdir(toy.parent)
    assert LocalUrdf("toy.urdf").locate() == toy


def test_a_missing_urdf_is_named(tmp_path):
    with pytest.raises(AssetError, match=rf"cannot read the URDF {tmp_path}/no\.urdf: No such"):
        LocalUrdf(tmp_path / "no.urdf").locate()


def test_a_missing_mesh_is_named_when_it_is_needed(toy):
    (toy.parent / "meshes" / "base.glb").unlink()
    assert LocalUrdf(toy).locate() == toy
    with pytest.raises(AssetError, match=r"do not exist: .*meshes/base\.glb"):
        LocalUrdf(toy).locate(pictures=True)
    (toy.parent / "meshes" / "base.stl").unlink()
    with pytest.raises(AssetError, match=r"do not exist: .*meshes/base\.stl"):
        LocalUrdf(toy).locate()


def test_the_files_of_the_scenery_come_together(store, fill):
    files = load_manifest().package(PACKAGE).files
    fill(store, files)
    for locator in (TABLE, GROUND_TEXTURE):
        assert locator.locate() == store.root / PACKAGE / locator.file
    assert {file.path for file in files} == {TABLE.file, GROUND_TEXTURE.file}
    assert not any(file.physics for file in files)


def test_a_file_that_is_not_in_the_manifest_is_named():
    with pytest.raises(UnknownNameError, match=f"unknown file of {PACKAGE} 'table.glb'"):
        FileLocator(PACKAGE, "table.glb").locate()

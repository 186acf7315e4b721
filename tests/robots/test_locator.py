"""Locators: a URDF of the manifest, and a URDF of the user's own."""

from __future__ import annotations

import dataclasses
import pickle

import pytest
import trimesh

from robots import AssetError, UnknownNameError, UrdfLocator
from robots.assets.locator import GROUND_TEXTURE, SCENERY, TABLE, FileLocator, LocalUrdf
from robots.assets.manifest import load_manifest
from robots.bodies.hulls import read_hulls
from robots.urdf.reading import read_model
from robots.urdf.summary import read_urdf

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


@pytest.fixture
def apart(tmp_path):
    """A URDF of one package that refers to a coloured mesh of another, which lies nowhere near."""
    text = '<robot name="r"><link name="a"><collision><geometry><mesh filename="{}"/></geometry>'
    text += "</collision></link></robot>"
    urdf = tmp_path / "ws" / "src" / "arms" / "arm" / "urdf" / "arm.urdf"
    urdf.parent.mkdir(parents=True)
    (urdf.parent.parent / "package.xml").write_text("<package><name>arm</name></package>")
    urdf.write_text(text.format("package://grip/meshes/a.obj"))
    grip = tmp_path / "elsewhere" / "grip"
    (grip / "meshes").mkdir(parents=True)
    box = trimesh.creation.box((0.1, 0.2, 0.3)).export(file_type="obj")
    (grip / "meshes" / "a.obj").write_text(f"mtllib ../a.mtl\n{box}")
    (grip / "a.mtl").write_text("newmtl m\nKd 1 0 0\n")
    return urdf, grip


def test_a_package_of_the_workspace_is_found_with_its_colours(apart):
    urdf, grip = apart
    (grip / "package.xml").write_text("<package><name>grip</name></package>")
    grip.parent.rename(urdf.parents[3] / "hands")
    (shape,) = read_model(read_urdf(LocalUrdf(urdf).locate()), str(urdf)).collisions["a"]
    assert shape.file == "package://hands/grip/meshes/a.obj"
    assert read_hulls(read_model(read_urdf(urdf), str(urdf)), urdf)


def test_a_package_that_is_not_there_is_named_and_a_folder_may_be(apart):
    urdf, grip = apart
    with pytest.raises(AssetError, match=r"package 'grip', which is neither around nor.* folder=…"):
        LocalUrdf(urdf).locate()
    with pytest.raises(AssetError, match="folder='.*gone' is no folder"):
        LocalUrdf(urdf, folder="gone").locate()
    assert LocalUrdf(urdf, folder=grip.parent).locate() == urdf
    assert read_hulls(read_model(read_urdf(urdf), str(urdf)), urdf)


def test_a_folder_of_a_packages_name_needs_its_package_xml(apart):
    urdf, grip = apart
    grip.rename(urdf.parents[2] / "grip")
    with pytest.raises(AssetError, match=r"/arms/grip is called so, but has no package\.xml"):
        LocalUrdf(urdf).locate()
    assert LocalUrdf(urdf, folder=urdf.parents[2] / "grip").locate() == urdf


def test_the_files_of_the_scenery_come_together(store, fill):
    files = load_manifest().package(SCENERY).files
    fill(store, files)
    for locator in (TABLE, GROUND_TEXTURE):
        assert locator.locate() == store.root / SCENERY / locator.file
    assert {file.path for file in files} == {TABLE.file, GROUND_TEXTURE.file}
    assert not any(file.physics for file in files)


def test_what_tasks_are_made_of_comes_together(store, fill):
    fill(store, load_manifest().package("maniskill_fmb").files)
    locator = FileLocator("maniskill_fmb", "purple_u.ply")
    assert str(locator) == "maniskill_fmb/purple_u.ply"
    assert locator.locate() == store.root / str(locator)


def test_a_file_that_is_not_in_the_manifest_is_named():
    with pytest.raises(UnknownNameError, match=f"unknown file of {SCENERY} 'table.glb'"):
        FileLocator(SCENERY, "table.glb").locate()

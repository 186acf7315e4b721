"""Which files a URDF may refer to, as it writes them."""

from __future__ import annotations

import os

import pytest

from robots import AssetError
from robots.urdf.paths import open_folder, resolve

FILES = {
    "/opt/me/arm/urdf/meshes/a.stl",
    "/opt/me/arm/meshes/a.stl",
    "/opt/me/arm/parts/a.stl",
    "/opt/me/other/meshes/a.stl",
    "/opt/me/ros/arm_meshes/package.xml",
    "/opt/me/ros/arm_meshes/a.stl",
    "/opt/me/ros/arm/package.xml",
    "/opt/me/ros/arm/deep/c/a.stl",
    "/etc/passwd",
    "/opt/py/pack/__init__.py",
    "/opt/py/pack/robots/__init__.py",
    "/opt/ws/src/arm/package.xml",
    "/opt/ws/src/hands/grip/package.xml",
    "/opt/ws/src/hands/grip/a.stl",
    "/opt/ws/src/hands/notes/a.stl",
    "/opt/me/hands/grip/package.xml",
    "/opt/me/hands/grip/a.stl",
}
ROS = "/opt/me/ros/arm/deep/b/arm.urdf"
PIP = "/opt/py/pack/robots/arm/arm.urdf"
WORKSPACE = "/opt/ws/src/arm/urdf/arm.urdf"


@pytest.mark.parametrize(
    ("urdf", "reference", "path"),
    [
        ("/opt/me/arm/urdf/arm.urdf", "meshes/a.stl", "/opt/me/arm/urdf/meshes/a.stl"),
        ("/opt/me/arm/urdf/arm.urdf", "../meshes/a.stl", "/opt/me/arm/meshes/a.stl"),
        ("/opt/me/arm/urdf/arm.urdf", "../parts/a.stl", "/opt/me/arm/parts/a.stl"),
        ("/opt/me/arm/arm.urdf", "../other/meshes/a.stl", "/opt/me/other/meshes/a.stl"),
        ("/opt/me/arm/arm.urdf", "/opt/me/arm/parts/a.stl", "/opt/me/arm/parts/a.stl"),
        ("/opt/me/arm/arm.urdf", "file:///opt/me/arm/parts/a.stl", "/opt/me/arm/parts/a.stl"),
        ("/opt/me/arm/arm.urdf", "file://localhost/opt/me/arm/a%20b.stl", "/opt/me/arm/a b.stl"),
        ("/opt/me/arm/urdf/arm.urdf", "package://arm/parts/a.stl", "/opt/me/arm/parts/a.stl"),
        ("/opt/me/arm/arm.urdf", "package://gone/parts/a.stl", "/opt/me/arm/parts/a.stl"),
        (ROS, "../c/a.stl", "/opt/me/ros/arm/deep/c/a.stl"),
        (ROS, "package://arm_meshes/a.stl", "/opt/me/ros/arm_meshes/a.stl"),
        (PIP, "../../hands/a.stl", "/opt/py/pack/hands/a.stl"),
        (WORKSPACE, "package://hands/grip/a.stl", "/opt/ws/src/hands/grip/a.stl"),
        ("sub/arm.urdf", "../meshes/a.stl", "meshes/a.stl"),
    ],
)
def test_what_belongs_to_a_robot_is_found(urdf, reference, path):
    assert resolve(reference, urdf, FILES.__contains__) == path


@pytest.mark.parametrize(
    ("urdf", "reference"),
    [
        ("/opt/me/arm/arm.urdf", "../../../etc/passwd"),
        ("/opt/me/arm/arm.urdf", "/etc/passwd"),
        ("/opt/me/arm/arm.urdf", "file:///etc/passwd"),
        ("/opt/me/arm/arm.urdf", "package://../../../etc/passwd"),
        ("/opt/me/arm/arm.urdf", "../parts/a.stl"),
        ("/opt/me/arm/arm.urdf", "../meshes/../../../etc/passwd"),
        ("/home/arm.urdf", "../etc/passwd"),
        ("/opt/me/arm/arm.urdf", "//etc/passwd"),
        (PIP, "../../../other/a.stl"),
        (WORKSPACE, "../../hands/grip/a.stl"),
        (ROS, "../../../../other/meshes/a.stl"),
        ("sub/arm.urdf", "../../meshes/a.stl"),
        ("arm.urdf", "/etc/passwd"),
    ],
)
def test_what_lies_elsewhere_is_refused(urdf, reference):
    with pytest.raises(AssetError) as error:
        resolve(reference, urdf, FILES.__contains__)
    assert str(error.value).startswith(f"{urdf} refers to {reference!r}, which leads out of its")


def test_no_folder_of_a_system_counts_as_a_package():
    """A name of a package is looked for around the URDF, up to the root of the disk."""
    path = resolve("package://etc/passwd", "/opt/me/arm/arm.urdf", FILES.__contains__)
    assert path == "/opt/me/arm/etc/passwd"


@pytest.mark.parametrize(
    ("urdf", "reference", "instead"),
    [
        (WORKSPACE, "package://hands/notes/a.stl", "/opt/ws/src/arm/urdf/hands/notes/a.stl"),
        ("/opt/me/arm/a.urdf", "package://hands/grip/a.stl", "/opt/me/arm/hands/grip/a.stl"),
    ],
)
def test_deeper_down_lie_packages_of_workspaces_alone(urdf, reference, instead):
    assert resolve(reference, urdf, FILES.__contains__) == instead


def test_a_distribution_is_what_lies_beside_its_information(tmp_path):
    (tmp_path / "arms-1.0.dist-info").mkdir()
    urdf = f"{tmp_path}/arms/deep/arm.urdf"
    assert resolve("../a.stl", urdf, os.path.isfile) == f"{tmp_path}/arms/a.stl"
    with pytest.raises(AssetError, match="leads out of"):
        resolve("../../other/a.stl", urdf, os.path.isfile)


def test_a_folder_is_opened_to_the_files_of_one_other(tmp_path):
    (tmp_path / "far").mkdir()
    with pytest.raises(AssetError, match=r"name the folder that may be read, too: folder=…"):
        resolve("../far/a.stl", f"{tmp_path}/arm/arm.urdf", os.path.isfile)
    open_folder(f"{tmp_path}/arm/arm.urdf", f"{tmp_path}/far")
    far = resolve("../far/a.stl", f"{tmp_path}/arm/arm.urdf", os.path.isfile)
    assert far == f"{tmp_path}/far/a.stl"
    for urdf, reference in (("other/a.urdf", "../far/a.stl"), ("arm/a.urdf", "../further/a.stl")):
        with pytest.raises(AssetError, match="leads out of"):
            resolve(reference, f"{tmp_path}/{urdf}", os.path.isfile)


@pytest.mark.parametrize(
    ("reference", "reason"),
    [
        ("http://127.0.0.1:9/a.stl", "only paths, package:// and file:// are read"),
        ("file://meshes/a.stl", "file:// takes an absolute path"),
    ],
)
def test_what_is_no_path_is_refused(reference, reason):
    with pytest.raises(AssetError, match=reason):
        resolve(reference, "/opt/me/arm/arm.urdf", FILES.__contains__)


def test_links_are_compared_as_they_are_written(tmp_path):
    """As Hugging Face's cache has them: links in a snapshot that lead to blobs outside of it."""
    (tmp_path / "blobs").mkdir()
    (tmp_path / "blobs" / "1").touch()
    (tmp_path / "snapshot" / "meshes").mkdir(parents=True)
    link = tmp_path / "snapshot" / "meshes" / "a.stl"
    link.symlink_to("../../blobs/1")
    urdf = (tmp_path / "snapshot" / "arm.urdf").as_posix()
    assert resolve("meshes/a.stl", urdf, os.path.isfile) == link.as_posix()
    with pytest.raises(AssetError, match="leads out of"):
        resolve("../blobs/1", urdf, os.path.isfile)

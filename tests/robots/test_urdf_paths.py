"""Which files a URDF may refer to, as it writes them."""

from __future__ import annotations

import os

import pytest

from robots import AssetError
from robots.urdf.paths import resolve

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
}
ROS = "/opt/me/ros/arm/deep/b/arm.urdf"


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

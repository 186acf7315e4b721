"""What is read from a URDF's XML."""

from __future__ import annotations

import pytest

from robots import AssetError
from robots.urdf.summary import read_joints, read_links, read_references

URDF = b"""<robot name="toy">
  <material name="wood"><texture filename="textures/wood.png"/></material>
  <link name="base">
    <visual><geometry><mesh filename="meshes/base.glb"/></geometry></visual>
    <visual><geometry><mesh filename="meshes/shared.stl"/></geometry></visual>
    <collision><geometry><mesh filename="meshes/shared.stl"/></geometry></collision>
    <collision><geometry><mesh filename="package://toy/meshes/hull.stl"/></geometry></collision>
  </link>
  <link name="arm"/><link name="wheel"/><link name="plate"/>
  <joint name="shoulder" type="revolute">
    <limit lower="-1.5" upper="2" effort="87" velocity="2.5"/>
  </joint>
  <joint name="axle" type="continuous"/>
  <joint name="slider" type="prismatic">
    <limit lower="0" upper="0.04"/><mimic joint="shoulder"/>
  </joint>
  <joint name="weld" type="fixed"/>
</robot>"""


def test_references_are_split_by_use_and_resolved():
    references = read_references(URDF, "sub/toy.urdf", exists={"sub/meshes/hull.stl"}.__contains__)
    assert references.collision == ("sub/meshes/hull.stl", "sub/meshes/shared.stl")
    assert references.visual == ("sub/meshes/base.glb", "sub/textures/wood.png")


def test_a_package_reference_keeps_its_package_if_that_exists():
    here = {"toy/meshes/hull.stl", "meshes/hull.stl"}
    assert "toy/meshes/hull.stl" in read_references(URDF, "t.urdf", here.__contains__).collision


def test_joints_that_move_are_read_with_limits_and_mimics():
    shoulder, axle, slider = read_joints(URDF, "toy.urdf")
    assert (shoulder.lower, shoulder.upper, shoulder.effort) == (-1.5, 2.0, 87.0)
    assert (shoulder.velocity, shoulder.unit, shoulder.mimics) == (2.5, "rad", None)
    assert (axle.lower, axle.upper, axle.effort) == (None, None, None)
    assert (slider.unit, slider.mimics, slider.upper) == ("m", "shoulder", 0.04)


def test_links_are_read_in_order():
    assert read_links(URDF, "toy.urdf") == ("base", "arm", "wheel", "plate")


@pytest.mark.parametrize(
    ("xml", "reason"),
    [
        (b"<robot", "x.urdf is not a URDF: unclosed token"),
        (b"<mujoco/>", "holds <mujoco>, not <robot>"),
        (b'<!DOCTYPE r [<!ENTITY a "aaaa">]><robot name="&a;"/>', "declares XML entities"),
    ],
)
def test_what_is_no_urdf_is_refused(xml, reason):
    with pytest.raises(AssetError, match=reason):
        read_references(xml, "x.urdf")

"""Which files a URDF refers to, by its XML alone."""

from __future__ import annotations

from robots.urdf.summary import read_references

URDF = b"""<robot name="toy">
  <material name="wood"><texture filename="textures/wood.png"/></material>
  <link name="base">
    <visual><geometry><mesh filename="meshes/base.glb"/></geometry></visual>
    <visual><geometry><mesh filename="meshes/shared.stl"/></geometry></visual>
    <collision><geometry><mesh filename="meshes/shared.stl"/></geometry></collision>
    <collision><geometry><mesh filename="package://toy/meshes/hull.stl"/></geometry></collision>
  </link>
</robot>"""


def test_references_are_split_by_use_and_resolved():
    references = read_references(URDF, "sub/toy.urdf", exists={"sub/meshes/hull.stl"}.__contains__)
    assert references.collision == ("sub/meshes/hull.stl", "sub/meshes/shared.stl")
    assert references.visual == ("sub/meshes/base.glb", "sub/textures/wood.png")


def test_a_package_reference_keeps_its_package_if_that_exists():
    here = {"toy/meshes/hull.stl", "meshes/hull.stl"}
    assert "toy/meshes/hull.stl" in read_references(URDF, "t.urdf", here.__contains__).collision

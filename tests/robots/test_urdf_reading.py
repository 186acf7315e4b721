"""What is read of a URDF by way of yourdfpy, and where yourdfpy alone could not serve."""

from __future__ import annotations

import io
import math
import sys

import numpy as np
import pytest
import yourdfpy

from robots import AssetError, RobotRegistry
from robots.urdf.reading import read_model
from robots.urdf.summary import read_urdf

CAPSULE = '<capsule radius="0.1" length="0.5"/>'
ORIGIN = '<origin xyz="1 2 3" rpy="0.1 -0.2 0.3"/>'


def link(name: str, inside: str = "") -> str:
    return f'<link name="{name}">{inside}</link>'


def joint(name: str, kind: str, parent: str, child: str, inside: str = "") -> str:
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    return f'<joint name="{name}" type="{kind}">{ends}{inside}</joint>'


def collision(shape: str) -> str:
    return f"<collision>{ORIGIN}<geometry>{shape}</geometry></collision>"


TOY = f"""<robot name="toy">
  <material name="red"><color rgba="red or so"/></material>
  {link("base", collision('<mesh filename="package://toy/a.stl" scale="1 2 3"/>'))}
  {link("arm", collision(CAPSULE) + collision('<cylinder radius="0.2" length="0.4"/>'))}
  {link("wheel")}{link("plate")}{link("end")}
  {
    joint(
        "shoulder",
        "revolute",
        "base",
        "arm",
        ORIGIN + '<axis xyz="0 0 2"/><limit lower="-1.5" upper="2" effort="87" velocity="2.5"/>',
    )
}
  {joint("axle", "continuous", "arm", "wheel")}
  {
    joint(
        "slider",
        "prismatic",
        "arm",
        "plate",
        '<limit upper="0.04"/><mimic joint="shoulder" multiplier="-2" offset="0.1"/>'
        '<calibration rising="nobody knows"/>',
    )
}
  {joint("weld", "fixed", "plate", "end")}
</robot>"""


@pytest.fixture
def toy():
    return read_model(TOY.encode(), "toy.urdf")


def test_joints_are_read_with_limits_and_mimics(toy):
    shoulder, axle, slider, weld = toy.joints
    assert (shoulder.lower, shoulder.upper, shoulder.effort) == (-1.5, 2.0, 87.0)
    assert (shoulder.velocity, shoulder.unit, shoulder.mimics) == (2.5, "rad", None)
    assert (shoulder.parent, shoulder.child, shoulder.axis) == ("base", "arm", (0.0, 0.0, 1.0))
    assert (axle.lower, axle.upper, axle.effort, axle.axis) == (None, None, None, (1.0, 0.0, 0.0))
    assert (slider.unit, slider.mimics, slider.multiplier, slider.offset) == (
        "m",
        "shoulder",
        -2.0,
        0.1,
    )
    assert (slider.lower, slider.upper) == (0.0, 0.04)
    assert not weld.moves


def test_links_are_read_in_order(toy):
    assert toy.links == ("base", "arm", "wheel", "plate", "end")


def test_origins_are_turned_about_the_fixed_axes_in_order(toy):
    def about(axis: int, angle: float) -> np.ndarray:
        turn = np.eye(3)
        i, j = (axis + 1) % 3, (axis + 2) % 3
        turn[[i, i, j, j], [i, j, i, j]] = (
            math.cos(angle),
            -math.sin(angle),
            math.sin(angle),
            math.cos(angle),
        )
        return turn

    expected = about(2, 0.3) @ about(1, -0.2) @ about(0, 0.1)
    for origin in (toy.joints[0].origin, toy.collisions["arm"][0].origin):
        np.testing.assert_allclose(origin[:3, :3], expected, atol=1e-15)
        assert origin[:3, 3].tolist() == [1.0, 2.0, 3.0]


def test_shapes_keep_their_kind_and_sizes(toy):
    (mesh,), (capsule, cylinder) = toy.collisions["base"], toy.collisions["arm"]
    assert (mesh.kind, mesh.sizes, mesh.file) == ("mesh", (1.0, 2.0, 3.0), "package://toy/a.stl")
    assert (capsule.kind, capsule.sizes) == ("capsule", (0.1, 0.5))
    assert (cylinder.kind, cylinder.sizes) == ("cylinder", (0.2, 0.4))
    assert cylinder.where == "toy.urdf, link 'arm'"


def test_the_same_contents_are_read_once(toy):
    assert read_model(TOY.encode(), "toy.urdf") is toy


def test_a_robot_that_was_read_before_is_not_parsed_again():
    def read():
        urdf = RobotRegistry.load("panda").urdf.locate()
        return read_model(read_urdf(urdf), urdf.as_posix())

    called: list[str] = []
    model = read()
    sys.setprofile(lambda frame, event, _: event == "call" and called.append(frame.f_code.co_name))
    try:
        again = read()
    finally:
        sys.setprofile(None)
    assert again is model
    assert "read_urdf" in called
    assert "parse_xml" not in called


class TestYourdfpyAlone:
    """Why text is checked and cut down before yourdfpy reads it."""

    def test_knows_no_capsules(self):
        urdf = RobotRegistry.load("panda_pinch").urdf.locate()
        with pytest.raises(ValueError, match="Unknown tag: capsule"):
            yourdfpy.URDF.load(str(urdf), build_scene_graph=False, load_meshes=False)
        kinds = {shape.kind for shapes in read_model(urdf.read_bytes(), "").collisions.values()
                 for shape in shapes}  # fmt: skip
        assert "capsule" in kinds

    def test_takes_for_numbers_what_no_other_reader_does(self):
        text = TOY.replace(CAPSULE, '<sphere radius="1_0"/>').replace("nobody knows", "0")
        text = text.replace("red or so", "1 0 0 1")
        robot = yourdfpy.URDF.load(io.StringIO(text), build_scene_graph=False, load_meshes=False)
        assert robot.robot.links[1].collisions[0].geometry.sphere.radius == 10.0
        with pytest.raises(AssetError, match="radius='1_0' in <sphere>; 1 finite number is"):
            read_model(text.encode(), "toy.urdf")

    def test_rounds_orientations_in_its_own_way(self):
        """Reports of what is all but reached rely on the last digits."""
        urdf = RobotRegistry.load("xarm7").urdf.locate()
        theirs = yourdfpy.URDF.load(str(urdf), build_scene_graph=False, load_meshes=False)
        ours = {at.name: at.origin for at in read_model(urdf.read_bytes(), "").joints}
        assert set(theirs.joint_map) == set(ours)
        turned = {name: at.origin for name, at in theirs.joint_map.items() if at.origin is not None}
        for name, origin in turned.items():
            np.testing.assert_allclose(ours[name], origin, atol=1e-15)
        assert any((ours[name] != origin).any() for name, origin in turned.items())

    def test_repairs_broken_text(self):
        text = TOY.replace(CAPSULE, '<sphere radius="1"/>').replace("nobody knows", "0")
        text = text.replace("red or so", "1 0 0 1").replace("</robot>", "")
        robot = yourdfpy.URDF.load(
            io.BytesIO(text.encode()), build_scene_graph=False, load_meshes=False
        )
        assert len(robot.robot.links) == 5  # without a word but in the log
        with pytest.raises(AssetError, match="is not a URDF: no element found"):
            read_model(text.encode(), "toy.urdf")

"""The merged URDF of a layout, loaded back by other programs' readers."""

from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import yourdfpy

from layouts import Layout, Placement, single
from robots import AssetError, LocalUrdf, RobotRegistry
from robots.urdf.summary import read_references
from tests.catalogue import every_robot
from tests.layouts.cells import hung, link_poses, mixed_cell, random_positions, skeleton

DRAWS = 5

INERTIA = (
    b'<inertial><mass value="1"/>'
    b'<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
)
ARM = b"""<robot name="two_links">
  <gazebo reference="tip"><turnGravityOff>true</turnGravityOff></gazebo>
  <material name="paint"><color rgba="1 0 0 1"/></material>
  <link name="base"><visual><geometry><box size="1 1 1"/></geometry>
    <material name="paint"/></visual></link>
  <link name="tip">INERTIA<visual><geometry><mesh filename="package://arm/tip.stl"/></geometry>
    <material name="paint"><texture filename="paint.png"/></material></visual></link>
  <joint name="turn" type="revolute"><parent link="base"/><child link="tip"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
  <link name="second">INERTIA</link>
  <joint name="follow" type="revolute"><parent link="base"/><child link="second"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/>
    <mimic joint="turn" multiplier="2"/></joint>
</robot>""".replace(b"INERTIA", INERTIA)


@pytest.fixture(scope="module")
def cell():
    return mixed_cell()


@pytest.fixture(scope="module")
def merged(cell, tmp_path_factory):
    return cell.to_urdf(tmp_path_factory.mktemp("urdf") / "cells" / "cell.urdf")


def test_links_are_where_the_robots_own_urdfs_put_them(cell, merged):
    urdf = yourdfpy.URDF.load(str(merged), load_meshes=False)
    random = np.random.default_rng(0)
    compared = 0
    for _ in range(DRAWS):
        positions = {name: random_positions(p, random) for name, p in cell.items()}
        urdf.update_cfg({j.name: _position(positions, j.name) for j in urdf.actuated_joints})
        for name, placement in cell.items():
            for link, pose in link_poses(placement, positions[name]).items():
                found = urdf.get_transform(f"{name}/{link}", "world")
                np.testing.assert_allclose(found, pose, rtol=0, atol=1e-9)
                compared += 1
    assert compared == DRAWS * 50


@pytest.mark.parametrize("robot", every_robot())
def test_links_of_any_robot_that_hangs_are_there(robot, tmp_path):
    layout = hung(robot)
    urdf = skeleton(layout.to_urdf(tmp_path / "cell.urdf", visuals=False), mimics=False)
    random = np.random.default_rng(1)
    for _ in range(DRAWS):
        positions = random_positions(layout["arm"], random)
        urdf.update_cfg({j.name: positions[j.name.partition("/")[2]] for j in urdf.actuated_joints})
        for link, pose in link_poses(layout["arm"], positions).items():
            found = urdf.get_transform(f"arm/{link}", "world")
            np.testing.assert_allclose(found, pose, rtol=0, atol=1e-9)


def test_every_mesh_can_be_loaded(merged):
    urdf = yourdfpy.URDF.load(
        str(merged), load_collision_meshes=True, build_collision_scene_graph=True
    )
    assert len(urdf.scene.geometry) > 40
    assert len(urdf.collision_scene.geometry) >= 40


def test_meshes_are_absolute_or_relative(tmp_path):
    layout = single({"arm": "so100"})
    for relative in (False, True):
        path = layout.to_urdf(tmp_path / "here" / "arm.urdf", relative=relative)
        meshes = [mesh.get("filename") for mesh in ElementTree.parse(path).getroot().iter("mesh")]
        assert len(meshes) > 20
        for mesh in meshes:
            assert Path(mesh).is_absolute() != relative
            assert (path.parent / mesh).is_file()


def test_excused_collisions_stand_beside_it(cell, merged):
    pairs = ElementTree.parse(merged.with_suffix(".srdf")).getroot().findall("disable_collisions")
    own = cell["up"].robot.urdf.locate().with_suffix(".srdf")
    expected = ElementTree.parse(own).getroot().findall("disable_collisions")
    found = [pair for pair in pairs if pair.get("link1").startswith("up/")]
    assert [(p.get("link1"), p.get("link2")) for p in found] == [
        (f"up/{p.get('link1')}", f"up/{p.get('link2')}") for p in expected
    ]


def test_links_that_a_descriptor_lets_overlap_stand_beside_it(tmp_path):
    robot = replace(
        RobotRegistry.load("so100"),
        allowed_collisions=(("Base", "Upper_Arm"), ("Base", "Fixed_Jaw")),
    )
    Layout({"up": Placement(robot)}).to_urdf(tmp_path / "cell.urdf")
    pairs = ElementTree.parse(tmp_path / "cell.srdf").getroot().findall("disable_collisions")
    assert [(pair.get("link1"), pair.get("link2"), pair.get("reason")) for pair in pairs] == [
        ("up/Base", "up/Fixed_Jaw", "Default"),
        ("up/Base", "up/Upper_Arm", "Default"),
    ]


def test_names_references_and_files_of_any_urdf_are_carried_over(tmp_path):
    own = tmp_path / "arm" / "arm.urdf"
    own.parent.mkdir()
    own.write_bytes(ARM)
    (own.parent / "tip.stl").write_bytes(
        (RobotRegistry.load("so100").urdf.locate().parent / "meshes" / "Base.stl").read_bytes()
    )
    (own.parent / "paint.png").touch()
    robot = _two_joints(LocalUrdf(own))
    path = Layout({"a": Placement(robot), "b": Placement(robot)}).to_urdf(tmp_path / "out.urdf")
    root = ElementTree.parse(path).getroot()
    assert [material.get("name") for material in root.iter("material")] == (
        ["a/paint"] * 3 + ["b/paint"] * 3
    )
    assert [mimic.get("joint") for mimic in root.iter("mimic")] == ["a/turn", "b/turn"]
    assert root.find("gazebo") is None
    references = read_references(path.read_bytes(), str(path))
    assert references.visual == (str(own.parent / "paint.png"), str(own.parent / "tip.stl"))
    assert not path.with_suffix(".srdf").exists()


def test_robots_whose_looks_are_missing_can_be_saved_without(tmp_path):
    layout = single({"arm": "panda_pinch"})
    with pytest.raises(AssetError, match="lacks some of its visual meshes"):
        layout.to_urdf(tmp_path / "arm.urdf")
    for path in (
        layout.to_urdf(tmp_path / "arm.urdf", visuals=False),
        layout.to_drake(tmp_path / "arm.dmd.yaml", visuals=False).with_name("arm_robots")
        / "panda_pinch"
        / "panda_pinch.urdf",
    ):
        root = ElementTree.parse(path).getroot()
        assert root.find("link/visual") is None
        assert len(root.findall("link/collision")) > 8


def _position(positions: dict[str, dict[str, float]], name: str) -> float:
    place, _, joint = name.partition("/")
    return positions[place][joint]


def _two_joints(urdf: LocalUrdf):
    from robots import ActionSplit, JointGroup, RobotDescriptor

    group = JointGroup(
        ("turn", "follow"), lower=-1.0, upper=1.0, stiffness=1.0, damping=1.0, force_limit=1.0
    )
    return RobotDescriptor(
        name="two_links",
        urdf=urdf,
        action_split=ActionSplit(arm=group),
        tcp_link="tip",
        keyframes={"rest": (0.0, 0.0)},
        reach=1.0,
        source="written for this test",
    )

"""A layout's ROS 2 package, read by xacro, yourdfpy and readers of YAML."""

import ast
from itertools import combinations
from xml.etree import ElementTree

import numpy as np
import pytest
import xacro
import yaml
import yourdfpy

from layouts import Layout, Placement, around_table, single
from layouts.export.cell import ExportedCell
from layouts.export.files import Names
from robots import LayoutError
from robots.bodies.hulls import load_model
from tests.layouts.test_export_mjcf import small_cell
from tests.layouts.travelling import draws, outside

NAME = "test_cell"
CONFIGS = {
    *("joint_limits", "kinematics", "moveit_controllers", "ompl_planning", "ros2_controllers")
}


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    return small_cell(tmp_path_factory.mktemp("outside"))


@pytest.fixture(scope="module")
def package(cell, tmp_path_factory):
    return cell.to_ros2(tmp_path_factory.mktemp("ros2") / NAME)


@pytest.fixture(scope="module")
def expanded(package):
    """What xacro makes of the description."""
    text = xacro.process_file(str(package / "urdf" / f"{NAME}.urdf.xacro")).toxml()
    return ElementTree.fromstring(text)


@pytest.fixture(scope="module")
def srdf(package):
    return ElementTree.parse(package / "config" / f"{NAME}.srdf").getroot()


def config(package, name):
    return yaml.safe_load((package / "config" / f"{name}.yaml").read_text())


def mesh_path(package, uri):
    return package.parent / uri.removeprefix("package://")


def test_the_package_is_whole(package):
    assert sorted(path.name for path in package.iterdir()) == [
        "CMakeLists.txt", "LICENCES.md", "config", "launch", "meshes", "package.xml", "urdf",
    ]  # fmt: skip
    manifest = ElementTree.parse(package / "package.xml").getroot()
    assert manifest.findtext("name") == NAME
    licences = [element.text for element in manifest.iterfind("license")]
    assert licences == ["unknown", "Apache-2.0"]
    assert f"project({NAME})" in (package / "CMakeLists.txt").read_text()
    launch = ast.parse((package / "launch" / "demo.launch.py").read_text())
    functions = [node.name for node in launch.body if isinstance(node, ast.FunctionDef)]
    assert functions == ["generate_launch_description"]
    files = "\n".join(
        path.read_text() for path in package.rglob("*") if path.suffix != ".stl" and path.is_file()
    )
    assert str(package.parent) not in files


def test_links_are_where_they_are_here(cell, package):
    urdf = yourdfpy.URDF.load(
        str(package / "urdf" / f"{NAME}.urdf"), build_scene_graph=True, load_meshes=False
    )
    names = {"hung": {"arm/0.5": "hung_arm_0_5", "ARM/0.5": "hung_ARM_0_5_2"}}
    for positions, poses in draws(ExportedCell.read(cell, visuals=False), 5):
        # yourdfpy follows no follower of a follower
        joints = {f"{place}_{joint}": value for (place, joint), value in positions.items()}
        urdf.update_cfg({joint.name: joints[joint.name] for joint in urdf.actuated_joints})
        for (place, link), pose in poses.items():
            if (place, link) == ("hung", "right"):
                continue
            name = names.get(place, {}).get(link, f"{place}_{link}")
            np.testing.assert_allclose(urdf.get_transform(name), pose, rtol=0, atol=1e-9)


def test_names_differ_and_are_those_that_ros_takes(expanded):
    for kind in ("link", "joint"):
        names = [element.get("name") for element in expanded.findall(kind)]
        assert len(set(names)) == len(names) > 15
        assert all(name.isidentifier() for name in names)
    assert len(expanded.findall("link")) == len(expanded.findall("joint")) + 1
    links = {element.get("name") for element in expanded.findall("link")}
    assert {"world", "hung_tcp", "up_tcp", "table_north", "ceiling"} <= links


def test_meshes_are_in_the_package(package, expanded):
    meshes = {mesh_path(package, mesh.get("filename")) for mesh in expanded.iter("mesh")}
    assert meshes == set((package / "meshes").rglob("*.stl"))
    assert len(meshes) > 20
    kinds = {
        shape.tag for link in expanded.findall("link") for shape in link.iterfind("*/geometry/*")
    }
    assert kinds == {"mesh", "box", "sphere", "cylinder"}  # no capsules, which ROS has not


def test_disabled_pairs_are_those_of_the_check(cell, srdf):
    found = {
        frozenset((pair.get("link1"), pair.get("link2"))): pair.get("reason")
        for pair in srdf.iterfind("disable_collisions")
    }
    expected = {frozenset(("table", "up_Base")), frozenset(("table", "hung_world"))}
    for place, placement in cell.items():
        own = load_model(placement.robot)
        links = dict.fromkeys(own.link_name(i) for i in range(len(own.hulls)))
        counted = {frozenset(map(own.link_name, pair)) for pair in own.self_pairs}
        expected |= {
            frozenset(f"{place}_{link}".replace("/", "_").replace(".", "_") for link in pair)
            for pair in combinations(links, 2)
            if frozenset(pair) not in counted
        }
    assert found.keys() == expected
    assert set(found.values()) <= {"Adjacent", "Default", "Never"}
    assert found[frozenset(("up_Base", "up_Rotation_Pitch"))] == "Adjacent"


def test_groups_states_and_grippers(cell, srdf, expanded):
    groups = {group.get("name"): group for group in srdf.iterfind("group")}
    assert {"up", "up_arm", "up_gripper", "hung", "all"} <= groups.keys()
    chain = groups["up_arm"].find("chain")
    assert (chain.get("base_link"), chain.get("tip_link")) == ("up_Base", "up_tcp")
    states = {state.get("group"): state for state in srdf.iterfind("group_state")}
    assert states.keys() == groups.keys()
    found = [float(joint.get("value")) for joint in states["up"]]
    assert found == list(cell["up"].start_qpos)
    (end,) = [e for e in srdf.iterfind("end_effector") if e.get("group") == "up_gripper"]
    assert (end.get("parent_link"), end.get("parent_group")) == ("up_Fixed_Jaw", "up_arm")
    joints = {joint.get("name") for joint in expanded.findall("joint")}
    links = {link.get("name") for link in expanded.findall("link")}
    for element in srdf.iter():
        if element.tag == "joint":
            assert element.get("name") in joints
        for key in ("link1", "link2", "base_link", "tip_link", "parent_link"):
            assert element.get(key, "world") in links


def test_limbs_have_groups_of_their_own(tmp_path):
    layout = around_table({"a": "mobile_panda_dual", "b": "panda_stick"})
    package = layout.to_ros2(tmp_path / "two", visuals=False)
    srdf = ElementTree.parse(package / "config" / "two.srdf").getroot()
    groups = {g.get("name"): [p.get("name") for p in g] for g in srdf.iterfind("group")}
    assert groups["a"] == ["a_left", "a_right", "a_body"]
    assert groups["a_left"] == ["a_left_arm", "a_left_gripper"]
    assert groups["a_left_gripper"] == [f"a_left_panda_finger_joint{i}" for i in (1, 2)]
    assert groups["b"] == ["b_arm"]
    assert groups["all"] == ["a", "b"]
    solved = config(package, "kinematics")
    assert list(solved) == ["a_left_arm", "a_right_arm", "b_arm"]


def test_configurations_name_what_there_is(package, srdf, expanded):
    read = {name: config(package, name) for name in CONFIGS}
    assert {path.stem for path in (package / "config").glob("*.yaml")} == CONFIGS
    moving = {
        joint.get("name")
        for joint in expanded.findall("joint")
        if joint.get("type") != "fixed" and joint.find("mimic") is None
    }
    assert read["joint_limits"]["joint_limits"].keys() == moving
    groups = {group.get("name") for group in srdf.iterfind("group")}
    assert groups <= read["ompl_planning"].keys()
    own = read["ros2_controllers"]
    moveit = read["moveit_controllers"]["moveit_simple_controller_manager"]
    launched = (package / "launch" / "demo.launch.py").read_text()
    driven = []
    for name in moveit["controller_names"]:
        assert name in own["controller_manager"]["ros__parameters"]
        assert f"{name!r}," in launched
        assert moveit[name]["joints"] == own[name]["ros__parameters"]["joints"]
        driven += moveit[name]["joints"]
    assert sorted(driven) == sorted(moving)


def test_hardware_starts_at_home_and_followers_have_no_command(cell, expanded):
    systems = {system.get("name"): system for system in expanded.iterfind("ros2_control")}
    assert systems.keys() == {"hung", "up"}
    for place, standing in ExportedCell.read(cell, visuals=False).robots.items():
        system = systems[place]
        assert system.findtext("hardware/plugin") == "mock_components/GenericSystem"
        start = {
            joint.get("name"): float(joint.findtext("state_interface/param"))
            for joint in system.iterfind("joint")
        }
        assert start == {f"{place}_{joint}": value for joint, value in standing.home.items()}
        commanded = [
            joint.get("name")
            for joint in system.iterfind("joint")
            if joint.find("command_interface") is not None
        ]
        assert sorted(commanded) == sorted(f"{place}_{j}" for j in standing.source.leaders)


@pytest.mark.parametrize("name", ["My-Cell", "2cells", "a__b", "x"])
def test_a_name_that_no_package_has_is_refused(name, tmp_path):
    with pytest.raises(LayoutError, match="ROS 2 package cannot be called"):
        single({"arm": "so100"}).to_ros2(tmp_path / name)
    assert list(tmp_path.iterdir()) == []


def test_only_a_package_of_its_own_is_replaced(tmp_path):
    layout = single({"arm": outside(tmp_path)})
    package = layout.to_ros2(tmp_path / "cells" / "cell_a")
    (package / "meshes" / "old.stl").touch()
    assert layout.to_ros2(package) == package
    assert not (package / "meshes" / "old.stl").exists()
    (package / "notes.md").touch()
    with pytest.raises(LayoutError, match=r"would be replaced, but holds notes.md"):
        layout.to_ros2(package)
    assert (package / "notes.md").exists()
    assert [path.name for path in package.parent.iterdir()] == ["cell_a"]


def test_places_that_read_alike_get_names_of_their_own(tmp_path):
    robot = outside(tmp_path)
    layout = Layout({"a": Placement(robot), "a_arm": Placement(robot, (1.0, 0.0, 0.0))})
    package = layout.to_ros2(tmp_path / "alike")
    names = [e.get("name") for e in ElementTree.parse(package / "urdf" / "alike.urdf").getroot()]
    assert len(set(names)) == len(names)
    given = Names(r"\W")
    assert [given.new(name) for name in ("a/b", "a.b", "A_b", "c")] == [
        "a_b",
        "a_b_2",
        "A_b_3",
        "c",
    ]

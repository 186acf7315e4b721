"""Every robot of the catalogue: does its data agree with its URDF and the manifest?"""

from __future__ import annotations

import ast
import importlib
import math
import pickle
from dataclasses import dataclass
from pathlib import Path

import pytest

from robots import AssetError, RobotDescriptor, RobotRegistry, UrdfLocator
from robots.assets.manifest import AssetPackage, load_manifest
from robots.registry import CATALOGUE
from robots.urdf.cleaning.cleaning import clean
from robots.urdf.model import ModelJoint
from robots.urdf.reading import read_model
from robots.urdf.summary import read_references
from tests.catalogue import every_robot, is_optional
from tests.robots.conftest import contents

ROBOTS = tuple(CATALOGUE)


@dataclass
class Robot:
    """A descriptor beside what its URDF says."""

    descriptor: RobotDescriptor
    package: AssetPackage
    joints: dict[str, ModelJoint]
    links: tuple[str, ...]
    references: tuple[tuple[str, ...], tuple[str, ...]]


@pytest.fixture(params=every_robot(quick=[name for name in ROBOTS if not is_optional(name)]))
def robot(request) -> Robot:
    descriptor = RobotRegistry.load(request.param)
    assert isinstance(descriptor.urdf, UrdfLocator)
    package = load_manifest().package(descriptor.urdf.package)
    name = descriptor.urdf.file
    xml = contents(package.file(name))
    model = read_model(clean(xml, name).xml, name)
    joints = {joint.name: joint for joint in model.moving}
    around = f"/{package.origin.mount}/" if package.origin.mount else ""
    paths = {around + file.path for file in package.files}
    references = read_references(xml, around + name, paths.__contains__)
    collision, visual = (
        tuple(path.removeprefix(around) for path in found)
        for found in (references.collision, references.visual)
    )
    return Robot(descriptor, package, joints, model.links, (collision, visual))


def test_the_catalogue_is_sorted_and_each_descriptor_is_named_as_its_module():
    assert list(CATALOGUE) == sorted(CATALOGUE)
    assert [RobotRegistry.load(name).name for name in CATALOGUE] == list(CATALOGUE)


def test_every_moving_joint_is_driven_and_exists(robot):
    assert set(robot.descriptor.joints) == set(robot.joints)


def test_units_of_groups_are_those_of_the_urdf(robot):
    for group in robot.descriptor.action_split.groups.values():
        units = {robot.joints[joint].unit for joint in group.joints}
        assert units == ({"m", "rad"} if group.asks.drive else {group.unit})


def test_a_joint_that_mimics_is_driven_in_a_mimic_group(robot):
    for joint in robot.joints.values():
        if joint.mimics is not None:
            groups = robot.descriptor.action_split.groups.values()
            group = next(group for group in groups if joint.name in group.joints)
            assert group.mimic
            assert joint.mimics in group.joints


def test_keyframes_are_within_the_joint_limits(robot):
    descriptor = robot.descriptor
    assert descriptor.keyframes
    for qpos in descriptor.keyframes.values():
        for name, value in zip(descriptor.joints, qpos, strict=True):
            joint = robot.joints[name]
            lower = -math.inf if joint.lower is None else joint.lower
            upper = math.inf if joint.upper is None else joint.upper
            assert lower - 1e-6 <= value <= upper + 1e-6, name


def test_every_link_that_is_named_exists(robot):
    descriptor = robot.descriptor
    named = {descriptor.tcp_link, *descriptor.tcp_position_links, *descriptor.no_floor_contact}
    named |= {camera.link for camera in descriptor.cameras}
    named |= set(descriptor.fingers.links) if descriptor.fingers else set()
    named |= set(descriptor.gripper_material.links) if descriptor.gripper_material else set()
    assert named <= set(robot.links)


def test_grippers_have_fingers_and_material_and_sticks_do_not(robot):
    groups = robot.descriptor.action_split.groups
    gripper = groups.get("gripper")
    if gripper is not None or set(groups) == {"arm"}:
        assert (robot.descriptor.gripper_material is not None) == (gripper is not None)
    if gripper is None and "left_gripper" not in groups:
        assert robot.descriptor.fingers is None
    elif gripper is not None and len(gripper.joints) == 2:  # one jaw swings, more are a hand
        assert robot.descriptor.fingers is not None


def test_the_manifest_holds_every_file_that_the_urdf_refers_to(robot):
    urdf = robot.descriptor.urdf.file
    physics = {file.path for file in robot.package.needed(urdf, pictures=False)}
    everything = {file.path for file in robot.package.needed(urdf, pictures=True)}
    collision, visual = robot.references
    srdf = {urdf.replace(".urdf", ".srdf")} & {file.path for file in robot.package.files}
    assert physics - {"LICENSE", "LICENSE.txt", "README.md"} == {urdf, *srdf, *collision}
    if urdf in robot.package.undrawable:
        assert everything == physics
    else:
        textures = {path for path in everything if path.endswith((".png", ".jpg"))}
        assert everything - textures == (physics | set(visual)) - textures
        assert set(visual) <= everything


def test_robots_that_cannot_be_drawn_say_so_and_only_they(robot):
    locator = robot.descriptor.urdf
    undrawable = locator.file in robot.package.undrawable
    module = importlib.import_module(f"robots.catalogue.{robot.descriptor.name}")
    assert ("Cannot be drawn" in str(module.__doc__)) == undrawable
    if undrawable:
        with pytest.raises(AssetError, match="cannot be drawn, as mani_skill==3.0.1 lacks"):
            locator.locate(pictures=True)


def test_some_robots_cannot_be_drawn():
    package = load_manifest().package("maniskill_panda")
    assert package.undrawable == (
        "mobile_panda_dual_arm.urdf",
        "mobile_panda_single_arm.urdf",
        "panda_pinch.urdf",
    )


LOGIC = (
    ast.FunctionDef,
    ast.Lambda,
    ast.If,
    ast.IfExp,
    ast.For,
    ast.While,
    ast.comprehension,
    ast.JoinedStr,
)


@pytest.mark.parametrize("name", ROBOTS)
def test_a_robot_is_data_without_logic(name):
    module = Path(str(importlib.import_module(f"robots.catalogue.{name}").__file__))
    source = module.read_text(encoding="utf-8")
    assert "fmt: " not in source
    assert [node.lineno for node in ast.walk(ast.parse(source)) if isinstance(node, LOGIC)] == []


def test_the_numbers_name_their_source(robot):
    assert robot.descriptor.source.startswith(robot.package.origin.wheel.replace("==", " ") + ", ")


def test_sizes_add_up(robot):
    descriptor = robot.descriptor
    numbers = descriptor.describe_action()
    assert len(numbers) == descriptor.action_dim == descriptor.action_split.size
    assert [number.index for number in numbers] == list(range(descriptor.action_dim))
    assert len({number.name for number in numbers}) == len(numbers)
    groups = descriptor.action_split.groups.values()
    driven = tuple(joint for group in groups if not group.held for joint in group.joints)
    assert tuple(joint for number in numbers for joint in number.joints) == driven


def test_a_descriptor_survives_pickling_and_hashes_by_value(robot):
    copy = pickle.loads(pickle.dumps(robot.descriptor))
    assert copy == robot.descriptor
    assert hash(copy) == hash(robot.descriptor)


@pytest.mark.parametrize(
    ("name", "joints", "numbers"),
    [
        ("fetch", 15, 11),
        ("floating_panda_gripper", 8, 7),
        ("koch", 6, 6),
        ("mobile_panda", 13, 9),
        ("panda", 9, 8),
        ("panda_pinch", 9, 8),
        ("panda_stick", 7, 7),
        ("panda_wristcam", 9, 8),
        ("so100", 6, 6),
        ("xarm7", 7, 7),
    ],
)
def test_robots_have_the_sizes_that_layouts_count_on(name, joints, numbers):
    descriptor = RobotRegistry.load(name)
    assert (descriptor.dof, descriptor.action_dim) == (joints, numbers)

"""What SAPIEN's builder is given is what SAPIEN's own URDF loader gives it, to the last bit."""

from __future__ import annotations

import dataclasses
import os
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
import sapien
from sapien.wrapper.urdf_loader import URDFLoader

from robot_layouts.simulation.sapien3.blueprint import Blueprint, read_blueprint
from robots import AssetError, RobotDescriptor, RobotRegistry
from robots.urdf.paths import resolve
from robots.urdf.summary import parse_urdf, srdf_beside
from tests.catalogue import every_robot
from tests.faults.toy_robots import LIMIT, descriptor, link, robot, toy

# What SAPIEN's loader stumbles over where it is left out, and robots do without.
DYNAMICS = {"damping": "0", "friction": "0"}

SHAPES = {
    "sphere": '<sphere radius="0.07"/>',
    "cylinder": '<cylinder radius="0.03" length="0.2"/>',
    "capsule": '<capsule radius="0.03" length="0.2"/>',
    "box": '<box size="0.1 0.2 0.3"/>',
}


def by_sapien(blueprint: Blueprint, robot: RobotDescriptor, folder: Path, *, visuals: bool) -> Any:
    """Return the builder that SAPIEN's loader makes of the same URDF, written to a folder."""
    urdf = blueprint.urdf.as_posix()
    root = parse_urdf(blueprint.contents, urdf)
    for file in (*root.iter("mesh"), *root.iter("texture")):
        file.set("filename", resolve(file.get("filename", ""), urdf, os.path.isfile))
    for element in root.iterfind("link") if not visuals else ():
        for visual in element.findall("visual"):
            element.remove(visual)
    for dynamics in root.iter("dynamics"):
        dynamics.attrib.update(DYNAMICS | dynamics.attrib)
    written = folder / "robot.urdf"
    ElementTree.ElementTree(root).write(written)
    loader: Any = URDFLoader()
    if material := robot.gripper_material:
        friction = material.static_friction, material.dynamic_friction, material.restitution
        for name in material.links:
            loader.set_link_material(name, *friction)
            loader.set_link_patch_radius(name, material.patch_radius)
            loader.set_link_min_patch_radius(name, material.patch_radius)
    beside = srdf_beside(blueprint.urdf) if blueprint.from_srdf else None
    loader.set_scene(sapien.Scene([]))
    return loader.load_file_as_articulation_builder(str(written), beside and str(beside))


def plain(value: Any) -> Any:
    """Return a part of a builder as what can be compared: numbers as SAPIEN takes them."""
    if isinstance(value, sapien.Pose):
        return value.p.tobytes(), value.q.tobytes()
    if dataclasses.is_dataclass(value):
        fields = {field.name: getattr(value, field.name) for field in dataclasses.fields(value)}
        return {name: plain(own) for name, own in fields.items()}
    if isinstance(value, sapien.physx.PhysxMaterial):
        return value.static_friction, value.dynamic_friction, value.restitution
    if isinstance(value, sapien.render.RenderMaterial):
        texture = value.base_color_texture
        return list(value.base_color), texture and texture.filename
    if isinstance(value, (str, bool, dict)) or value is None:
        return value
    return np.array(value, np.float32).tobytes()


def joint_of(record: Any) -> dict[str, Any]:
    """Return what SAPIEN uses of a joint: no friction, and of one that is fixed no damping."""
    joint = plain(record) | {"friction": None}
    return joint | {"damping": None} if record.joint_type == "fixed" else joint


def shape_of(record: Any) -> dict[str, Any]:
    """Return a shape; its file's name and scale are others where its hull was mirrored."""
    shape = plain(record)
    mirrored = record.type == "convex_mesh" and (
        min(record.scale) < 0 or "robot-layouts-" in record.filename
    )
    return shape | {"filename": None, "scale": None} if mirrored else shape


def links_of(builder: Any) -> list[dict[str, Any]]:
    """Return all that a builder uses of what it knows of each link."""
    return [
        {
            "name": link.name,
            "parent": link.parent and link.parent.name,
            "joint": joint_of(link.joint_record),
            "body": [link._auto_inertial, *map(plain, (link._mass, link._inertia))],
            "centre": plain(link._cmass_local_pose),
            "collisions": [shape_of(record) for record in link.collision_records],
            "visuals": [plain(record) for record in link.visual_records],
        }
        for link in builder.link_builders
    ]


def expect_equal(robot: RobotDescriptor, folder: Path, *, visuals: bool) -> None:
    blueprint = read_blueprint(robot, visuals=visuals)
    theirs = by_sapien(blueprint, robot, folder, visuals=visuals)
    assert links_of(blueprint.builder) == links_of(theirs)
    groups = {link.name: link.collision_groups[2] for link in theirs.link_builders}
    if blueprint.from_srdf:
        assert blueprint.overlaps == {name: word for name, word in groups.items() if word}
    mimics = {record.joint: plain(record) for record in theirs.mimic_joint_records}
    for record in blueprint.builder.mimic_joint_records:
        assert plain(record) == mimics[record.joint]


@pytest.mark.parametrize("name", every_robot())
def test_robots_are_built_as_sapien_would(name, tmp_path):
    expect_equal(RobotRegistry.load(name), tmp_path, visuals=False)


def test_what_is_drawn_is_as_sapien_would_draw_it(tmp_path):
    expect_equal(RobotRegistry.load("panda_wristcam"), tmp_path, visuals=True)


@pytest.mark.parametrize("shape", SHAPES.values(), ids=SHAPES)
def test_shapes_axes_and_materials_are_sapiens(shape, tmp_path):
    """A tilted axis, an inertia with products, an origin with all angles, colours by name."""
    look = f'<origin xyz="1 2 3" rpy="0.1 0.2 0.3"/><geometry>{shape}</geometry>'
    visuals = "".join(
        f'<visual name="{name}">{look}{material}</visual>'
        for name, material in (
            ("named", '<material name="red"/>'),
            ("again", '<material name="red"><color rgba="0 0 1 1"/></material>'),
            ("own", '<material name="own"><color rgba="0.1 0.2 0.3 2"/></material>'),
            ("bare", ""),
        )
    )
    text = toy(shape, visuals).replace('rpy="0 0 0"', 'rpy="0.4 -0.7 1.1"')
    text = text.replace('ixy="0"', 'ixy="0.02"').replace('xyz="0 1 0"', 'xyz="0.3 -2 0.1"')
    text = text.replace(LIMIT, f'{LIMIT}<dynamics damping="0.7"/>')
    red = '<material name="red"><color rgba="1 0 0 1"/></material>'
    (tmp_path / "toy.urdf").write_text(text.replace("</robot>", f"{red}</robot>"))
    expect_equal(descriptor(tmp_path / "toy.urdf"), tmp_path, visuals=True)


def test_a_urdf_of_one_link_is_no_robot(tmp_path):
    urdf = tmp_path / "toy.urdf"
    urdf.write_text(robot(link("base")))
    with pytest.raises(AssetError, match="describes a single link; a robot has at least one joint"):
        read_blueprint(descriptor(urdf), visuals=False)

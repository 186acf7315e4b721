"""Things from MJCFs: shapes, joints, sites, rests and grasps of a body, and what is refused."""

import numpy as np
import pytest
import trimesh

from layouts import single
from objects import ObjectDescriptor
from objects.shapes import Box, Capsule, ConvexHull, Cylinder, Mesh, Sphere
from robot_layouts.kinematics.rotations import rotate
from robot_layouts.simulation import Simulation
from robot_layouts.simulation.checks.objects import try_rests, try_thing_grasps
from robots import AssetError, DescriptorError, UnknownNameError

CABINET = """
<mujoco model="a cabinet">
  <compiler angle="radian" autolimits="true"/>
  <default>
    <default class="touched"><geom group="3" rgba="0 0 1 0.3"/></default>
    <default class="seen"><geom contype="0" conaffinity="0"/></default>
  </default>
  <asset>
    <mesh name="knob" file="knob.stl"/>
    <material name="oak" rgba="0.5 0.25 0.1 1"/>
  </asset>
  <worldbody>
    <geom type="plane" size="1 1 1"/>
    <body name="cabinet" pos="0.5 0 0">
      <geom class="touched" type="box" size="0.1 0.1 0.01" pos="0 0 0.01" mass="2"/>
      <geom class="seen" type="box" size="0.1 0.1 0.01" pos="0 0 0.01" material="oak" mass="0"/>
      <body name="walls" pos="0 0 0.02" euler="0 0 1.5707963267948966">
        <geom type="box" size="0.1 0.01 0.05" pos="0 0.09 0.05" friction="0.7" mass="0.5"/>
        <geom type="box" size="0.1 0.01 0.05" pos="0 -0.09 0.05" friction="0.7" mass="0.5"/>
        <body name="door" pos="0.1 0 0.05">
          <joint name="hinge" axis="0 0 1" pos="0 -0.08 0" range="0 1.5" damping="0.2"/>
          <geom type="box" size="0.008 0.078 0.04" mass="0.3"/>
          <geom type="mesh" mesh="knob" pos="0.03 0.05 0" mass="0.05"/>
          <site name="door knob" pos="0.04 0.05 0"/>
          <body name="latch" pos="0.02 0.03 0.02">
            <joint type="slide" axis="0 1 0" range="-0.01 0.02" stiffness="5" springref="0.01"/>
            <geom type="capsule" size="0.004" fromto="0 0 0 0 0.02 0" mass="0.02"/>
          </body>
        </body>
      </body>
    </body>
    <body name="spindle" pos="0 1 0">
      <freejoint/>
      <geom type="cylinder" size="0.02 0.05" pos="0 0 0.05" mass="0.2"/>
      <geom type="sphere" size="0.02" pos="0 0 0.12" mass="0.1"/>
      <geom type="ellipsoid" size="0.01 0.01 0.03" pos="0 0 0.14" mass="0.1"/>
    </body>
  </worldbody>
</mujoco>
"""


@pytest.fixture(autouse=True)
def _own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("ROBOT_LAYOUTS_ASSETS", str(tmp_path / "assets"))


@pytest.fixture
def cabinet(tmp_path):
    trimesh.creation.box((0.05, 0.02, 0.02)).export(tmp_path / "knob.stl")
    path = tmp_path / "cabinet.xml"
    path.write_text(CABINET)
    return path


def test_joints_move_what_they_move_and_bodies_without_one_are_fixed(cabinet):
    thing = ObjectDescriptor.from_mjcf(cabinet, body="cabinet", licence="MIT")
    assert (thing.name, thing.licence) == ("cabinet", "MIT")
    assert [type(part) for part in thing.parts] == [Box] * 4
    assert [(part.collides, part.visible) for part in thing.parts] == [
        (True, False),
        (False, True),
        (True, True),
        (True, True),
    ]
    assert thing.parts[1].color == pytest.approx((0.5**2.2, 0.25**2.2, 0.1**2.2, 1.0), abs=1e-5)
    assert thing.parts[2].friction.static == 0.7
    walls = [part.position for part in thing.parts[2:]]
    assert np.allclose(walls, [(-0.09, 0, 0.07), (0.09, 0, 0.07)])
    hinge, latch = thing.joints
    assert (hinge.name, hinge.kind, hinge.carrier) == ("hinge", "turn", None)
    assert np.allclose(hinge.at, (0.08, 0.1, 0.07))
    assert (hinge.lower, hinge.upper, hinge.damping) == (0.0, 1.5, 0.2)
    assert [type(part) for part in hinge.parts] == [Box, Mesh, ConvexHull]
    assert [part.collides for part in hinge.parts] == [True, False, True]
    assert (latch.kind, latch.carrier, latch.stiffness, latch.rest) == ("slide", "hinge", 5.0, 0.01)
    assert np.allclose(latch.axis, (-1, 0, 0))
    assert [type(part) for part in latch.parts] == [Capsule]
    assert np.allclose(thing.point("door_knob").position, (-0.05, 0.14, 0.07))


def test_parts_weigh_what_the_file_says_and_physics_agrees(cabinet):
    thing = ObjectDescriptor.from_mjcf(cabinet, body="cabinet")
    assert thing.mass == pytest.approx(3.37)

    def build(world, number):
        world.add("thing", *thing.parts, position=(1.0, 0.0, 0.0), joints=thing.joints)

    simulation = Simulation(single({"arm": "panda"}), build, 1)
    bodies = simulation.backend.worlds[0].bodies
    masses = [
        bodies[name].component.mass
        for name in ("thing", "thing.hinge", "thing.latch_joint")
        if name in bodies
    ]
    assert masses[:2] == pytest.approx([3.0, 0.35], rel=0.01)
    heavier = ObjectDescriptor.from_mjcf(cabinet, body="cabinet", mass=6.74)
    assert heavier.mass == pytest.approx(6.74)
    assert heavier.joints[0].parts[0].density == pytest.approx(2 * thing.joints[0].parts[0].density)


def test_what_has_joints_stands_and_is_held_by_its_parts(cabinet):
    thing = ObjectDescriptor.from_mjcf(cabinet, body="cabinet")
    assert dict(thing.rests) == {"upright": (1.0, 0.0, 0.0, 0.0)}
    assert {grasp.part for grasp in thing.grasps} == {joint.name for joint in thing.joints}
    assert [seen.problem for seen in try_rests([thing], time=2.0)] == [None]
    knob = [grasp for grasp in thing.grasps if grasp.opening == pytest.approx(0.02, abs=1e-6)]
    tried = try_thing_grasps(thing, 0.07, knob)
    assert knob
    assert sum(one.holds for one in tried) >= 0.8 * len(tried)


def test_round_shapes_lie_along_x_as_ours_do(cabinet):
    thing = ObjectDescriptor.from_mjcf(cabinet, body=1)
    rod, ball, egg = thing.parts
    assert (type(rod), rod.radius, rod.half_length) == (Cylinder, 0.02, 0.05)
    assert np.allclose(np.abs(rotate(np.array(rod.quaternion), np.array((1.0, 0, 0)))), (0, 0, 1))
    assert (type(ball), ball.position) == (Sphere, (0.0, 0.0, 0.12))
    assert type(egg) is ConvexHull
    assert np.allclose(np.abs(np.array(egg.corners) - (0, 0, 0.14)).max(axis=0), (0.01, 0.01, 0.03))
    assert thing.mass == pytest.approx(0.4)
    assert next(iter(thing.rests)) == "upright"


def test_a_second_reading_takes_what_the_first_one_kept(cabinet, tmp_path):
    first = ObjectDescriptor.from_mjcf(cabinet, body="cabinet")
    assert ObjectDescriptor.from_mjcf(cabinet, body="cabinet") == first
    drawn = first.joints[0].parts[1]
    assert drawn.file.is_file()
    assert tmp_path / "assets" in drawn.file.parents
    cabinet.write_text(CABINET.replace('mass="2"', 'mass="4"'))
    assert ObjectDescriptor.from_mjcf(cabinet, body="cabinet").mass == pytest.approx(5.37)


def test_what_has_nothing_to_draw_is_drawn_by_what_collides(cabinet):
    hidden = CABINET.replace('size="0.1 0.01 0.05"', 'size="0.1 0.01 0.05" group="4"')
    cabinet.write_text(hidden.replace('size="0.008 0.078 0.04"', 'size="0.02 0.02 0.02" group="4"'))
    walls = ObjectDescriptor.from_mjcf(cabinet, body="walls")
    assert [part.visible for part in walls.parts] == [False, False]
    cabinet.write_text(
        "<mujoco><worldbody><body><geom type='box' size='.1 .1 .1' group='4'/></body></worldbody>"
        "</mujoco>"
    )
    (block,) = ObjectDescriptor.from_mjcf(cabinet).parts
    assert (block.collides, block.visible) == (True, True)


def test_bodies_are_chosen_by_name_or_number(cabinet):
    assert ObjectDescriptor.from_mjcf(cabinet, body="walls").name == "walls"
    assert ObjectDescriptor.from_mjcf(cabinet, body=1, name="pin").name == "pin"
    with pytest.raises(DescriptorError, match=r"has 2 bodies in its world \(0: 'cabinet', 1: 'sp"):
        ObjectDescriptor.from_mjcf(cabinet)
    with pytest.raises(DescriptorError, match="body=2 must be the number of one, or the name"):
        ObjectDescriptor.from_mjcf(cabinet, body=2)
    with pytest.raises(UnknownNameError, match="Did you mean 'cabinet'"):
        ObjectDescriptor.from_mjcf(cabinet, body="cabinett")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('<joint type="slide"', '<joint type="ball"/><joint type="slide"', "'latch' has 2 joints"),
        (
            '<joint name="hinge" axis="0 0 1" pos="0 -0.08 0" range="0 1.5"',
            '<joint type="ball"',
            "the joint 'joint_0' is neither a hinge nor a slide",
        ),
        (
            '<geom type="capsule"',
            '<geom contype="0" conaffinity="0" type="capsule"',
            "no shape of the body 'latch' touches anything",
        ),
    ],
)
def test_what_can_be_no_thing_is_refused(cabinet, old, new, message):
    assert old in CABINET
    cabinet.write_text(CABINET.replace(old, new))
    with pytest.raises(DescriptorError, match=message):
        ObjectDescriptor.from_mjcf(cabinet, body="cabinet")


def test_files_that_cannot_be_read_are_refused(cabinet, tmp_path):
    with pytest.raises(AssetError, match="cannot read the MJCF"):
        ObjectDescriptor.from_mjcf(tmp_path / "none.xml")
    (tmp_path / "knob.stl").unlink()
    with pytest.raises(AssetError, match="cannot read the mesh"):
        ObjectDescriptor.from_mjcf(cabinet, body="cabinet")

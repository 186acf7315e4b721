import dataclasses
import math
from typing import Any

import numpy as np
import pytest

from layouts import side_by_side, single
from objects.joints import Joint
from objects.shapes import Capsule, ConvexHull, Cylinder, Shape, scaled
from robot_layouts.simulation import Box, PhysicsSettings, Simulation, Sphere, World, add_table
from robot_layouts.simulation.sapien3.backend import worlds_below
from robot_layouts.simulation.sapien3.blueprint import read_blueprint
from robot_layouts.simulation.sapien3.world import BuiltWorld
from robot_layouts.simulation.world import WorldBody
from robots import DescriptorError, RobotDescriptor, RobotRegistry, SimulationError
from robots.descriptor import ActionSplit

HALF = 0.02


def with_cube(world: World, _: int = 0) -> None:
    add_table(world)
    world.add("cube", Box(half_size=(HALF,) * 3), position=(0.0, 0.0, HALF))


def stand(simulation: Simulation) -> None:
    for world in simulation.worlds:
        for name, placement in world.layout.items():
            world.stand(name, placement.start_qpos)


@pytest.mark.parametrize(
    ("shape", "volume"),
    [
        (Box(half_size=(0.01, 0.02, 0.03)), 8 * 0.01 * 0.02 * 0.03),
        (Sphere(radius=0.02), 4 / 3 * math.pi * 0.02**3),
        (Capsule(radius=0.02, half_length=0.03), math.pi * 0.02**2 * (0.06 + 4 / 3 * 0.02)),
    ],
)
def test_mass_comes_from_density(shape: Box | Sphere | Capsule, volume: float):
    world = BuiltWorld(single({"arm": "panda"}))
    for density in (1000.0, 500.0):
        body = world.add(WorldBody(f"at {density}", (dataclasses.replace(shape, density=density),)))
        assert body.component.mass == pytest.approx(density * volume, rel=1e-4)


def test_a_cylinder_lies_along_its_x_axis():
    world = BuiltWorld(single({"arm": "panda"}))
    body = world.add(WorldBody("rod", (Cylinder(radius=0.01, half_length=0.1),)))
    low, high = body.component.compute_global_aabb_tight()
    assert high - low == pytest.approx([0.2, 0.02, 0.02], abs=1e-3)


CUBE = tuple((x, y, z) for x in (-HALF, HALF) for y in (-HALF, HALF) for z in (-HALF, HALF))


@pytest.mark.parametrize(
    "shape", [Box(half_size=(HALF,) * 3), Sphere(radius=HALF), ConvexHull(corners=CUBE)]
)
def test_patches_of_contact_resist_turning(shape: Shape):
    """A body that spins on the table about the vertical is slowed by torsional friction alone."""
    ball = dataclasses.replace(shape, patch_radius=0.1, min_patch_radius=0.03)

    def build(world: World, number: int) -> None:
        add_table(world)
        world.add("ball", (shape, ball)[number], position=(0.0, 0.0, HALF))

    simulation = Simulation(single({"arm": "panda"}), build, 2, PhysicsSettings())
    stand(simulation)
    bodies = [world.bodies["ball"].component for world in worlds_below(simulation)]
    radii = [(x.patch_radius, x.min_patch_radius) for b in bodies for x in b.collision_shapes]
    assert radii == [(0.0, 0.0), pytest.approx((0.1, 0.03))]
    if isinstance(shape, Sphere):
        for body in bodies:
            body.set_angular_velocity([0.0, 0.0, 10.0])
        simulation.touched()
        simulation.coast(range(2))
        free, held = simulation.read().angular_velocity("ball")[:, 2]
        assert free > 9
        assert held < free / 2


def test_patches_of_contact_grow_with_their_shape():
    shape = Sphere(radius=HALF, patch_radius=0.1, min_patch_radius=0.03)
    larger = scaled(shape, 2.0)
    assert (larger.patch_radius, larger.min_patch_radius) == (0.2, 0.06)


def test_a_robot_that_presses_on_a_part_of_a_thing_touches_it():
    flap = Joint(
        name="flap",
        kind="turn",
        parts=(Box(half_size=(0.1, 0.1, 0.01)),),
        axis=(0.0, 1.0, 0.0),
        lower=-1.0,
        upper=1.0,
    )

    def build(world: World, number: int) -> None:
        x, y, z = places[number]
        post = Box(half_size=(0.01, 0.01, 0.01), position=(0.0, 0.0, 0.0), collides=False)
        world.add("door", post, kind="kinematic", position=(x, y, z), joints=(flap,))

    tcp = Simulation(single({"arm": "panda"}), lambda *_: None, 1)
    stand(tcp)
    x, y, z = tcp.read().tcp_position("arm")[0].tolist()
    places = [(x, y, z), (x, y + 1.0, z)]
    simulation = Simulation(single({"arm": "panda"}), build, 2)
    stand(simulation)
    simulation.rest(simulation.read(), range(2))
    simulation.coast(range(2))
    assert simulation.backend.touching().tolist() == [True, False]


def test_grasp_and_forces():
    simulation = Simulation(single({"arm": "panda"}), with_cube, 2, PhysicsSettings())
    stand(simulation)
    tcp = simulation.read().tcp_position("arm")[0]
    simulation.worlds[0].set_pose("cube", tcp)
    worlds_below(simulation)[0].bodies["cube"].component.disable_gravity = True
    action = np.zeros((2, 8), np.float32)
    action[:, 7] = -1.0  # close
    for _ in range(20):
        simulation.step(action, simulation.read().joint_positions)
    state = simulation.read()
    assert state.is_grasping("arm", "cube").tolist() == [True, False]
    left = state.contact_force("arm", "panda_leftfinger", "cube")
    right = state.contact_force("arm", "panda_rightfinger", "cube")
    assert np.linalg.norm(left[0]) > 0.5
    np.testing.assert_allclose(left[0], -right[0], atol=0.3 * np.linalg.norm(left[0]))
    assert not left[1].any()


def test_a_robot_without_fingers_never_grasps():
    simulation = Simulation(single({"arm": "panda_stick"}), with_cube, 1)
    assert not simulation.read().is_grasping("arm", "cube").any()
    assert simulation.read().finger_heights("arm") is None
    with pytest.raises(SimulationError, match="has no fingers"):
        simulation.read().finger_gap("arm")


def test_a_descriptor_that_contradicts_its_urdf_is_refused():
    panda = RobotRegistry.load("panda")
    arm = panda.action_split.groups["arm"]
    only_arm = dataclasses.replace(
        panda, action_split=ActionSplit(arm=arm), keyframes={"rest": panda.keyframe("rest")[:7]}
    )
    with pytest.raises(DescriptorError, match="panda_finger_joint1.*in no joint group"):
        BuiltWorld(single({"arm": only_arm}))
    ghost = dataclasses.replace(arm, joints=(*arm.joints[:6], "ghost"))
    with pytest.raises(DescriptorError, match=r"has no active joints \['ghost'\]"):
        BuiltWorld(
            single(
                {
                    "arm": dataclasses.replace(
                        panda, action_split=panda.action_split.replace(arm=ghost)
                    )
                }
            )
        )


def test_a_rebuilt_world_has_no_past():
    simulation = Simulation(single({"arm": "panda"}), with_cube, 2, PhysicsSettings())
    stand(simulation)
    simulation.step(np.zeros((2, 8), np.float32), simulation.read().joint_positions)
    assert simulation.backend.contact_counts().all()
    kept, built = simulation.worlds[0], worlds_below(simulation)[0]
    simulation.rebuild([1], with_cube)
    assert simulation.worlds[0] is kept
    assert worlds_below(simulation)[0] is built
    assert (simulation.backend.contact_counts() > 0).tolist() == [True, False]


def test_a_rebuilt_world_is_the_same_to_the_last_bit():
    layout = side_by_side({"left": "panda", "right": "panda_stick"}, spacing=1.0)
    action = np.full((1, layout.action_dim), 0.5, np.float32)

    def motion(rebuilt: bool) -> np.ndarray:
        simulation = Simulation(layout, with_cube, 1, PhysicsSettings())
        if rebuilt:
            simulation.rebuild([0], with_cube)
        stand(simulation)
        for _ in range(20):
            simulation.step(action, simulation.read().joint_positions)
        return simulation.read().joint_positions

    assert np.array_equal(motion(rebuilt=True), motion(rebuilt=False))


def test_a_urdf_is_read_once_for_all_worlds_and_keeps_none_of_them_alive(monkeypatch):
    read: list[tuple[str, Any]] = []

    def reading(descriptor: RobotDescriptor, *, visuals: bool) -> Any:
        blueprint = read_blueprint(descriptor, visuals=visuals)
        read.append((descriptor.name, blueprint))
        return blueprint

    monkeypatch.setattr("robot_layouts.simulation.sapien3.world.read_blueprint", reading)
    layout = side_by_side({"left": "panda", "right": "panda_stick"}, spacing=1.0)
    simulation = Simulation(layout, with_cube, 3)
    simulation.rebuild([1, 2], with_cube)
    assert [name for name, _ in read] == ["panda", "panda_stick"]
    assert [blueprint.builder.scene for _, blueprint in read] == [None, None]


def test_anchored_bodies_return_and_velocities_vanish():
    simulation = Simulation(single({"arm": "panda"}), with_cube, 1, PhysicsSettings())
    simulation.worlds[0].set_pose("table-workspace", (0.0, 0.0, -3.0))
    assert simulation.read().position("table-workspace")[0, 2] == -3.0
    (world,) = worlds_below(simulation)
    world.bodies["cube"].component.set_linear_velocity([1.0, 2.0, 3.0])
    world.robots["arm"].articulation.set_qvel(np.ones(9, np.float32))
    simulation.clear([0])
    state = simulation.read()
    assert state.position("table-workspace")[0] == pytest.approx([-0.12, 0, -0.9196429])
    assert not state.linear_velocity("cube").any()
    assert not state.qvel("arm").any()


def test_a_held_group_stays_where_the_layout_starts_it_whatever_the_action():
    panda = RobotRegistry.load("panda")
    gripper = dataclasses.replace(panda.action_split.groups["gripper"], held=True)
    split = panda.action_split.replace(gripper=gripper)
    layout = single({"arm": dataclasses.replace(panda, action_split=split)})
    simulation = Simulation(layout, with_cube, 1)
    stand(simulation)
    assert layout.action_dim == 7
    for number in (-1.0, 1.0):
        action = np.full((1, 7), number, np.float32)
        simulation.step(action, simulation.read().joint_positions)
        assert simulation.drive_targets[0, 7:] == pytest.approx([0.04, 0.04])

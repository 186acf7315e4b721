"""Things in physics: what they weigh, that they stand still, and that grasps of them hold."""

from dataclasses import replace

import numpy as np
import pytest

from layouts import single
from objects import ObjectRegistry
from objects.registry import CATALOGUE
from objects.shapes import Box, ConvexHull, Friction
from objects.solids import bounds, sampled, surface
from robot_layouts.__main__ import main
from robot_layouts.simulation import Simulation
from robot_layouts.simulation.checks.objects import OPENINGS, RestTrial, try_rests, try_thing_grasps

FEWEST_GRASPS = 20
GRASPED = [name for name in CATALOGUE if ObjectRegistry.load(name).grasps]


@pytest.fixture(scope="module")
def built():
    """Every usual thing in one world, far from each other."""
    things = [ObjectRegistry.load(name) for name in CATALOGUE]

    def build(world, number):
        for i, thing in enumerate(things):
            place = (5.0 + i, 0.0, 0.0)
            world.add(thing.name, *thing.parts, position=place, joints=thing.joints)

    simulation = Simulation(single({"arm": "panda"}), build, 1)
    bodies = simulation.backend.worlds[0].bodies
    return {
        thing.name: [
            (thing.parts, bodies[thing.name].component),
            *((j.parts, bodies[f"{thing.name}.{j.name}"].component) for j in thing.joints),
        ]
        for thing in things
    }


@pytest.mark.parametrize("name", CATALOGUE)
def test_physics_weighs_a_thing_as_its_descriptor_does(built, name):
    thing, components = ObjectRegistry.load(name), [component for _, component in built[name]]
    masses = [component.mass for component in components]
    assert sum(masses) == pytest.approx(thing.mass, rel=0.01)  # its cylinders have flat sides
    centre = np.average([c.cmass_local_pose.p for c in components], axis=0, weights=masses)
    assert np.abs(centre - thing.centre_of_mass).max() < 2e-4


@pytest.mark.parametrize("name", CATALOGUE)
def test_what_collides_is_what_is_seen(built, name):
    """Points of what is drawn are nearer than 3 mm, on average, to the shapes that physics has."""
    random, distances = np.random.default_rng(0), list[np.ndarray]()
    pairs: list[tuple] = []
    for parts, component in built[name]:
        hulls = [part for part in parts if isinstance(part, ConvexHull)]  # attached at the end
        order = [part for part in parts if not isinstance(part, ConvexHull)] + hulls
        pairs += zip(order, component.collision_shapes, strict=True)
    for part, shape in pairs:
        assert part.visible
        assert part.collides
        points = sampled(surface(part), 200, random)
        inside = shape.local_pose.inv().to_transformation_matrix()
        points = points @ inside[:3, :3].T + inside[:3, 3]
        if isinstance(part, ConvexHull):
            planes = _planes(np.asarray(shape.vertices, float), np.asarray(shape.triangles))
            distances.append(np.abs((points @ planes[:, :3].T - planes[:, 3]).max(axis=1)))
        elif isinstance(part, Box):
            distances.append(np.abs((np.abs(points) - shape.half_size).max(axis=1)))
        else:
            side = np.hypot(points[:, 1], points[:, 2]) - shape.radius
            end = np.abs(points[:, 0]) - shape.half_length
            distances.append(np.abs(np.maximum(side, end)))
    assert np.concatenate(distances).mean() < 3e-3


def _planes(vertices, triangles):
    one, two, three = vertices[triangles].transpose(1, 0, 2)
    normals = np.cross(two - one, three - one)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    normals *= np.sign(np.einsum("ij,ij->i", one - vertices.mean(axis=0), normals))[:, None]
    return np.column_stack([normals, np.einsum("ij,ij->i", normals, one)])


def test_things_stand_still_for_ten_seconds():
    seen = try_rests(ObjectRegistry.load(name) for name in CATALOGUE)
    assert [trial.problem for trial in seen if trial.problem] == []
    assert len(seen) == sum(len(ObjectRegistry.load(name).rests) for name in CATALOGUE)
    assert sum(trial.rest != "upright" for trial in seen) >= 10


@pytest.mark.long
def test_members_of_every_family_stand_still_for_ten_seconds():
    members = [ObjectRegistry.load(name, seed) for name in CATALOGUE for seed in range(5)]
    assert [trial.problem for trial in try_rests(members) if trial.problem] == []


MATES = {
    "bolt": "nut",
    "bottle": "bottle_cap",
    "box": "box_lid",
    "pot_two_handles": "pot_lid",
    "shaft": "gear",
    "socket": "peg",
}


@pytest.mark.parametrize("seed", [None, 1, 2])
def test_what_is_made_for_each_other_goes_together(seed):
    """Let go 3 mm above each other, one slides onto or into the other and stays upright."""
    pairs = [[ObjectRegistry.load(name, seed) for name in pair] for pair in MATES.items()]

    def build(world, number):
        below, above = pairs[number]
        height = bounds(below.parts)[1][2] - bounds(above.parts)[0][2] + 0.003
        world.add("below", *below.parts, kind="kinematic", position=(0.0, 0.0, below.height()))
        world.add("above", *above.parts, position=(0.0, 0.0, height + below.height()))

    simulation = Simulation(single({"arm": "panda"}), build, len(pairs))
    start = simulation.read().pose("above")
    for _ in range(40):
        simulation.coast(range(len(pairs)))
    end = simulation.read().pose("above")
    for (_, above), before, after in zip(pairs, start, end, strict=True):
        assert np.abs(after[:2]).max() < 3e-3, above.name
        assert abs(after[3]) > 0.999, above.name
        assert before[2] - after[2] > 0.005, above.name
    seats = {"socket": 0.01, "shaft": 0.012}  # m; the tops of their bases
    for number, (below, _) in enumerate(pairs):
        if below.name in seats:
            assert end[number][2] == pytest.approx(seats[below.name], abs=5e-4)


@pytest.mark.parametrize("seed", [None, 1, 2, 3])
def test_a_plug_is_at_rest_in_its_outlet(seed):
    plug, outlet = ObjectRegistry.load("plug", seed), ObjectRegistry.load("outlet", seed)
    reach = outlet.point("holes").position[0] - 0.02 + plug.point("tip").position[0]

    def build(world, number):
        world.add("outlet", *outlet.parts, kind="kinematic")
        world.add("floor", Box((0.5, 0.5, 0.01)), kind="kinematic", position=(0.516, 0.0, -0.01))
        world.add("plug", *plug.parts, position=(reach, 0.0, 0.0), quaternion=(0, 0, 0, 1))

    simulation = Simulation(single({"arm": "panda"}), build, 1)
    for _ in range(20):
        simulation.coast([0])
    (pose,) = simulation.read().pose("plug")
    assert np.abs(pose - (reach, 0, 0, 0, 0, 0, 1)).max() < 1e-3


def test_what_topples_or_sinks_is_noticed():
    mug = ObjectRegistry.load("mug")
    tilted = (0.9659258262890683, 0.25881904510252074, 0.0, 0.0)  # 30° about x
    (seen,) = try_rests([replace(mug, rests={"tilted": tilted})], time=3.0)
    assert seen.turned > 0.3
    assert "mug, put down tilted, moves by" in seen.problem
    assert RestTrial("mug", "upright", 2e-3, 2e-3, 0.0).problem is not None
    assert RestTrial("mug", "upright", 5e-4, 0.0, 0.0).problem is None


@pytest.mark.parametrize(("name", "opening"), [("mug", 0.04), ("hammer", 0.07), ("can", 0.1)])
def test_grasps_hold_when_the_hand_is_shaken(name, opening):
    thing = ObjectRegistry.load(name)
    tried = try_thing_grasps(thing, opening)
    assert tuple(one.grasp for one in tried) == thing.grasps_for(opening)
    assert sum(one.holds for one in tried) >= max(FEWEST_GRASPS, 0.9 * len(tried))


def test_a_seed_lets_the_hand_miss_and_shakes_along_other_axes():
    thing = ObjectRegistry.load("mug")
    plain, one, same, other = (try_thing_grasps(thing, 0.04, seed=s) for s in (None, 1, 1, 2))
    assert one == same
    assert len({tuple(seen.slipped for seen in tried) for tried in (plain, one, other)}) == 3
    assert [seen.grasp for seen in one] == [seen.grasp for seen in plain]
    assert sum(seen.holds for seen in other) >= 0.9 * len(other)


@pytest.mark.long
@pytest.mark.parametrize("seed", [None, 1, 2])
@pytest.mark.parametrize("name", GRASPED)
def test_twenty_grasps_of_every_thing_hold(name, seed):
    thing = ObjectRegistry.load(name, seed)
    most = 0
    for opening in OPENINGS:
        tried = try_thing_grasps(thing, opening)
        holding = sum(one.holds for one in tried)
        assert holding >= 0.8 * len(tried), opening
        most = max(most, holding)
    assert most >= FEWEST_GRASPS


def test_what_has_no_grasp_is_worked_by_pressing_on_it():
    pressed = {"button", "rocker", "seesaw", "toaster", "turntable", "two_hand_control"}
    assert set(CATALOGUE) - set(GRASPED) == pressed
    assert all(ObjectRegistry.load(name).points for name in pressed)


def test_a_grasp_beside_the_thing_and_one_of_something_slippery_do_not_hold():
    beam = ObjectRegistry.load("beam")
    good = beam.grasps[len(beam.grasps) // 2]
    beside = replace(good, position=(good.position[0], 0.0, good.position[2] + 0.06))
    across = replace(good, quaternion=(0.5, 0.5, 0.5, 0.5), opening=0.02)
    slippery = replace(
        beam,
        parts=tuple(replace(p, friction=Friction(0.0, 0.0), density=4000.0) for p in beam.parts),
    )
    assert [one.holds for one in try_thing_grasps(beam, 0.07, [good, beside])] == [True, False]
    assert not any(one.holds for one in try_thing_grasps(slippery, 0.07, [across]))
    assert try_thing_grasps(ObjectRegistry.load("brick"), 0.04) == []


def test_the_command_prints_what_was_seen(capsys):
    assert main(["objects", "inspect", "peg", "--try"]) == 0
    printed = capsys.readouterr().out
    assert "put down upright, it moves by 0.00" in printed
    assert "a hand of 7 cm holds it in 2" in printed
    assert "WRONG" not in printed

"""Layouts in a simulation: rings of mixed robots, rigid moves, robots that hang."""

import numpy as np
import pytest

from layouts import Layout, Placement, around_table, ceiling, grid, ring, side_by_side, wall
from robot_layouts.kinematics.quaternions import inverted, rotated
from robot_layouts.simulation import PhysicsSettings, Simulation, World
from robot_layouts.simulation.sapien3.world import BuiltWorld

MIXED = ("panda", "panda_stick", "so100")
NINE = {f"arm_{i}": MIXED[i % len(MIXED)] for i in range(9)}
EIGHT = ring(dict(list(NINE.items())[:8]))
STEPS = 5


def nothing(world: World, _: int = 0) -> None:
    """Leave a world empty but for its robots."""


def stand(simulation: Simulation) -> None:
    for world in simulation.worlds:
        for name, placement in world.layout.items():
            world.stand(name, placement.start_qpos)


def built(layout: Layout) -> Simulation:
    simulation = Simulation(layout, nothing, 1, PhysicsSettings())
    stand(simulation)
    return simulation


def in_base_frame(layout: Layout, name: str, point: np.ndarray) -> list[float]:
    base = layout[name].base_pose
    x, y, z = (float(a) - b for a, b in zip(point, base.position, strict=True))
    return list(rotated(inverted(base.quaternion), (x, y, z)))


@pytest.fixture(scope="module")
def eight() -> Simulation:
    return built(EIGHT)


def test_each_robot_of_a_ring_of_eight_is_driven_and_seen_alone(eight: Simulation):
    for moved in EIGHT:
        stand(eight)
        before = eight.read()
        action = np.zeros((1, EIGHT.action_dim), np.float32)
        action[:, EIGHT.action_split[moved]] = 0.5
        for _ in range(STEPS):
            eight.step(action, eight.read().joint_positions)
        after = eight.read()
        for name, placement in EIGHT.items():
            arm = len(placement.robot.arm_joints)
            change = np.abs((after.qpos(name) - before.qpos(name))[:, :arm]).max()
            assert (change > 0.03) == (name == moved), (moved, name, change)
            tcp = np.abs(after.tcp_position(name) - before.tcp_position(name)).max()
            assert (tcp > 0.01) == (name == moved), (moved, name, tcp)


@pytest.mark.parametrize(
    "layout",
    [
        EIGHT,
        ring({"a": "panda", "b": "so100", "c": "panda_stick"}),
        around_table(dict(list(NINE.items())[:4])),
        around_table(NINE),
        grid(NINE),
        side_by_side(NINE, spacing="auto", keyframe=None),
    ],
    ids=["ring", "ring of three", "table", "full table", "grid", "row"],
)
def test_at_automatic_distances_no_robot_touches_another(layout: Layout):
    world = BuiltWorld(layout, PhysicsSettings())
    for name, placement in layout.items():
        world.robots[name].reset(placement.start_qpos)
    world.scene.step()
    owners = {link: n for n, robot in world.robots.items() for link in robot.links.values()}
    for contact in world.system.get_contacts():
        first, second = contact.bodies
        if owners[first] != owners[second]:
            assert min(point.separation for point in contact.points) > 0, (first, second)


def test_a_rigid_move_leaves_what_each_robot_sees_of_itself_unchanged():
    layout = ring({"a": "panda", "b": "so100", "c": "panda_stick"})
    moved = layout.moved((0.7, -1.3, 0.2), yaw=2.1)
    noise = np.random.default_rng(0)
    actions = noise.uniform(-1, 1, (STEPS, 1, layout.action_dim)).astype(np.float32)
    one, other = built(layout), built(moved)
    for action in actions:
        for simulation in (one, other):
            simulation.step(action, simulation.read().joint_positions)
    here, there = one.read(), other.read()
    for name in layout:
        np.testing.assert_allclose(there.qpos(name), here.qpos(name), atol=1e-5)
        np.testing.assert_allclose(there.qvel(name), here.qvel(name), atol=1e-4)
        tcps = (here.tcp_position(name)[0], there.tcp_position(name)[0])
        assert np.abs(tcps[0] - tcps[1]).max() > 0.1, "the robots did move"
        seen = [
            in_base_frame(where, name, tcp)
            for where, tcp in zip((layout, moved), tcps, strict=True)
        ]
        np.testing.assert_allclose(seen[1], seen[0], atol=1e-5)


def test_hanging_robots_are_where_the_layout_says_and_stay_there():
    layout = Layout(
        {
            "standing": Placement("panda"),
            "hanging": Placement("panda", on="roof"),
            "beside": Placement("so100", (0.0, 0.5, 0.0), on="hanging"),
            "sideways": Placement("panda_stick", on="wall"),
        },
        {"roof": ceiling(2.5, position=(3.0, 0.0)), "wall": wall((-3.0, 0.0, 1.0))},
    )
    simulation = built(layout)
    action = np.zeros((1, layout.action_dim), np.float32)
    for _ in range(STEPS):
        simulation.step(action, simulation.read().joint_positions)
    state = simulation.read()
    seen = {n: in_base_frame(layout, n, state.tcp_position(n)[0]) for n in layout}
    assert state.tcp_position("hanging")[0, 2] < 2.5
    np.testing.assert_allclose(
        state.link_position("beside", "Base")[0], [3.0, -0.5, 2.5], atol=1e-6
    )
    np.testing.assert_allclose(seen["hanging"], seen["standing"], atol=1e-5)
    np.testing.assert_allclose(state.base_position("sideways")[0], [-3.0, 0.0, 1.0], atol=1e-6)
    assert state.tcp_position("sideways")[0, 0] > -3.0, "it stands out from the wall"

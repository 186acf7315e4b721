"""Worlds and states in another frame, and in another size."""

from math import pi

import numpy as np
import pytest

import tasks
from layouts import at_task, face_to_face
from robot_layouts.simulation import Box, Simulation
from robot_layouts.simulation.framed import Fit, FramedState, FramedWorld
from robots import SimulationError
from tasks import is_at_rest
from tasks.cells.sort_cubes import CUBES, HALF, NEAREST, PADS, THICK

SMALL = at_task("so101", tasks.get_task_class("CellPutAway-v1"))
FIT = Fit(0.5, x=1.0, y=-1.0, yaw=pi / 2)


@pytest.fixture(scope="module")
def case():
    """A drawer and a can for two SO-101, a quarter turned, after ten random steps."""
    env = tasks.make("CellPutAway-v1", layout=SMALL.moved((0.3, 0.2, 0.0), yaw=pi / 2))
    env.reset(seed=1)
    env.action_space.seed(1)
    for _ in range(10):
        env.step(env.action_space.sample())
    state = env.state
    return env, state, FramedState(state, env.task.fit, env.simulation.worlds[0].bodies)


def test_poses_lie_where_the_frame_says(case):
    env, state, framed = case
    fit = env.task.fit
    assert fit.scale < 0.5
    for body in ("can", "case", "case.drawer"):
        np.testing.assert_allclose(
            fit.place(framed.position(body)[0].tolist()), state.position(body)[0], atol=1e-6
        )
        turned = np.array(fit.turned(framed.quaternion(body)[0].tolist()))
        assert abs(turned @ state.quaternion(body)[0]) == pytest.approx(1.0, abs=1e-6)
    np.testing.assert_allclose(
        fit.place(framed.tcp_position("opener")[0].tolist()),
        state.tcp_position("opener")[0],
        atol=1e-6,
    )


def test_lengths_and_speeds_are_larger_and_angles_are_not(case):
    env, state, framed = case
    scale = env.task.fit.scale
    for of in (
        lambda s: s.distance("can", "case"),
        lambda s: s.tcp_distance("packer", "can"),
        lambda s: s.speed("can"),
        lambda s: np.linalg.norm(s.linear_velocity("can"), axis=1),
    ):
        np.testing.assert_allclose(of(framed) * scale, of(state), rtol=1e-4, atol=1e-7)
    np.testing.assert_allclose(framed.spin("can"), state.spin("can"), atol=1e-6)
    np.testing.assert_array_equal(framed.qpos("opener"), state.qpos("opener"))
    for robot in ("opener", "packer"):
        assert framed.is_grasping(robot, "can") == state.is_grasping(robot, "can")


def test_small_things_rest_at_the_speed_at_which_large_ones_do(case):
    env, _, _ = case
    bodies = env.simulation.worlds[0].bodies
    was = env.get_state_dict()
    for speed, rests in ((0.009, True), (0.011, False)):  # m/s; as fast the declared can is 2 cm/s
        now = env.get_state_dict()
        now["actors"]["can"][0, 7:] = 0.0
        now["actors"]["can"][0, 7] = speed
        env.set_state_dict(now)
        framed = FramedState(env.state, env.task.fit, bodies)
        assert framed.speed("can").item() > 0.02
        assert is_at_rest(framed, "can").item() is rests is is_at_rest(env.state, "can").item()
    env.set_state_dict(was)


def test_slides_of_bodies_are_as_long_as_declared():
    env = tasks.make(
        "CellPutAway-v1", layout=at_task("so101", tasks.get_task_class("CellPutAway-v1"))
    )
    fit, world = env.task.fit, env.simulation.worlds[0]
    world.set_joints("case", drawer=0.1 * fit.scale)
    framed = FramedState(env.state, fit, world.bodies)
    assert framed.joint("case", "drawer").item() == pytest.approx(0.1, abs=1e-5)


def test_a_world_takes_places_and_sizes_as_declared():
    built = []

    def build(world, _):
        framed = FramedWorld(world, FIT)
        assert framed.whole is world
        built.append(framed.add("box", Box(half_size=(0.1, 0.1, 0.1)), position=(0.2, 0.0, 0.1)))

    simulation = Simulation(face_to_face({"left": "panda", "right": "panda"}), build, 1)
    (box,) = built[0].shapes
    assert box.half_size == pytest.approx((0.05, 0.05, 0.05))
    assert built[0].position == pytest.approx((1.0, -0.9, 0.05))
    framed = FramedWorld(simulation.worlds[0], FIT)
    framed.set_pose("box", (0.0, 0.4, 0.1))
    with pytest.raises(SimulationError, match="3 finite numbers"):
        framed.set_pose("box", (0.0, 0.4))
    np.testing.assert_allclose(simulation.read().position("box")[0], (0.8, -1.0, 0.05), atol=1e-6)


def test_where_arms_stand_is_declared_too():
    cls = tasks.get_task_class("CellSetFaders-v1")
    turned = at_task("so101", cls).moved((0.5, 0.1, 0.0), yaw=1.0)
    env = tasks.make("CellSetFaders-v1", layout=turned)
    for arm, own in cls.layout.items():
        x, y, z = own.base_position
        assert env.task.before(arm, 1.0) == pytest.approx(
            (x / np.hypot(x, y), y / np.hypot(x, y)), abs=2e-3
        )
        assert FIT.declared(FIT.place((x, y, z))) == pytest.approx((x, y, z))


def test_success_is_judged_in_declared_lengths():
    env = tasks.make("CellSortCubes-v1", robots=dict.fromkeys(NEAREST, "so101"))
    world = FramedWorld(env.simulation.worlds[0], env.task.fit)
    for number, (arm, color) in enumerate(CUBES):
        x, y = PADS[color]
        world.set_pose(f"{arm}_{color}", (x + 0.03 * (-1) ** (number % 2), y, 2 * THICK + HALF))
    hold = np.zeros_like(env.action_space.sample())
    for _ in range(5):
        *_, info = env.step(hold)
    assert info["success"].item()

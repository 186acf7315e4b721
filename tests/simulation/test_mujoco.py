"""MuJoCo behind the seam: it begins as SAPIEN does, and moves things as they are declared."""

import dataclasses
from contextlib import closing

import numpy as np
import pytest
import torch

import tasks
from layouts import face_to_face, single
from objects.shapes import Box, Capsule, ConvexHull, Cylinder, Friction, Plane, Sphere
from robot_layouts.experts import find_expert
from robot_layouts.simulation import Camera, PhysicsSettings, Simulation
from robot_layouts.simulation.backend import SIMULATORS
from robot_layouts.simulation.checks.overlaps import stand
from robots import CONTROL_MODES, SimulationError
from tasks import Fixed, Light, Randomization, Shift, Uniform
from tests.quick import quick_cases

mujoco = pytest.importorskip("mujoco")

TASKS = ("PickCube-v1", "TwoRobotPickCube-v1")
CUBE = Box((0.02, 0.02, 0.02))
WEIGHT = 0.04**3 * 1000 * 9.81  # N
FLOOR = Plane(quaternion=(0.7071068, 0.0, -0.7071068, 0.0))  # its +x looks up
ROUNDING = 1e-5  # m, rad
# m; how far the TCP may be from SAPIEN's on its way, which depends on how often PhysX iterates
FREE_MOTION = {"pd_joint_pos": 5e-3, "pd_joint_delta_pos": 1e-2}


def made(task, **more):
    return tasks.make(task, simulator="mujoco", **more)


def built(*bodies, layout=None, num_envs=1, **more):
    """Return a simulation of a Panda far from some bodies, each a name, a shape and a position."""

    def build(world, number):
        world.add("floor", FLOOR, kind="static")
        for name, shape, position in bodies:
            world.add(name, shape, position=position)

    layout = layout or single({"arm": "panda"})
    simulation = Simulation(layout, build, num_envs, simulator="mujoco", **more)
    stand(simulation)
    return simulation


def wait(simulation, steps=20):
    for _ in range(steps):
        simulation.coast(range(simulation.num_envs))
    return simulation.read()


def leaves(thing, name=""):
    if hasattr(thing, "items"):
        for key, value in thing.items():
            yield from leaves(value, f"{name}/{key}")
    else:
        values = np.asarray(thing, float).copy()
        if name.endswith("tip_poses"):
            settle_signs(values.reshape(len(values), -1, 7)[..., 3:])
        elif name.startswith("/state/articulations/"):
            settle_signs(values[:, 3:7])
        yield name, values


def settle_signs(quaternions):
    """Give quaternions, (…, 4), that of their two signs with which the largest number is above 0.

    Those of links have any of the two in each simulator.
    """
    largest = np.abs(quaternions).argmax(-1, keepdims=True)
    quaternions *= np.sign(np.take_along_axis(quaternions, largest, -1))


@pytest.mark.parametrize("task", quick_cases(tasks.list_tasks(), quick=TASKS))
def test_a_reset_is_that_of_sapien_but_for_rounding(task):
    seen = {}
    for simulator in SIMULATORS:
        env = tasks.make(task, num_envs=2, simulator=simulator, obs_mode="state_dict")
        obs, _ = env.reset(seed=0)
        seen[simulator] = dict(leaves({"obs": obs, "state": env.get_state_dict()}))
        env.close()
    assert seen["sapien3"].keys() == seen["mujoco"].keys()
    for name, values in seen["sapien3"].items():
        np.testing.assert_allclose(seen["mujoco"][name], values, atol=ROUNDING, err_msg=name)


@pytest.mark.parametrize(
    "shape",
    [
        CUBE,
        Sphere(radius=0.02),
        Cylinder(radius=0.02, half_length=0.05, quaternion=(0.7071068, 0.0, 0.7071068, 0.0)),
        Capsule(radius=0.02, half_length=0.05),
        ConvexHull(
            tuple((x, y, z) for x in (-0.02, 0.02) for y in (-0.02, 0.02) for z in (0, 0.04))
        ),
    ],
    ids=lambda shape: type(shape).__name__,
)
def test_every_shape_falls_onto_a_floor_and_its_box_is_around_it(shape):
    simulation = built(("thing", shape, (1.0, 0.0, 0.2)))
    boxes = {part.name: box for part, box in simulation.backend.extents(0).items()}
    assert "floor" not in boxes
    low, high = boxes["thing"]
    assert (low < (1.0, 0.0, 0.25)).all()
    wait(simulation, 10)
    boxes = {part.name: box for part, box in simulation.backend.extents(0).items()}
    assert boxes["thing"][0][2] == pytest.approx(0.0, abs=1e-3)
    assert boxes["thing"][1][2] - boxes["thing"][0][2] == pytest.approx(high[2] - low[2], abs=1e-3)


def gripping(simulation, steps=20):
    """Close the gripper on a cube that is put between its fingers, and return the state."""
    (world,) = simulation.worlds
    world.set_pose("cube", simulation.read().tcp_position("arm")[0])
    action = np.zeros((1, 8), np.float32)
    action[:, 7] = -1.0
    for _ in range(steps):
        simulation.step(action, simulation.read().joint_positions)
    return simulation.read()


def test_a_gripped_cube_hangs_on_both_fingers_by_its_weight():
    state = gripping(built(("cube", CUBE, (1.0, 0.0, 0.2))))
    assert state.is_grasping("arm", "cube").tolist() == [True]
    forces = [
        state.contact_force("arm", f"panda_{side}finger", "cube")[0] for side in ("left", "right")
    ]
    assert forces[0][1] == pytest.approx(-forces[1][1], rel=0.01)
    assert abs(forces[0][1]) > 10
    assert sum(forces)[2] == pytest.approx(-WEIGHT, rel=0.05)
    assert not state.contact_force("arm", "panda_hand", "cube").any()


def test_two_surfaces_rub_with_the_mean_of_their_coefficients():
    slides = {}
    for static in (0.1, 0.9):  # on a floor of 0.3: in the mean 0.2 and 0.6
        rough = dataclasses.replace(CUBE, friction=Friction(static, static))
        simulation = built(("cube", rough, (1.0, 0.0, 0.02)))
        wait(simulation, 2)
        row = np.array([[1.0, 0.0, 0.02, 1, 0, 0, 0, 0.5, 0, 0, 0, 0, 0]], np.float32)
        simulation.write([0], {"cube": row}, {})
        slides[static] = wait(simulation).position("cube")[0, 0] - 1.0
    for static, way in slides.items():
        expected = 0.5**2 / (2 * 9.81 * (static + 0.3) / 2)
        assert way == pytest.approx(expected, rel=0.1)


@pytest.mark.parametrize("mode", quick_cases(CONTROL_MODES, quick=("pd_joint_delta_pos",)))
def test_a_robot_moves_as_in_sapien(mode):
    ways = {}
    for simulator in SIMULATORS:
        env = tasks.make("PickCube-v1", simulator=simulator, control_mode=mode)
        env.reset(seed=0)
        space = env.single_action_space
        action = (np.maximum(space.low, -1) + np.minimum(space.high, 1)) / 2
        if "delta" in mode or "vel" in mode:
            action[:3] = [0.2, -0.2, 0.2]
        if mode == "pd_joint_pos":  # far ways, on which drives reach their limits, are others
            action[:7] = env.simulation.read().qpos("arm")[0, :7] + 0.05
        if mode == "pd_ee_pose":
            state = env.simulation.read()
            place = state.tcp_position("arm")[0] - state.base_position("arm")[0]
            action[:6] = [*(place + 0.02), np.pi, 0.0, 0.0]
        ways[simulator] = []
        for _ in range(40):
            env.step(action[None])
            ways[simulator].append(env.simulation.read().tcp_position("arm")[0])
        env.close()
    apart = np.linalg.norm(np.subtract(*ways.values()), axis=1)
    assert apart.max() < FREE_MOTION.get(mode, 0.05)


@pytest.mark.parametrize(
    "robot", quick_cases(("panda", "xarm7", "ur10", "fetch"), quick=("panda",))
)
def test_frames_are_turned_by_the_quaternions_of_sapien_also_beyond_half_a_turn(robot):
    layout = single({"arm": robot})
    worlds = {
        name: Simulation(layout, lambda world, i: None, 1, simulator=name) for name in SIMULATORS
    }
    limits = np.nan_to_num(worlds["mujoco"].index.robots["arm"].limits, posinf=9.0, neginf=-9.0)
    tcp = layout["arm"].robot.tcp_link
    far = 0
    for posture in np.random.default_rng(0).uniform(*limits.T, (20, len(limits))):
        seen = []
        for simulation in worlds.values():
            stand(simulation)
            simulation.worlds[0].stand("arm", posture)
            seen.append(simulation.read().link_pose("arm", tcp)[0])
        np.testing.assert_allclose(*seen, atol=1e-4)
        far += bool((np.abs(posture) > np.pi).any())
    assert far


def test_two_runs_and_any_number_of_worlds_and_threads_have_the_same_bits():
    actions = np.random.default_rng(0).uniform(-1, 1, (10, 1, 16)).astype(np.float32)
    runs = []
    for count, threads in ((1, 1), (1, 1), (3, 1), (3, 2)):
        torch.set_num_threads(threads)
        env = made("TwoRobotPickCube-v1", num_envs=count)
        env.reset(seed=0)
        runs.append([env.step(np.tile(action, (count, 1)))[0][0].tolist() for action in actions])
        env.close()
    torch.set_num_threads(1)
    assert runs[0] == runs[1] == runs[2] == runs[3]


def test_a_state_that_is_set_goes_on_as_it_did():
    env = made("PickCube-v1", num_envs=2)
    env.reset(seed=0)
    actions = np.random.default_rng(0).uniform(-1, 1, (8, 2, 8)).astype(np.float32)
    for action in actions[:4]:
        env.step(action)
    state = env.get_state_dict()
    thrown = [0.3, 0.3, 0.5, 1, 0, 0, 0, 0.1, -0.2, 0.3, 1.0, 2.0, -1.0]  # m, m/s, rad/s
    state["actors"]["cube"][:] = torch.tensor(thrown)
    env.set_state_dict(state)
    after = [env.step(action)[0] for action in actions[4:]]
    env.set_state_dict(state)
    for name, values in leaves(env.get_state_dict()):
        np.testing.assert_allclose(values, dict(leaves(state))[name], atol=1e-6)
    again = [env.step(action)[0] for action in actions[4:]]
    np.testing.assert_allclose(np.array(after), np.array(again), atol=1e-4)


def test_a_reset_forgets_what_was_touched():
    with closing(made("PickCube-v1")) as env:
        env.reset(seed=0)
        for action in find_expert("PickCube-v1")(env, 0):
            *_, info = env.step(action)
        assert info["is_grasped"][0]
        _, info = env.reset(seed=1)
        assert not info["is_grasped"][0]
        assert not env.state.contact_force("arm", "panda_leftfinger").any()
        assert not env.simulation.backend.touching()[0]


def test_arms_that_touch_are_named():
    layout = face_to_face({"left": "panda", "right": "panda"}, spacing=0.9)
    simulation = built(layout=layout)
    with pytest.raises(SimulationError, match="call watch_arms"):
        simulation.backend.arms_touching(0)
    simulation.backend.watch_arms()
    action = np.zeros((1, 16), np.float32)
    action[:, [1, 9]] = 1.0
    for _ in range(40):
        simulation.step(action, simulation.read().joint_positions)
    (one, other), *_ = simulation.backend.arms_touching(0)
    assert {one.robot, other.robot} == {"left", "right"}
    assert simulation.backend.arms_touching(0) == []


@pytest.mark.parametrize(
    ("settings", "sentence"),
    [
        ({"continuous_collision": True}, "make the timestep shorter"),
        ({"rest_offset": 0.001}, "at 0"),
    ],
)
def test_what_mujoco_cannot_do_is_refused(settings, sentence):
    with pytest.raises(SimulationError, match=sentence):
        built(physics=PhysicsSettings(**settings))


def test_worlds_vary_each_by_itself():
    drawn = Randomization(
        mass={"cube": Uniform(1.0, 4.0)},
        size={"cube": Fixed(1.5)},
        friction={"cube": Fixed(0.7)},
        damping={"arm": Fixed(2.0)},
        gravity=Fixed(1.62),
    )
    env = made("PickCube-v1", num_envs=2, randomization=drawn)
    env.reset(seed=0)
    for _ in range(5):
        env.step(np.zeros((2, 8), np.float32))
    masses = []
    for world in env.simulation.backend.worlds:
        model, cube = world.model, world.index.body(None, "cube")
        assert model.opt.gravity[2] == pytest.approx(-1.62)
        assert model.actuator("arm/panda_joint1").biasprm[2] == pytest.approx(-200.0)
        (geom,) = np.flatnonzero(model.geom_bodyid == cube)
        assert model.geom_friction[geom, 0] == pytest.approx((0.7 + 0.3) / 2)
        own = (model.pair_geom1 == geom) | (model.pair_geom2 == geom)
        assert own.any()
        np.testing.assert_allclose(model.pair_friction[own, 0], (0.7 + 2.0) / 2)
        masses.append(model.body_mass[cube] / (0.064 * 1.5**3))
    assert all(1.0 < mass < 4.0 for mass in masses)
    assert masses[0] != masses[1]
    np.testing.assert_allclose(env.simulation.read().position("cube")[:, 2], 0.03, atol=1e-4)


def test_bases_stand_where_they_were_drawn_and_solvers_know_it():
    env = made("PickCube-v1", randomization=Randomization(bases={"arm": Shift(x=Fixed(0.03))}))
    env.reset(seed=0)
    state, solver = env.simulation.read(), env.simulation.backend.inverse_kinematics("arm")
    assert state.base_position("arm")[0, 0] == pytest.approx(-0.615 + 0.03)
    found, _ = solver.forward(state.qpos("arm")[0, :7])
    np.testing.assert_allclose(found, state.tcp_position("arm")[0], atol=1e-5)


@pytest.mark.parametrize(
    ("varies", "sentence"),
    [
        ({"joint_friction": {"arm": Fixed(0.1)}}, "no coefficient of friction of joints"),
        ({"lights": {"top": Light(tilt=Fixed(0.1))}}, "draws everything as it is declared"),
    ],
)
def test_what_cannot_vary_in_mujoco_is_refused(varies, sentence):
    with pytest.raises(SimulationError, match=sentence):
        made("PickCube-v1", randomization=Randomization(**varies))


@pytest.fixture(scope="module")
def draws():
    """Skip what draws where OpenGL does not."""
    try:
        mujoco.Renderer(mujoco.MjModel.from_xml_string("<mujoco/>"), 8, 8).close()
    except Exception as error:
        pytest.skip(f"MuJoCo draws nothing here: {error}")


@pytest.mark.usefixtures("draws")
def test_a_picture_shows_what_is_where_and_how_far_away():
    above = Camera(eye=(1.0, 0.0, 1.0), target=(1.0, 0.0, 0.0), width=33, height=33, fov=0.2)
    red = dataclasses.replace(CUBE, color=(1.0, 0.0, 0.0, 1.0))
    simulation = built(("cube", red, (1.0, 0.0, 0.02)), visuals=True)
    textures = ("rgb", "depth", "position", "segmentation")
    (view,) = simulation.look(0, {"above": above}, textures, markers=False)
    middle = {name: image[16, 16].tolist() for name, image in view.images.items()}
    assert middle["depth"] == pytest.approx([960], abs=1)
    assert middle["position"] == pytest.approx([0, 0, -960], abs=1)
    assert simulation.backend.segments()[middle["segmentation"][0]].name == "cube"
    assert middle["rgb"][0] > 2 * max(middle["rgb"][1:])
    assert view.images["depth"][0, 0, 0] == pytest.approx(1000, abs=1)  # the floor
    np.testing.assert_allclose(view.cam2world_gl[:3, 3], above.eye)
    with pytest.raises(SimulationError, match="draws no 'normal'; it draws rgb, depth"):
        simulation.look(0, {"above": above}, ("normal",), markers=False)


@pytest.mark.usefixtures("draws")
def test_markers_are_there_for_people_alone():
    def build(world, number):
        world.add("goal", dataclasses.replace(CUBE, collides=False), kind="kinematic", marker=True)

    simulation = Simulation(single({"arm": "panda"}), build, 1, simulator="mujoco", visuals=True)
    stand(simulation)
    simulation.worlds[0].set_pose("goal", (1.0, 0.0, 0.5))
    camera = {"above": Camera(eye=(1.0, 0.0, 1.0), target=(1.0, 0.0, 0.0), width=9, height=9)}
    seen = [
        simulation.look(0, camera, ("segmentation",), markers=markers)[0].images["segmentation"]
        for markers in (True, False)
    ]
    assert (seen[0][4, 4, 0] > 0, seen[1][4, 4, 0]) == (True, 0)


EXPERTS = ("TwoRobotPickCube-v1", "StackCube-v1", "TwoRobotLiftBar-v1", "CellPutAway-v1")


@pytest.mark.parametrize("task", quick_cases(EXPERTS, quick=()))
def test_experts_that_know_no_engine_solve_tasks(task):
    env = made(task)
    plan = find_expert(task)(env, 0)
    env.reset(seed=0)
    successes = [bool(env.step(action[None])[4]["success"][0]) for action in plan]
    assert any(successes)

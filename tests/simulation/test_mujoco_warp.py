"""What worlds on a device are read and driven by: the same as on the processor, as tensors."""

import dataclasses

import numpy as np
import pytest
import torch

import tasks
from layouts import single
from robot_layouts.simulation import Box, PhysicsSettings, Simulation
from robot_layouts.simulation.backend import Built
from robot_layouts.simulation.control.joint_positions import JointPositionController
from robot_layouts.simulation.mujoco_warp.control import DeviceFollower, DevicePositions
from robot_layouts.simulation.mujoco_warp.state import DeviceIndex, DeviceState, grasped
from robot_layouts.simulation.solvers import FOLLOWING, TreeFollower
from robots import Fingers, RobotRegistry
from robots.from_urdf import guess_descriptor
from tests.robots.test_guessing import knuckles, single_arm

CPU = torch.device("cpu")
ROUNDING = 2e-6  # m, rad: of float32
BODIES = ("cube", "goal_site")


class Moment:
    """Velocities and forces of a state, as tensors; none of the forces is zero."""

    past = False

    def __init__(self, state):
        self._moment = state._moment

    def velocities(self, wanted):
        return torch.from_numpy(self._moment.velocities(wanted))

    def forces(self, pairs):
        rows = np.arange(len(pairs) * 2 * 3, dtype=np.float32)
        return torch.from_numpy(rows.reshape(len(pairs), 2, 3))


@pytest.fixture(scope="module")
def states():
    """A state of two worlds that move, and the same on a device."""
    env = tasks.make("TwoRobotPickCube-v1", 2, robots={"right": "so100"}, simulator="mujoco")
    env.reset(seed=0)
    for _ in range(3):
        env.step(torch.rand(2, 14) * 2 - 1)
    state, index = env.simulation.read(), env.simulation.index
    frames = index.frames - len(index.mean_frames)
    order = tuple(reversed(range(env.layout["right"].robot.dof)))  # as if native had another
    right = dataclasses.replace(index.robots["right"], loaded_order=order)
    index.loaded_order["right"] = list(order)
    built = Built(frames, dict(index.bodies), {**index.robots, "right": right}, {})
    device = DeviceIndex(env.layout, built, CPU)
    tensors = map(
        torch.from_numpy,
        (state.all_poses[:frames].copy(), state.joint_positions, state.joint_velocities),
    )
    yield state, DeviceState(tuple(tensors), device, Moment(state))
    env.close()


def test_a_state_on_a_device_tells_what_a_state_does(states):
    def asked(state):
        for robot in ("left", "right"):
            yield state.gripper_opening(robot)
            yield from (state.is_static(robot, limit) for limit in (0.01, 0.2, 100.0))
            yield from (*state.native_joints(robot), state.arm_speed(robot), state.arm_qvel(robot))
            yield from (state.tcp_pose(robot), state.tcp_distance(robot, "cube"))
        yield from (state.rotation("cube"), state.last_euler_angle("cube"))
        yield from (state.distance(*BODIES), state.planar_distance(*BODIES), state.offset(*BODIES))
        yield from (state.speed("cube"), state.spin("cube"), state.linear_velocity("cube"))
        yield from (state.finger_gap("left"), *state.finger_heights("left"))
        yield from (state.array(((1.0, 2.0),)), state.full(True), state.env_ids)

    for expected, found in zip(*map(asked, states), strict=True):
        assert isinstance(found, torch.Tensor)
        assert found.shape == torch.Size(expected.shape)
        np.testing.assert_allclose(found.numpy(), expected, atol=ROUNDING, rtol=1e-5)


def test_forces_on_a_device_are_read_by_their_numbers(states):
    _, device = states
    thumb, cube = (
        device.contact_force("left", "panda_leftfinger"),
        device.contact_force("left", "panda_leftfinger", "cube"),
    )
    assert thumb.tolist() == [[0.0, 1.0, 2.0], [3.0, 4.0, 5.0]]
    assert cube.tolist() == [[6.0, 7.0, 8.0], [9.0, 10.0, 11.0]]


def test_a_grasp_takes_force_enough_and_straight():
    fingers = Fingers(("one", "other"), (1, -1), 0.5, 85.0)
    turns = [torch.tensor([[1.0, 0.0, 0.0, 0.0]] * 5)] * 2
    first = torch.tensor([[0.0, 1.0, 0.0], [0.0, 0.4, 0.0], [0, -1, 0], [9.0, 1.0, 0.0], [0, 0, 0]])
    forces = [first, torch.tensor([[0.0, -1.0, 0.0]] * 5)]
    assert grasped(fingers, forces, turns).tolist() == [True, False, False, True, False]
    across = [first, torch.tensor([[0.0, 1.0, 0.0]] * 5)]
    assert not grasped(fingers, across, turns).any()


@pytest.mark.parametrize("mode", ["pd_joint_delta_pos", "pd_joint_pos"])
@pytest.mark.parametrize("robot", ["panda", "fetch", "so100"])
def test_targets_on_a_device_have_the_same_bits(robot, mode):
    layout = single({"arm": robot}).in_control_mode(mode)
    action = np.random.default_rng(0).uniform(-1.3, 1.3, (4, layout.action_dim)).astype(np.float32)
    ours = JointPositionController(layout)
    qpos = np.random.default_rng(1).uniform(-1, 1, (4, ours.dof)).astype(np.float32)
    found = DevicePositions(layout, CPU).targets(*map(torch.from_numpy, (action, qpos)))
    np.testing.assert_array_equal(found.numpy(), ours.targets(action, qpos))


def test_poses_are_followed_on_a_device_as_one_by_one():
    robot = RobotRegistry.load("panda")
    joints = robot.arm_joints
    one = TreeFollower(robot, "panda_hand_tcp", None, joints)
    chain = DeviceFollower(robot, "panda_hand_tcp", None, joints).on(CPU)
    rng = np.random.default_rng(0)
    qpos = np.array(robot.keyframe("rest"), float) + rng.normal(0, 0.2, (20, robot.dof))
    near = one._chain.end_poses(qpos + rng.normal(0, 0.03, qpos.shape))
    near[-1, 0, 3] += 5.0  # out of reach
    found, arrived = chain.follow(torch.from_numpy(near), torch.from_numpy(qpos))
    for pose, start, own, came in zip(near, qpos, found, arrived, strict=True):
        expected, reached = one._chain.search(pose, start[None], one._free, FOLLOWING)
        assert bool(came) == bool(reached[0])
        if came:
            np.testing.assert_allclose(own.numpy(), expected[0], atol=1e-6)
    assert arrived[:-1].all()
    assert not arrived[-1]


@pytest.mark.long
def test_jaws_of_a_linkage_close_on_a_device_as_in_mujoco(tmp_path):
    pytest.importorskip("mujoco_warp")
    from robot_layouts.simulation.mujoco_warp.simulation import DeviceSimulation
    from robot_layouts.simulation.mujoco_warp.worlds import Starts

    parts, last = single_arm(end="")
    knuckles(parts, last)
    robot = guess_descriptor(parts.write(tmp_path), "made").descriptor
    assert robot.action_split.groups["gripper"].leaders
    layout, physics = single({"arm": robot}), PhysicsSettings()

    def stood(build):
        simulation = Simulation(layout, build, 1, physics, simulator="mujoco")
        simulation.worlds[0].stand("arm", robot.keyframe("rest"))
        return simulation, simulation.read()

    _, state = stood(lambda world, number: None)
    place = tuple(state.tcp_position("arm")[0].tolist())
    turn = tuple(state.link_pose("arm", robot.tcp_link)[0, 3:].tolist())
    block = Box(half_size=(0.03, 0.025, 0.03))
    host, state = stood(
        lambda world, number: world.add(
            "block", block, kind="static", position=place, quaternion=turn
        )
    )
    world = host.backend.worlds[0]
    starts = Starts.of([world], CPU).without_constants(world.as_built)
    device = DeviceSimulation(host, starts, 2)
    everywhere = torch.ones(2, dtype=torch.bool)
    device.begin(everywhere, starts.take(torch.zeros(2, dtype=torch.int64)))
    seen = device.read()
    device.hold(seen, everywhere)
    action = np.zeros((1, robot.action_dim), np.float32)
    action[0, -1] = -1.0
    for _ in range(8):
        host.step(action, state.joint_positions)
        device.step(torch.from_numpy(np.repeat(action, 2, 0)), seen)
        state, seen = host.read(), device.read()
        found = seen.joint_positions.numpy()
        np.testing.assert_allclose(found, np.repeat(state.joint_positions, 2, 0), atol=1e-5)
    jaws = state.qpos("arm")[0, -6:]
    assert np.abs(jaws).max() > 0.3  # they have closed as far as the block lets them

"""Bodies with joints in physics: stops, springs, where parts are, what a reset does to them."""

import functools

import numpy as np
import pytest

from layouts import single
from objects import Joint, ObjectRegistry
from objects.registry import CATALOGUE
from objects.shapes import Box
from objects.solids import part_poses
from robot_layouts.simulation import Simulation
from robot_layouts.simulation.backend import ENGINES, SIMULATORS
from robots import DescriptorError, SimulationError, UnknownNameError

JOINTED = [name for name in CATALOGUE if ObjectRegistry.load(name).joints]
POST = Box((0.02, 0.02, 0.1))
ARM = Box((0.1, 0.01, 0.01), position=(0.1, 0.0, 0.0))


@pytest.fixture(autouse=True, params=SIMULATORS)
def simulator(request, monkeypatch):
    """Try everything in each simulator."""
    pytest.importorskip(ENGINES[request.param])
    made = functools.partial(Simulation, simulator=request.param)
    monkeypatch.setattr("tests.simulation.test_jointed_bodies.Simulation", made)


def jointed(*joints, kind="static", **more):
    """A world with a post that holds joints."""

    def build(world, number):
        world.add("post", POST, kind=kind, position=(1.0, 0.0, 1.0), joints=joints, **more)

    simulation = Simulation(single({"arm": "panda"}), build, 1)
    reset(simulation)
    return simulation


def reset(simulation):
    simulation.clear([0])
    simulation.worlds[0].stand("arm", simulation.layout["arm"].start_qpos)
    simulation.rest(simulation.read(), [0])


def turn(**fields):
    usual = {"name": "arm", "kind": "turn", "parts": (ARM,), "axis": (0.0, 1.0, 0.0)}
    return Joint(**{**usual, "lower": -1.0, "upper": 1.0, **fields})


def wait(simulation, steps=60):
    for _ in range(steps):
        simulation.coast([0])
    return simulation.read()


def test_what_hangs_falls_to_its_stop_and_what_holds_it_stays():
    state = wait(jointed(turn()))
    assert state.joint("post", "arm")[0] == pytest.approx(1.0, abs=0.01)
    assert abs(state.joint_velocity("post", "arm")[0]) < 0.01
    assert state.position("post")[0].tolist() == [1.0, 0.0, 1.0]


def test_what_turns_without_end_stops_nowhere():
    simulation = jointed(turn(lower=None, upper=None, damping=0.05))
    assert wait(simulation, 100).joint("post", "arm")[0] == pytest.approx(np.pi / 2, abs=0.1)
    simulation.worlds[0].set_joints("post", arm=-3.0)
    assert simulation.read().joint("post", "arm")[0] == -3.0
    assert wait(simulation, 100).joint("post", "arm")[0] == pytest.approx(-np.pi * 3 / 2, abs=0.1)


def test_a_part_that_has_a_frame_of_its_own_moves_as_without():
    level = (0.0, 0.0, 0.02)
    plain = jointed(turn(at=level, damping=0.02), turn(name="other", carrier="arm", start=0.5))
    own = jointed(
        turn(at=level, origin=level, damping=0.02),
        turn(name="other", carrier="arm", start=0.5, origin=(0.1, 0.0, 0.0)),
    )
    for steps in (0, 6):
        expected, found = wait(plain, steps), wait(own, steps)
        joints = found.body_joints("post")
        assert joints == pytest.approx(expected.body_joints("post"), abs=1e-3)
        joints = own.worlds[0].bodies["post"].joints
        places = part_poses(joints, found.pose("post"), found.body_joints("post")[:, :2])
        for name, pose in places.items():
            assert found.pose(f"post.{name}") == pytest.approx(pose, abs=1e-5)
    assert found.position("post.arm")[0] == pytest.approx([1.0, 0.0, 1.02], abs=1e-6)


def test_a_spring_pulls_it_where_it_is_slack():
    spring = turn(axis=(0.0, 0.0, 1.0), stiffness=5.0, damping=0.5, rest=0.6)
    assert wait(jointed(spring)).joint("post", "arm")[0] == pytest.approx(0.6, abs=1e-3)


def test_friction_and_damping_slow_it_down():
    ways = [turn(), turn(damping=0.5), turn(friction=0.2)]
    fallen = [wait(jointed(way), 4).joint("post", "arm")[0] for way in ways]
    assert fallen[0] > 0.3
    assert fallen[1] < 0.5 * fallen[0]
    assert fallen[2] < 0.8 * fallen[0]


def test_a_dynamic_body_falls_with_its_parts_and_a_held_one_does_not():
    assert wait(jointed(turn(), kind="dynamic"), 4).position("post")[0, 2] < 0.9
    assert wait(jointed(turn(), kind="kinematic"), 4).position("post")[0, 2] == 1.0


def test_joints_are_placed_and_a_reset_puts_them_back_where_they_start():
    simulation = jointed(turn(start=0.5, axis=(0.0, 0.0, 1.0)), turn(name="other", lower=-2.0))
    (world,) = simulation.worlds
    world.set_joints("post", other=-1.5)
    world.set_pose("post", (1.0, 0.3, 1.0))
    state = simulation.read()
    assert [state.joint("post", name)[0] for name in ("arm", "other")] == [0.5, -1.5]
    assert state.position("post.arm")[0].tolist() == pytest.approx([1.0, 0.3, 1.0])
    wait(simulation, 10)
    reset(simulation)
    state = simulation.read()
    assert [state.joint("post", name)[0] for name in ("arm", "other")] == [0.5, 0.0]
    assert not state.joint_velocity("post", "other").any()


def test_what_cannot_be_placed_is_refused():
    simulation = jointed(turn())
    (world,) = simulation.worlds
    with pytest.raises(UnknownNameError, match="unknown joint of post 'arn'. Did you mean 'arm'"):
        world.set_joints("post", arn=0.0)
    with pytest.raises(DescriptorError, match="joint arm is 2.0; it must be a number from -1 to 1"):
        world.set_joints("post", arm=2.0)
    with pytest.raises(SimulationError, match="'post.arm' is a part of 'post', which a joint mov"):
        world.set_pose("post.arm", (0.0, 0.0, 0.0))
    state = simulation.read()
    with pytest.raises(UnknownNameError, match="unknown joint of post 'elbow'"):
        state.joint("post", "elbow")
    with pytest.raises(UnknownNameError, match="unknown body with joints 'post.arm'"):
        state.joint("post.arm", "arm")


@pytest.mark.parametrize("name", JOINTED)
def test_parts_are_where_the_joints_of_a_thing_say(name):
    thing = ObjectRegistry.load(name)

    def build(world, number):
        place = (1.0, 0.5 + number, thing.height() + 0.02)
        world.add("it", *thing.parts, position=place, joints=thing.joints, kind="kinematic")

    simulation = Simulation(single({"arm": "panda"}), build, 3)
    simulation.clear(range(3))
    for share, world in zip((0.1, 0.5, 0.9), simulation.worlds, strict=True):
        ends = {j.name: j.lower + share * (j.upper - j.lower) for j in thing.joints}
        world.set_joints("it", **ends)
    state = simulation.read()
    count = len(thing.joints)
    found = part_poses(thing.joints, state.pose("it"), state.body_joints("it")[:, :count])
    for joint, poses in found.items():
        seen = state.pose(f"it.{joint}").astype(float)
        assert np.abs(seen[:, :3] - poses[:, :3]).max() < 1e-6
        assert np.abs(np.abs((seen[:, 3:] * poses[:, 3:]).sum(1)) - 1).max() < 1e-6


def test_a_part_that_another_joint_carries_goes_with_it():
    beyond = Box((0.1, 0.01, 0.01), position=(0.3, 0.0, 0.0))
    arm = turn(axis=(0.0, 0.0, 1.0))
    wrist = turn(name="wrist", parts=(beyond,), at=(0.2, 0.0, 0.0), carrier="arm")
    simulation = jointed(arm, wrist)
    simulation.worlds[0].set_joints("post", arm=0.7, wrist=-0.6)
    for steps in (0, 5):
        state = wait(simulation, steps)
        joints = state.body_joints("post")[:, :2]
        found = part_poses((arm, wrist), state.pose("post"), joints)
        for name, poses in found.items():
            seen = state.pose(f"post.{name}").astype(float)
            assert np.abs(seen[:, :3] - poses[:, :3]).max() < 1e-6
            assert np.abs(np.abs((seen[:, 3:] * poses[:, 3:]).sum(1)) - 1).max() < 1e-6
    assert joints[0, 1] != pytest.approx(-0.6, abs=0.01)  # it fell

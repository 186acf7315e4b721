"""Robots whose base is moved by joints drive on a floor, and a trial says which cannot."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from layouts import single
from robot_layouts.core.errors import UnknownNameError
from robot_layouts.simulation import Simulation
from robot_layouts.simulation.checks.overlaps import stand
from robot_layouts.simulation.checks.trial import adds_floor, drives_on_floor, try_robot
from robots import ActionSplit, JointGroup, LocalUrdf, RobotDescriptor, RobotRegistry
from robots.from_urdf import guess_descriptor
from tests.faults.toy_robots import joint, link

DRIVES = ("fetch", "fetch_driving", "mobile_panda")
OTHERS = ("floating_panda_gripper", "panda", "so100")  # in the air; on a base that stands


def drive(robot: RobotDescriptor, steps: int, *last: float) -> np.ndarray:
    """Give a robot on a floor an action of zeros that ends in some numbers; return how it moved."""
    layout = single({"robot": robot})
    build = adds_floor(layout["robot"].base_position[2])
    simulation = Simulation(layout, build, 1)
    stand(simulation)
    before = simulation.read().joint_positions[0].copy()
    action = np.zeros((1, robot.action_dim), np.float32)
    action[0, robot.action_dim - len(last) :] = last
    for _ in range(steps):
        simulation.step(action, simulation.read().joint_positions)
    return simulation.read().joint_positions[0] - before


def test_fetch_drives_and_turns_on_a_floor():
    robot = RobotRegistry.load("fetch_driving")
    x, _, _ = drive(robot, 10, 1.0, 0.0)[-3:]  # m/s
    _, _, turn = drive(robot, 10, 0.0, 1.0)[-3:]
    assert x > 0.2
    assert turn > 1.0
    held = replace(robot, no_floor_contact=())
    assert np.abs(drive(held, 10, 1.0, 0.0)[-3:]).max() < 1e-3


@pytest.mark.parametrize("name", ["mobile_panda", "mobile_panda_dual"])
def test_a_column_that_begins_below_the_floor_is_not_pushed_out_of_it(name):
    robot = RobotRegistry.load(name)
    others = [i for i, joint in enumerate(robot.joints) if "finger" not in joint]
    assert np.abs(drive(robot, 2)[others]).max() < 1e-3


def test_which_robots_drive_on_a_floor():
    names = (*DRIVES, *OTHERS)
    assert [name for name in names if drives_on_floor(RobotRegistry.load(name))] == list(DRIVES)


def test_a_link_that_there_is_not():
    robot = replace(RobotRegistry.load("fetch"), no_floor_contact=("l_wheel",))
    with pytest.raises(UnknownNameError, match="no_floor_contact of fetch 'l_wheel'. Did you mean"):
        Simulation(single({"robot": robot}), adds_floor(0.0), 1)


BASE = """
<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>
<axis xyz="{axis}"/><limit lower="-9" upper="9" effort="500" velocity="9"/></joint>
"""


@pytest.fixture
def cart(tmp_path) -> RobotDescriptor:
    """A box on a wheel whose shape reaches 5 mm into the floor."""
    wheel = link("wheel", '<box size="0.1 0.1 0.21"/>')
    text = f"""<robot name="cart"><link name="root"/><link name="x"/><link name="y"/>
    {link("body", '<box size="0.4 0.4 0.1"/>')}{wheel}
    {BASE.format(name="root_x", kind="prismatic", parent="root", child="x", axis="1 0 0")}
    {BASE.format(name="root_y", kind="prismatic", parent="x", child="y", axis="0 1 0")}
    {BASE.format(name="root_z", kind="revolute", parent="y", child="body", axis="0 0 1")}
    <joint name="axle" type="fixed"><parent link="body"/><child link="wheel"/></joint></robot>"""
    path = tmp_path / "cart.urdf"
    path.write_text(text)
    base = JointGroup(
        ("root_x", "root_y", "root_z"),
        command="base_velocity",
        lower=(-1.0, -1.0),
        upper=(1.0, 1.0),
        stiffness=0.0,
        damping=1e3,
        force_limit=500.0,
        unit="m",
    )
    return RobotDescriptor(
        name="cart",
        urdf=LocalUrdf(path),
        action_split=ActionSplit(base=base),
        tcp_link="body",
        keyframes={"rest": (0.0, 0.0, 0.0)},
        reach=0.5,
        source="written for these tests",
        no_floor_contact=("wheel",),
    )


def test_wheels_of_a_base_that_joints_move_are_guessed(cart, tmp_path):
    text = cart.urdf.locate().read_text().replace("</robot>", "")
    path = tmp_path / "arm.urdf"
    path.write_text(f"{text}{link('arm')}{joint('shoulder', 'body', 'arm')}</robot>")
    guessed = guess_descriptor(path)
    assert guessed.descriptor.no_floor_contact == ("wheel",)
    assert "no_floor_contact: wheel, by name; they do not roll" in guessed.reasons


def test_a_trial_drives_on_the_floor(cart):
    assert try_robot(cart, steps=5).problems == ()


def test_a_trial_says_what_holds_a_base_on_the_floor(cart):
    forward, turn, cause = try_robot(replace(cart, no_floor_contact=()), steps=5).problems
    assert forward.startswith("base.forward moves root_x by 0% of what it asks for")
    assert re.match(r"base.turn moves root_z by \d% of what it asks for", turn)
    assert cause == (
        "the likely cause: at the start wheel and floor overlap by 5 mm;"
        " the descriptor's no_floor_contact=('wheel',) would end that"
    )

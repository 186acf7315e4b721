"""A tool centre point beside its link is the same place to whoever asks for it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import sapien

from layouts import Layout, Placement, single
from layouts.validation.reach import Arm, Workspace
from robot_layouts.kinematics.rotations import rotate
from robot_layouts.simulation import Simulation
from robot_layouts.simulation.checks.overlaps import empty, stand
from robot_layouts.simulation.checks.trial import tcp_error
from robot_layouts.simulation.sapien3.arms import SapienArm
from robot_layouts.simulation.sapien3.world import BuiltWorld
from robot_layouts.simulation.solvers import InverseKinematics
from robot_layouts.simulation.state import with_means
from robots import DescriptorError, RobotRegistry
from robots.bodies.hulls import load_model
from robots.grafting import with_tool
from tests.robots.urdf_parts import Parts

OFFSET = (0.03, -0.02, 0.05)
PANDA = RobotRegistry.load("panda")
BESIDE = replace(PANDA, tcp_offset=OFFSET)
PLACEMENT = Placement(BESIDE, position=(0.3, -0.4, 0.1), quaternion=(0.8, 0.0, 0.0, 0.6))


def test_a_state_has_it_beside_its_link():
    simulation = Simulation(Layout({"arm": PLACEMENT}), empty, 2)
    stand(simulation)
    state = simulation.read()
    link, tcp = state.link_pose("arm", "panda_hand_tcp"), state.tcp_pose("arm")
    np.testing.assert_array_equal(tcp[:, 3:], link[:, 3:])
    away = [rotate(pose[3:], OFFSET) for pose in link]
    np.testing.assert_allclose(tcp[:, :3], link[:, :3] + away, atol=1e-6)
    assert tcp.dtype == np.float32


def test_it_may_lie_beside_the_middle_of_links():
    turned = (np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5))  # a quarter about z
    poses = np.array([[(x, 0.0, 1.0, *turned)] for x in (1.0, 3.0)], np.float32)
    (between,) = with_means(poses, [(0, [0, 1], (0.1, 0.0, 0.2))])[2]
    np.testing.assert_allclose(between, (2.0, 0.1, 1.2, *turned), atol=1e-6)


def test_inverse_kinematics_brings_it_where_it_was():
    world = BuiltWorld(Layout({"arm": PLACEMENT}))
    solver = InverseKinematics(SapienArm(world, "arm"))
    start = np.array(PLACEMENT.start_qpos)
    world.robots["arm"].reset(start)
    link = world.robots["arm"].link("panda_hand_tcp").entity_pose
    place, turned = solver.forward(start[:7])
    np.testing.assert_allclose(place, (link * sapien.Pose(list(OFFSET))).p, atol=1e-6)
    solution = solver.solve(place + (0.05, 0.02, -0.04), turned, start)
    reached, _ = solver.forward(solution)
    np.testing.assert_allclose(reached, place + (0.05, 0.02, -0.04), atol=1e-3)


@pytest.mark.parametrize("turned", [(), (0.0, 1.0, 0.0, 0.0)])
def test_checks_bring_the_same_place_to_a_target(turned):
    layout, target = Layout({"arm": PLACEMENT}), (0.3, 0.05, 0.3)
    found = Arm(layout, "arm", load_model(BESIDE)).solve([(*target, *turned)])
    best = found.ranked(np.array(PLACEMENT.start_qpos))[0]
    assert found.solved[best]
    place, _ = InverseKinematics(SapienArm(BuiltWorld(layout), "arm")).forward(found.qpos[best, :7])
    np.testing.assert_allclose(place, target, atol=1.1e-3)


def test_it_widens_the_workspace_and_is_moved_without_error():
    model = load_model(BESIDE)
    arms = [Arm(Layout({"arm": Placement(r)}), "arm", model) for r in (PANDA, BESIDE)]
    volumes = [Workspace(arm, arm.base).volume for arm in arms]
    assert volumes[1] > 1.02 * volumes[0]
    assert tcp_error(BESIDE) < 0.002


def test_another_tool_takes_it_away(tmp_path):
    tool = Parts()
    tool.link("pen", 0.05, "0.01 0.01 0.1", "0 0 0.05")
    made = with_tool(BESIDE, tool.write(tmp_path), tcp_link="pen")
    assert made.tcp_offset == (0.0, 0.0, 0.0)


def test_an_offset_is_three_finite_numbers():
    with pytest.raises(DescriptorError, match="tcp_offset"):
        replace(PANDA, tcp_offset=(0.0, float("nan"), 0.0))
    assert single({"arm": BESIDE})["arm"].robot.tcp_offset == OFFSET

"""Forward and inverse kinematics of the checks agree with the physics engine."""

import functools
import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from layouts import Layout, Placement
from layouts.validation.bodies import load_model
from layouts.validation.kinematics import Kinematics, pose_matrix
from layouts.validation.reach import Reach, rotation_vectors
from robots import DescriptorError, RobotRegistry, UnknownNameError
from robots.urdf.model import read_model
from simulation.sapien3.world import BuiltWorld
from tests.layouts.small_robots import joint, link, turntable, urdf

BASE = (0.3, -0.4, 0.1), (0.8, 0.0, 0.0, 0.6)
seeds = st.integers(0, 2**32 - 1)
every_robot = pytest.mark.parametrize("robot", RobotRegistry.names())


def placement(robot):
    """A robot that neither stands at the origin nor faces along x."""
    return Placement(RobotRegistry.load(robot), *BASE)


@functools.cache
def world(robot):
    return BuiltWorld(Layout({"arm": placement(robot)}))


def engine(robot):
    return world(robot).robots["arm"]


def drawn(robot, seed):
    """Joint positions within the limits, in the descriptor's order."""
    limits = load_model(RobotRegistry.load(robot)).kinematics.limits
    low, high = np.clip(limits, -4.0, 4.0).T  # some bases slide for 20 m
    return np.random.default_rng(seed).uniform(low, high)


@every_robot
@settings(max_examples=6)
@given(seed=seeds)
def test_every_link_is_where_the_engine_has_it(robot, seed):
    simulated, qpos = engine(robot), drawn(robot, seed)
    active = np.zeros(len(simulated.joints))
    active[simulated.active_index] = qpos
    simulated.articulation.set_qpos(active)
    kinematics = load_model(simulated.descriptor).kinematics
    poses = pose_matrix(*BASE) @ kinematics.forward(qpos[None])[0]
    assert set(kinematics.links) == set(simulated.links)
    for name, link_ in simulated.links.items():
        expected = link_.entity_pose.to_transformation_matrix()
        np.testing.assert_allclose(poses[kinematics.link(name)], expected, atol=2e-6)


@every_robot
def test_limits_are_the_engines(robot):
    simulated = engine(robot)
    expected = np.concatenate([joint_.limits for joint_ in simulated.driven])
    limits = load_model(simulated.descriptor).kinematics.limits
    np.testing.assert_allclose(limits, expected, rtol=1e-6)


@every_robot
@settings(max_examples=4)
@given(seed=seeds)
def test_how_a_link_moves_is_the_slope_of_where_it_is(robot, seed):
    kinematics = load_model(RobotRegistry.load(robot)).kinematics
    tip, joints = kinematics.link(RobotRegistry.load(robot).tcp_link), range(len(kinematics.driven))
    qpos = drawn(robot, seed)
    turning, sliding = (x[0] for x in kinematics.axes(kinematics.forward(qpos[None]), tip, joints))
    steps = np.eye(len(qpos)) * 1e-6
    before, after = (kinematics.forward(qpos + sign * steps)[:, tip] for sign in (-1, 1))
    moved = (after - before)[:, :3, 3] / 2e-6
    turned = rotation_vectors(after[:, :3, :3] @ before[:, :3, :3].transpose(0, 2, 1)) / 2e-6
    place = kinematics.forward(qpos[None])[0, tip, :3, 3]
    np.testing.assert_allclose(sliding + np.cross(turning, place), moved, atol=1e-6)
    np.testing.assert_allclose(turning, turned, atol=1e-6)


class TestReach:
    def tcp(self, robot, qpos):
        """TCP position and pose of its link in the world, as the engine has them."""
        simulated = engine(robot)
        active = np.zeros(len(simulated.joints))
        active[simulated.active_index] = qpos
        simulated.articulation.set_qpos(active)
        descriptor = simulated.descriptor
        links = descriptor.tcp_position_links or (descriptor.tcp_link,)
        place = np.mean([simulated.links[name].entity_pose.p for name in links], axis=0)
        return place.astype(float), np.array(simulated.links[descriptor.tcp_link].entity_pose.q)

    def solve(self, robot, place, quaternion=None):
        model = load_model(RobotRegistry.load(robot))
        return Reach(placement(robot), model).solve(place, quaternion), model.kinematics.limits

    @every_robot
    @settings(max_examples=4)
    @given(seed=seeds)
    def test_places_the_arm_can_be_at_are_reached(self, robot, seed):
        qpos = np.array(placement(robot).start_qpos)
        arm = len(RobotRegistry.load(robot).arm_joints)
        qpos[:arm] = drawn(robot, seed)[:arm]
        place, _ = self.tcp(robot, qpos)
        solutions, limits = self.solve(robot, place)
        assert solutions[0].solved
        for solution in solutions:
            found, _ = self.tcp(robot, solution.qpos)
            assert np.linalg.norm(found - place) < 1.1e-3
            assert ((solution.qpos >= limits[:, 0]) & (solution.qpos <= limits[:, 1])).all()

    @pytest.mark.parametrize("robot", ["panda", "panda_stick", "panda_wristcam"])
    def test_poses_near_the_keyframe_are_reached_with_their_orientation(self, robot):
        rest = np.array(placement(robot).start_qpos)
        solved = 0
        for seed in range(15):
            qpos = rest.copy()
            qpos[:7] += np.random.default_rng(seed).normal(0, 0.3, 7)
            place, quaternion = self.tcp(robot, qpos)
            solutions, _ = self.solve(robot, place, quaternion)
            solved += solutions[0].solved
            if solutions[0].solved:
                found, turn = self.tcp(robot, solutions[0].qpos)
                assert np.linalg.norm(found - place) < 1.1e-3
                assert abs(turn @ quaternion) > np.cos(0.011 / 2)
        assert solved == 15

    @every_robot
    def test_what_is_out_of_reach_is_not_and_the_way_is_told(self, robot):
        away = np.array(BASE[0]) + [100.0, 0.0, 0.0]
        (nearest,), _ = self.solve(robot, away)
        found, _ = self.tcp(robot, nearest.qpos)
        assert not nearest.solved
        assert nearest.missing == pytest.approx(np.linalg.norm(found - away), abs=1e-4)
        assert 60.0 < nearest.missing < 100.0

    def test_the_fingers_stay_as_they_are(self):
        solutions, _ = self.solve("panda", np.array(BASE[0]) + [0.3, 0.2, 0.5])
        assert all(solution.qpos[7:] == (0.04, 0.04) for solution in solutions)


class TestJoints:
    def kinematics(self, *parts, driven=("turn",)):
        return Kinematics(read_model(urdf(*parts).encode(), "small.urdf"), driven)

    def test_a_joint_that_mimics_follows(self):
        follower = joint("grip", "top", "jaw", more='<mimic joint="turn" multiplier="-2"/>')
        model = self.kinematics(
            link("base"), link("top"), link("jaw"), joint("turn", "base", "top"), follower
        )
        jaw = model.forward(np.array([[0.3]]))[0, model.link("jaw")]
        np.testing.assert_allclose(jaw[:2, 0], [np.cos(-0.3), np.sin(-0.3)], atol=1e-12)

    def test_a_joint_that_is_driven_does_not_mimic(self):
        model = load_model(RobotRegistry.load("panda")).kinematics
        qpos = np.array(RobotRegistry.load("panda").keyframe("rest"))
        qpos[7:] = 0.0, 0.03
        poses = model.forward(qpos[None])[0]
        hand = poses[model.link("panda_hand")]
        left, right = (
            np.linalg.inv(hand) @ poses[model.link(f"panda_{side}finger")]
            for side in ("left", "right")
        )
        assert (left[1, 3], right[1, 3]) == pytest.approx((0.0, -0.03))

    def test_a_joint_that_nobody_drives_is_refused(self):
        loose = joint("loose", "top", "jaw")
        with pytest.raises(DescriptorError, match="'loose' of 'small' moves, but is in no"):
            self.kinematics(
                link("base"), link("top"), link("jaw"), joint("turn", "base", "top"), loose
            )

    def test_a_joint_that_does_not_exist_is_refused(self):
        with pytest.raises(
            DescriptorError, match=r"no moving joints \['spin'\]; it has \['turn'\]"
        ):
            self.kinematics(
                link("base"), link("top"), joint("turn", "base", "top"), driven=("spin",)
            )

    def test_a_tcp_link_that_does_not_exist_is_refused(self, tmp_path):
        arm = replace(turntable(tmp_path), tcp_link="tip")
        with pytest.raises(UnknownNameError, match="unknown link 'tip'. Did you mean 'top'"):
            Layout({"arm": Placement(arm)}).validate(targets=[(0, 0, 0)])


@every_robot
def test_hulls_are_the_engines_collision_shapes(robot):
    """Link by link, as many and of the same size; PhysX may leave out corners of a mesh."""
    simulated = engine(robot)
    model = load_model(simulated.descriptor)
    compared = 0
    for name, link_ in simulated.links.items():
        hulls = [hull for hull in model.hulls if model.kinematics.links[hull.link] == name]
        shapes = link_.get_collision_shapes()
        assert len(hulls) == len(shapes)
        for hull, shape in zip(hulls, shapes, strict=True):
            corners = shape_corners(shape)
            if corners is None:
                continue
            compared += 1
            np.testing.assert_allclose(hull.corners.min(0), corners.min(0), atol=2e-3)
            np.testing.assert_allclose(hull.corners.max(0), corners.max(0), atol=2e-3)
    assert compared >= 8


def shape_corners(shape):
    """Corners of a box or mesh in its link's frame, (n, 3) (m); None of round shapes."""
    if hasattr(shape, "vertices"):
        corners = shape.vertices * shape.scale
    elif hasattr(shape, "half_size"):
        corners = np.array(list(itertools.product((-1, 1), repeat=3))) * shape.half_size
    else:
        return None
    pose = shape.local_pose.to_transformation_matrix()
    return corners @ pose[:3, :3].T + pose[:3, 3]

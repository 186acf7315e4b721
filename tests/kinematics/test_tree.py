"""Where links are agrees with SAPIEN and yourdfpy; how they move, with finite differences."""

import io
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest
import yourdfpy
from hypothesis import given, settings
from hypothesis import strategies as st

from robot_layouts.kinematics.rotations import rotation_vector
from robot_layouts.kinematics.tree import FIXED, Tree
from robots import DescriptorError, RobotRegistry, UnknownNameError
from robots.urdf.reading import read_model
from robots.urdf.summary import read_cleaned
from robots.urdf.tree import kinematic_tree, link_index
from tests.catalogue import every_robot
from tests.kinematics.robots_of_the_catalogue import engine_poses, random_qpos, simulated, tree_of
from tests.layouts.small_robots import joint, link, urdf

seeds = st.integers(0, 2**32 - 1)
each_robot = pytest.mark.parametrize("robot", every_robot())


@each_robot
@settings(max_examples=6)
@given(seed=seeds)
def test_every_link_is_where_sapien_has_it(robot, seed):
    tree, qpos = tree_of(robot), random_qpos(robot, seed)
    poses, expected = tree.forward(qpos)[0], engine_poses(robot, qpos[0])
    assert set(tree.links) == set(expected)
    for name, pose in expected.items():
        np.testing.assert_allclose(poses[tree.link(name)], pose, atol=5e-6, err_msg=name)


@each_robot
def test_every_link_is_where_yourdfpy_has_it(robot):
    """By forward kinematics of its own, on the file without its shapes: it cannot read them all."""
    descriptor = RobotRegistry.load(robot)
    root = ElementTree.fromstring(read_cleaned(descriptor.urdf.locate()).xml)
    for element in root.iterfind("link"):
        for part in list(element):
            element.remove(part)
    for element in root.findall("joint"):
        for mimic in element.findall("mimic"):  # each joint of a descriptor has its own position
            element.remove(mimic)
    text = io.BytesIO(ElementTree.tostring(root))
    theirs = yourdfpy.URDF.load(text, load_meshes=False)
    tree, qpos = tree_of(robot), random_qpos(robot, 0)
    theirs.update_cfg(dict(zip(descriptor.joints, qpos[0], strict=True)))
    poses = tree.forward(qpos)[0]
    for name in tree.links:
        np.testing.assert_allclose(
            poses[tree.link(name)], theirs.get_transform(name), atol=1e-12, err_msg=name
        )


@each_robot
def test_limits_are_sapiens(robot):
    expected = np.concatenate([made.limits for made in simulated(robot).driven])
    np.testing.assert_allclose(tree_of(robot).limits, expected, rtol=1e-6)


@each_robot
def test_a_batch_has_the_bits_of_its_rows_and_a_part_those_of_the_whole(robot):
    tree, qpos = tree_of(robot), random_qpos(robot, 0, 50)
    poses = tree.forward(qpos)
    np.testing.assert_array_equal(poses[7:8], tree.forward(qpos[7:8]))
    tip = tree.link(RobotRegistry.load(robot).tcp_link)
    part = tree.towards([tip])
    assert part.links == tuple(tree.links[at] for at in tree.path(tip))
    np.testing.assert_array_equal(part.forward(qpos)[:, -1], poses[:, tip])


@each_robot
@settings(max_examples=4)
@given(seed=seeds)
def test_jacobians_are_the_slopes_of_poses(robot, seed):
    tree, qpos = tree_of(robot), random_qpos(robot, seed)
    steps = np.eye(qpos.shape[1]) * 1e-6
    before, after = (tree.forward(qpos + sign * steps) for sign in (-1, 1))
    for tip in (tree.link(RobotRegistry.load(robot).tcp_link), len(tree.links) - 1):
        one, other = before[:, tip], after[:, tip]
        moved = (other - one)[:, :3, 3] / 2e-6
        turned = rotation_vector(other[:, :3, :3] @ one[:, :3, :3].transpose(0, 2, 1)) / 2e-6
        expected = np.concatenate([moved, turned], axis=1).T
        jacobian = tree.jacobian(tree.forward(qpos), tip)[0]
        np.testing.assert_allclose(jacobian, expected, atol=1e-6)
        np.testing.assert_array_equal(
            tree.jacobian(tree.forward(qpos), tip, [2, 0])[0], jacobian[:, [2, 0]]
        )


class TestJoints:
    BASE = (link("base"), link("top"), link("jaw"), joint("turn", "base", "top"))

    def tree(self, *parts, driven=("turn",)):
        return kinematic_tree(read_model(urdf(*parts).encode(), "small.urdf"), driven)

    def follower(self):
        mimic = '<mimic joint="turn" multiplier="-2" offset="0.5"/>'
        return self.tree(*self.BASE, joint("grip", "top", "jaw", xyz="1 0 0", more=mimic))

    def test_a_joint_that_mimics_follows(self):
        tree = self.follower()
        jaw = tree.forward(np.array([[0.3]]))[0, tree.link("jaw")]
        np.testing.assert_allclose(jaw[:2, 0], [np.cos(0.2), np.sin(0.2)], atol=1e-12)

    def test_the_jacobian_has_what_mimics(self):
        tree = self.follower()
        jacobian = tree.jacobian(tree.forward(np.array([[0.0]])), tree.link("jaw"))
        np.testing.assert_allclose(jacobian[0, :, 0], [0, 1, 0, 0, 0, -1], atol=1e-12)

    def test_a_joint_that_is_driven_does_not_mimic(self):
        tree = tree_of("panda")
        qpos = np.array(RobotRegistry.load("panda").keyframe("rest"))
        qpos[7:] = 0.0, 0.03
        poses = tree.forward(qpos[None])[0]
        hand = np.linalg.inv(poses[tree.link("panda_hand")])
        left, right = (hand @ poses[tree.link(f"panda_{side}finger")] for side in ("left", "right"))
        assert (left[1, 3], right[1, 3]) == pytest.approx((0.0, -0.03))

    def test_a_joint_that_nobody_drives_is_refused(self):
        with pytest.raises(DescriptorError, match="'loose' of 'small' moves, but is in no"):
            self.tree(*self.BASE, joint("loose", "top", "jaw"))

    def test_a_joint_that_does_not_exist_is_refused(self):
        with pytest.raises(
            DescriptorError, match=r"no moving joints \['spin'\]; it has \['turn'\]"
        ):
            self.tree(*self.BASE[:2], self.BASE[3], driven=("spin",))

    def test_a_link_that_does_not_exist_is_named(self):
        with pytest.raises(UnknownNameError, match="unknown link 'panda_hnad'. Did you mean"):
            link_index(tree_of("panda"), "panda_hnad")


class TestArrays:
    def tree(self, **changes) -> Tree:
        tree = Tree(
            links=("base", "arm"),
            parents=np.array([-1, 0]),
            origins=np.tile(np.eye(4), (2, 1, 1)),
            axes=np.tile([0.0, 0.0, 1.0], (2, 1)),
            slides=np.array([False, False]),
            drivers=np.array([FIXED, 0]),
            multipliers=np.ones(2),
            offsets=np.zeros(2),
            coordinates=("turn",),
            limits=np.array([[-1.0, 1.0]]),
        )
        return replace(tree, **changes)

    @pytest.mark.parametrize(
        ("changes", "reason"),
        [
            ({"axes": np.zeros((3, 3))}, r"axes has the shape \(3, 3\); 2 links need \(2, 3\)"),
            ({"parents": np.array([-1, 1])}, "'arm', number 1, hangs on number 1; parents stand"),
            ({"parents": np.array([0, 0])}, "a root, which comes first and has the parent -1"),
            ({"drivers": np.array([FIXED, 1])}, r"drivers are \[-1, 1\]; there are 1 coordinates"),
        ],
    )
    def test_that_do_not_fit_are_refused(self, changes, reason):
        with pytest.raises(ValueError, match=reason):
            self.tree(**changes)

    def test_say_which_links_are_rigid(self):
        tree = self.tree()
        assert tree.bodies == (0, 1)
        assert (tree.carrier(1), tree.carrier(0)) == (0, -1)
        assert self.tree(drivers=np.array([FIXED, FIXED])).bodies == (0, 0)

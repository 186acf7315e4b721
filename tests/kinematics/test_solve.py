"""Solvers lead where they were asked to, within the limits, and every time alike."""

import numpy as np
import pytest

from robot_layouts.kinematics.rotations import rotation_about, rotation_vector
from robot_layouts.kinematics.solve import NEAR_ENOUGH, IkGoal, approach, farthest, scattered, solve
from robots import RobotRegistry
from tests.catalogue import every_robot
from tests.kinematics.robots_of_the_catalogue import random_qpos, tree_of

each_robot = pytest.mark.parametrize("robot", every_robot())


def arm_of(robot):
    descriptor = RobotRegistry.load(robot)
    return [descriptor.joints.index(name) for name in descriptor.arm_joints]


def starts_of(robot, count=24):
    tree, free = tree_of(robot), arm_of(robot)
    starts = np.tile(RobotRegistry.load(robot).keyframe("rest"), (count, 1))
    starts[:, free] = scattered(np.clip(tree.limits[free], -4, 4), count)
    return starts


@each_robot
@pytest.mark.parametrize("turned", [False, True])
def test_a_pose_that_the_arm_can_have_is_reached(robot, turned):
    tree, free = tree_of(robot), arm_of(robot)
    tip = tree.link(RobotRegistry.load(robot).tcp_link)
    wanted = starts_of(robot, 30)[29:]
    pose = tree.forward(wanted)[0, tip]
    goal = IkGoal(pose[:3, 3], [tip], pose[:3, :3] if turned else None, tip)
    found = solve(tree, goal, starts_of(robot), free)
    best = found.ranked(wanted[0])[0]
    assert found.solved[best]
    reached = tree.forward(found.qpos[best][None])[0, tip]
    assert np.linalg.norm(reached[:3, 3] - pose[:3, 3]) < NEAR_ENOUGH[0]
    if turned:
        np.testing.assert_allclose(reached[:3, :3], pose[:3, :3], atol=2 * NEAR_ENOUGH[1])
    low, high = tree.limits[free].T
    assert ((found.qpos[:, free] >= low) & (found.qpos[:, free] <= high)).all()
    still = np.delete(np.arange(found.qpos.shape[1]), free)
    np.testing.assert_array_equal(found.qpos[:, still], starts_of(robot)[:, still])


def test_each_start_may_have_a_goal_of_its_own():
    tree, free = tree_of("panda"), arm_of("panda")
    tip = tree.link(RobotRegistry.load("panda").tcp_link)
    poses = tree.forward(starts_of("panda", 8)[4:])[:, tip]
    starts = np.repeat(starts_of("panda", 4), 4, axis=0)  # four for each of four goals
    goals = np.tile(poses, (4, 1, 1))
    found = solve(tree, IkGoal(goals[:, :3, 3], [tip], goals[:, :3, :3], tip), starts, free)
    assert found.solved.reshape(4, 4).any(axis=0).all()
    reached = tree.forward(found.qpos)[:, tip]
    missing = np.linalg.norm(reached[:, :3, 3] - goals[:, :3, 3], axis=1)
    np.testing.assert_allclose(missing, found.missing, atol=1e-9)


def test_the_mean_of_links_is_brought_to_a_place():
    tree, free = tree_of("so100"), arm_of("so100")
    links = [tree.link(n) for n in RobotRegistry.load("so100").tcp_position_links]
    assert len(links) == 2
    place = tree.forward(starts_of("so100", 30)[29:])[0, links, :3, 3].mean(0)
    found = solve(tree, IkGoal(place, links), starts_of("so100"), free)
    best = int(np.argmin(found.missing))
    reached = tree.forward(found.qpos[best][None])[0, links, :3, 3].mean(0)
    assert np.linalg.norm(reached - place) == pytest.approx(found.missing[best], abs=1e-12)
    assert found.missing[best] < NEAR_ENOUGH[0]


def test_what_is_out_of_reach_leaves_the_nearest_posture():
    tree, free = tree_of("panda"), arm_of("panda")
    goal = IkGoal(np.array([5.0, 0.0, 0.3]), [tree.link("panda_hand_tcp")])
    found = solve(tree, goal, starts_of("panda"), free)
    assert not found.solved.any()
    (best,) = found.ranked(starts_of("panda")[0])
    assert found.missing[best] == found.missing.min()
    assert 4.0 < found.missing[best] < 4.3


def test_the_solution_with_the_shortest_way_comes_first():
    tree, free = tree_of("panda"), arm_of("panda")
    tip, rest = tree.link("panda_hand_tcp"), np.array(RobotRegistry.load("panda").keyframe("rest"))
    goal = IkGoal(tree.forward(rest[None])[0, tip, :3, 3], [tip])
    found = solve(tree, goal, np.concatenate([starts_of("panda"), rest[None]]), free)
    ways = [np.abs(found.qpos[i] - rest).max() for i in found.ranked(rest)]
    assert len(ways) > 5
    assert ways == sorted(ways)
    assert ways[0] < 1e-3


def test_no_posture_is_farther_than_the_farthest():
    tree, free = tree_of("panda"), arm_of("panda")
    tip = tree.link("panda_hand_tcp")
    reach = farthest(tree, tip, np.zeros(3), starts_of("panda", 8), free)
    places = tree.forward(random_qpos("panda", 0, 20_000))[:, tip, :3, 3]
    most = np.hypot(places[:, 0], places[:, 1]).max()
    assert most < reach + 1e-4
    assert 0.97 * reach < most


@pytest.mark.parametrize("robot", ["panda", "so100"])
def test_an_arm_approaches_the_place_first_and_goes_no_farther_than_it_may(robot):
    tree, free = tree_of(robot), arm_of(robot)
    tip = tree.link(RobotRegistry.load(robot).tcp_link)
    qpos = np.array(RobotRegistry.load(robot).keyframe("rest"), float)
    rest = qpos[free]
    pose = tree.forward(qpos[None])[0, tip]
    turned = pose[:3, :3] @ rotation_about([1.0, 0.0, 0.0], np.array(0.4))
    goal = IkGoal(pose[:3, 3] + [0.01, 0.02, 0.01], [tip], turned, tip)
    for _ in range(40):
        before = qpos
        qpos = approach(tree, goal, qpos, free, 0.05, rest)
        assert np.abs(qpos - before).max() <= 0.05 + 1e-9
    came = tree.forward(qpos[None])[0, tip]
    assert np.linalg.norm(came[:3, 3] - goal.position) < NEAR_ENOUGH[0]
    away = np.linalg.norm(rotation_vector(turned @ came[:3, :3].T))
    assert robot == "so100" or away < 0.02  # it has a joint too few for both

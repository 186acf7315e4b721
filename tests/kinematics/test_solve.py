"""Solvers lead where they were asked to, within the limits, and every time alike."""

import numpy as np
import pytest

from robot_layouts.kinematics.rotations import rotation_about, rotation_vector
from robot_layouts.kinematics.solve import (
    NEAR_ENOUGH,
    IkGoal,
    approach,
    by_way,
    descend_by_differences,
    farthest,
    nearby,
    scattered,
    solve,
    turned_within,
)
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


def test_few_iterations_do_not_get_there():
    tree, free = tree_of("panda"), arm_of("panda")
    tip = tree.link(RobotRegistry.load("panda").tcp_link)
    far = starts_of("panda", 30)[29:]
    goal = IkGoal(tree.forward(far)[0, tip, :3, 3], [tip])
    assert not solve(tree, goal, starts_of("panda", 1), free, iterations=1).solved.any()
    assert solve(tree, goal, starts_of("panda", 1), free).solved.any()


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


def test_the_same_request_has_the_same_answer():
    tree, free = tree_of("panda"), arm_of("panda")
    goal = IkGoal(np.array([0.4, 0.1, 0.4]), [tree.link("panda_hand_tcp")])
    one, other = (solve(tree, goal, starts_of("panda"), free) for _ in range(2))
    np.testing.assert_array_equal(one.qpos, other.qpos)
    np.testing.assert_array_equal(scattered(tree.limits, 5), scattered(tree.limits, 5))


def test_infinite_limits_are_scattered_over_one_turn():
    places = scattered(np.array([[-np.inf, np.inf], [0.0, 1.0]]), 1000)
    assert np.abs(places[:, 0]).max() <= np.pi
    assert np.ptp(places[:, 0]) > 6
    assert (0 <= places[:, 1]).all()
    assert (places[:, 1] <= 1).all()


def test_no_posture_is_farther_than_the_farthest():
    tree, free = tree_of("panda"), arm_of("panda")
    tip = tree.link("panda_hand_tcp")
    reach = farthest(tree, tip, np.zeros(3), starts_of("panda", 8), free)
    places = tree.forward(random_qpos("panda", 0, 20_000))[:, tip, :3, 3]
    most = np.hypot(places[:, 0], places[:, 1]).max()
    assert most < reach + 1e-4
    assert 0.97 * reach < most


class TestParts:
    def test_whole_turns_lead_into_the_limits(self):
        low, high = np.array([-1.0, 5.0]), np.array([1.0, 7.0])
        turned = turned_within(np.array([0.5 - 4 * np.pi, 6.0]), low, high)
        assert turned is not None
        np.testing.assert_allclose(turned, [0.5, 6.0])
        assert turned_within(np.array([2.0, 6.0]), low, high) is None

    def test_the_first_is_that_of_the_shortest_longest_way(self):
        candidates = [np.array([3.0, 0.0]), np.array([2.0, 2.0])]
        first, last = by_way(candidates, np.zeros(2))
        assert first is candidates[1]
        assert last is candidates[0]
        assert by_way([], np.zeros(2)) == []

    def test_places_nearby_differ_in_the_moving_joints_alone(self):
        places = nearby(np.array([1.0, 2.0, 3.0]), [0, 2], 5, 0.1)
        assert places.shape == (5, 3)
        assert (places[:, 1] == 2.0).all()
        assert 0 < np.abs(places[:, [0, 2]] - [1.0, 3.0]).max() < 0.5

    def test_a_function_is_descended_by_its_values_alone(self):
        def errors(x):
            return np.array([x[0] ** 2 - 2, x[0] * x[1] - 3])

        solution = descend_by_differences(errors, np.array([1.0, 1.0, 7.0]), [0, 1])
        np.testing.assert_allclose(solution, [2**0.5, 3 / 2**0.5, 7.0], atol=1e-6)


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

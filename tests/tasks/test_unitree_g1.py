"""The humanoid's tasks: what counts as done, and what the robot must be."""

import numpy as np
import pytest
import torch

import tasks
from robots import RobotRegistry, TaskError

BOX, APPLE = "UnitreeG1TransportBox-v1", "UnitreeG1PlaceAppleInBowl-v1"
ROBOT = "unitree_g1_simplified_upper_body_with_head_camera"


@pytest.fixture(scope="module")
def box():
    return tasks.make(BOX)


@pytest.fixture(scope="module")
def apple():
    return tasks.make(APPLE)


def judged(env, joints=(), **places):
    """Return what is said of a state in which bodies are at places (m) and some joints (rad)."""
    env.reset(seed=0)
    state = env.get_state_dict()
    for body, place in places.items():
        state["actors"][body][0, :3] = torch.tensor(place)
    for joint, position in joints:
        own = env.layout["robot"].robot.joints.index(joint)
        state["articulations"][ROBOT][0, 13 + own] = position
    env.set_state_dict(state)
    info = env.task.evaluate(env.state)
    reward = env.task.dense_reward(env.state, np.zeros((1, 25), np.float32), info)
    return {name: bool(flags[0]) for name, flags in info.items()}, float(reward[0])


@pytest.mark.parametrize(
    ("place", "over", "done"),
    [
        ((0.0, 0.66, 0.7505), True, True),
        ((0.7, 0.35, 0.7505), True, True),
        ((0.0, 0.66, 0.76), True, False),  # in the air
        ((0.0, 0.2, 0.7505), False, False),  # beside the table
        ((-0.1, -0.37, 0.7505), False, False),  # on the other one
    ],
)
def test_a_box_is_transported_once_it_stands_on_the_left_table(box, place, over, done):
    told, reward = judged(box, box=place)
    assert (told["box_at_correct_table_xy"], told["success"]) == (over, done)
    assert reward == 5.0 if done else reward < 5.0


def test_the_box_is_faced_between_two_angles_of_the_torso(box):
    for turn, faced in ((-1.3, False), (-1.55, True), (-1.75, False)):
        told, reward = judged(box, [("torso_joint", turn)])
        assert told["facing_table_with_box"] == faced
        assert (reward > 1.0) == faced


@pytest.mark.parametrize(
    ("off", "raised", "done"),
    [
        ((0.0, 0.0, 0.0), 0.0, False),  # the hand in the bowl's height
        ((0.0, 0.0, 0.0), 1.0, True),
        ((0.03, 0.03, 0.0), 1.0, True),
        ((0.06, 0.0, 0.0), 1.0, False),
    ],
)
def test_an_apple_is_placed_once_it_is_in_the_bowl_and_the_hand_above(apple, off, raised, done):
    apple.reset(seed=0)
    place = apple.get_state_dict()["actors"]["bowl"][0, :3].numpy() + off
    told, reward = judged(apple, [("right_shoulder_roll_joint", -raised)], apple=place.tolist())
    assert told["hand_outside_bowl"] == (raised > 0.5)
    assert told["success"] == done
    assert (reward > 8.0) == done


def test_above_the_bowl_an_open_hand_is_worth_more(apple):
    apple.reset(seed=0)
    place = apple.get_state_dict()["actors"]["bowl"][0, :3].numpy() + (0.0, 0.0, 0.15)
    open_hand, half = (
        judged(apple, [("right_four_joint", closed)], apple=place.tolist())[1]
        for closed in (0.0, 0.9)
    )
    assert 5.0 < half < open_hand <= 6.0


@pytest.mark.parametrize("task", [BOX, APPLE])
def test_a_robot_without_its_joints_is_refused(task):
    with pytest.raises(TaskError, match="'robot' needs the joints .*, and it does not drive them"):
        tasks.make(task, robots="panda")


def test_it_is_driven_as_in_native_and_else_the_robot_of_two_limbs():
    one = RobotRegistry.load(ROBOT)
    two = RobotRegistry.load("unitree_g1_upper_body_head_camera")
    (body,) = one.action_split.groups.values()
    limits = {
        joint: limit
        for group in two.action_split.groups.values()
        for joint, limit in zip(group.joints, group.limits, strict=True)
    }
    assert dict(zip(body.joints, body.limits, strict=True)) == limits
    steps = {
        joint: upper
        for group in two.action_split.groups.values()
        for joint, (_, upper) in zip(group.joints, group.ranges, strict=True)
    }
    assert dict(zip(body.joints, [upper for _, upper in body.ranges], strict=True)) == steps
    assert one.urdf == two.urdf

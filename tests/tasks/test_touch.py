"""What links feel: contact forces as parts of observations."""

from __future__ import annotations

import math
from contextlib import closing
from typing import Any

import numpy as np
import pytest
import torch

import tasks
from layouts import face_to_face
from robot_layouts.simulation import Simulation
from robot_layouts.simulation.checks.overlaps import empty, stand
from robots import RobotLayoutsError
from tests.motions import touching_episode
from tests.tasks.test_cameras import drawing

TASK = "PickCube-v1"
FINGERS = ("panda_leftfinger", "panda_rightfinger")
NAMES = tuple(f"arm.touch.{link}" for link in FINGERS)
WEIGHT = 0.04**3 * 1000 * 9.81  # N, of the cube
CLOSE = np.array([[0, 0, 0, 0, 0, 0, 0, -1]], np.float32)


def hold(env: tasks.TaskEnv, turn: float) -> dict[str, np.ndarray]:
    """Let one finger hold a cube above the other, and return what they feel.

    Args:
        env: Of `TASK`, in state_dict.
        turn: Which finger is above: that of the hand, a quarter turn to one side or the other.
    """
    env.reset(seed=0, options={"reconfigure": True})
    state = env.get_state_dict()
    robot = state["articulations"]["panda"]
    qpos = (0, 0, 0, -math.pi / 2, 0, math.pi, math.pi / 4 + turn, 0.0202, 0.0202)  # rad, m
    robot[0, 13:] = torch.tensor([*qpos, *[0.0] * 9])
    env.set_state_dict(state)
    state["actors"]["cube"][0, :7] = torch.from_numpy(env.state.tcp_pose("arm")[0])
    env.set_state_dict(state)
    for _ in range(40):
        obs, *_ = env.step(CLOSE)
    return {link: obs["extra"][f"arm.touch.{link}"][0].numpy() for link in FINGERS}


@pytest.mark.parametrize("turn", [math.pi / 2, -math.pi / 2])
def test_pads_press_against_each_other_and_the_lower_one_carries_the_cube(turn: float):
    """Contacts hold what presses, not friction: so one finger is above the other."""
    with closing(tasks.make(TASK, obs_mode="state_dict", touch=True)) as env:
        left, right = hold(env, turn).values()
        # The drive of each finger presses with 1000 N/m over the 3 cm to where it is driven to.
        assert 25 < left[1] < 30
        assert 25 < -right[1] < 30
        for along, *across in (np.roll(left, -1), np.roll(right, -1)):
            assert np.abs(across).max() < 0.01 * abs(along), "nothing presses from the sides"
        height = [env.state.link_position("arm", link)[0, 2] for link in FINGERS]
        lower, upper = (left, right) if height[0] < height[1] else (right, left)
        assert abs(lower[1]) - abs(upper[1]) == pytest.approx(WEIGHT, rel=0.01)
        world = sum(env.state.contact_force("arm", link)[0] for link in FINGERS)
        assert world[2] == pytest.approx(-WEIGHT, rel=0.01)
        assert np.abs(world[:2]).max() < 0.03 * WEIGHT  # the hand is not quite upright


def test_nothing_is_felt_in_free_space_and_after_a_reset():
    with closing(tasks.make(TASK, obs_mode="state_dict", touch=True)) as env:
        obs, _ = env.reset(seed=0)
        for action in np.random.default_rng(0).uniform(-0.1, 1, (5, 1, 8)).astype(np.float32):
            assert all(not obs["extra"][name].any() for name in NAMES)
            obs, *_ = env.step(action)
        assert all(force.any() for force in hold(env, math.pi / 2).values())
        obs, _ = env.reset(seed=1)
        assert all(not obs["extra"][name].any() for name in NAMES)
        assert env.state.contact_force("arm", FINGERS[0]).any(), "PhysX still has the old contact"


def test_arms_that_press_against_each_other_feel_opposite_forces():
    facing = face_to_face({"left": "panda", "right": "panda"}, spacing=1.2)
    simulation = Simulation(facing, empty, 1)
    stand(simulation)
    for name in facing:  # both hands are in each other
        qpos = [0.0, 0.41, 0.0, -2.05, 0.0, 2.46, 0.785, 0.04, 0.04]
        simulation.worlds[0].stand(name, qpos)
    still = np.zeros((1, facing.action_dim), np.float32)
    simulation.step(still, simulation.read().joint_positions)
    state = simulation.read()
    left, right = (
        sum(state.contact_force(name, link)[0] for link in simulation.index.links[name])
        for name in facing
    )
    assert np.abs(left).max() > 10
    np.testing.assert_allclose(left, -right, rtol=1e-4, atol=1e-3 * np.abs(left).max())


@pytest.mark.parametrize("task_id", [TASK, "TwoRobotPickCube-v1"])
def test_the_rest_of_the_observation_stays_as_it_is(task_id: str):
    with (
        closing(tasks.make(task_id, 2, touch=True)) as feeling,
        closing(tasks.make(task_id, 2)) as plain,
    ):
        width = plain.single_observation_space.shape[0]
        for env in (feeling, plain):
            env.reset(seed=5)
        draw = np.random.default_rng(0)
        for _ in range(5):
            action = draw.uniform(-1, 1, plain.action_space.shape).astype(np.float32)
            (obs, *more), (own, *others) = feeling.step(action), plain.step(action)
            assert torch.equal(obs[:, :width], own)
            assert torch.equal(more[0], others[0])
        arms = list(plain.layout)
        names = list(feeling.observation_slices)[-2 * len(arms) :]
        assert names == [f"{arm}.touch.{link}" for arm in arms for link in FINGERS]
        assert feeling.single_observation_space.shape == (width + 6 * len(arms),)


def test_what_is_felt_has_noise_and_comes_late():
    def played(**varied: Any) -> list[torch.Tensor]:
        making = {"randomization": tasks.Randomization(**varied)} if varied else {}
        with closing(tasks.make(TASK, touch=True, **making)) as env:
            env.reset(0)
            first, last = (env.observation_slices[name] for name in NAMES)
            place = slice(first.start, last.stop)
            actions = touching_episode(TASK, 0).actions
            return [env.step(action)[0][0, place].clone() for action in actions]

    exact, late = played(), played(observation_delay=tasks.Whole(2, 2))
    pressed = next(i for i, felt in enumerate(exact) if felt.any())
    assert all(map(torch.equal, exact[:-2], late[2:]))
    assert not late[pressed + 1].any()
    noisy = played(sensor_noise={"*.touch.*": tasks.Normal(0.5)})
    off = torch.stack(noisy) - torch.stack(exact)
    assert 0.4 < off.std() < 0.6  # N
    again = played(sensor_noise={"*.touch.*": tasks.Normal(0.5)})
    assert all(map(torch.equal, noisy, again))


@drawing
def test_it_is_sensed_beside_images():
    with closing(tasks.make(TASK, obs_mode="rgb", touch=True, camera_size=(32, 32))) as env:
        assert list(env.reset(seed=0)[0]["extra"])[-2:] == list(NAMES)
        assert env.observer.senses(NAMES[0])


@pytest.mark.parametrize(
    ("task_id", "robot", "touch", "names"),
    [
        (
            "TwoRobotPickCube-v1",
            "mobile_panda_dual",
            True,
            [f"robot.{arm}.touch.{arm}_{link}" for arm in ("left", "right") for link in FINGERS],
        ),
        (
            "PushCube-v1",
            "xarm7_ability",
            {"arm": ("thumb_L2", "index_L2")},
            ["arm.touch.thumb_L2", "arm.touch.index_L2"],
        ),
    ],
)
def test_limbs_and_hands_feel(task_id: str, robot: str, touch: Any, names: list[str]):
    with closing(tasks.make(task_id, robots=robot, touch=touch, check_layout=False)) as env:
        assert [name for name in env.observation_slices if ".touch." in name] == names


WRONG = [
    ({"touch": 3}, "touch is 3; True, or links by arm are needed"),
    ({"touch": {"arn": True}}, "arm for touch 'arn'. Did you mean 'arm'"),
    ({"touch": {"arm": "panda_hand"}}, "touch of 'arm' is 'panda_hand'; True, or names of links"),
    ({"touch": {"arm": ()}}, "True, or names of links are needed"),
    ({"touch": {"arm": ("panda_hand", "panda_hand")}}, "names a link twice"),
    ({"touch": {"arm": ("panda_hnad",)}}, "link of arm 'panda_hnad'. Did you mean 'panda_hand'"),
    ({"touch": True, "robots": "panda_stick"}, "no robot has known fingers; name links"),
    ({"touch": {"arm": True}, "robots": "panda_stick"}, "its fingers are not known; name links"),
    ({"touch": True, "obs_mode": "lerobot"}, "obs_mode 'lerobot' has no columns for touch"),
]


@pytest.mark.parametrize(("making", "message"), WRONG)
def test_what_cannot_feel_is_refused(making: dict[str, Any], message: str):
    with pytest.raises(RobotLayoutsError) as error:
        tasks.make("PushCube-v1" if "robots" in making else TASK, **making)
    assert message in str(error.value)

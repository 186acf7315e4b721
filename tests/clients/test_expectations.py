"""What other packages look for in environments; `test_clients` runs those packages themselves."""

import copy
import pickle

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers import TimeAwareObservation

import tasks
from robots import TaskError, UnknownNameError
from tasks.registry import UnexpectedArgumentError

PUSH, PAIR = "PushCube-v1", "TwoRobotPickCube-v1"


@pytest.fixture(scope="module")
def pair():
    env = tasks.parallel_env(PAIR, robots={"right": "panda_stick"})
    env.reset(seed=0)
    return env


@pytest.mark.parametrize(
    "make",
    [
        lambda **fields: gymnasium.make(f"RobotLayouts/{PUSH}", **fields),
        lambda **fields: gymnasium.make_vec(f"RobotLayouts/{PUSH}", num_workers=0, **fields),
        lambda **fields: tasks.make(PUSH, **fields),
        lambda **fields: tasks.parallel_env(PUSH, **fields),
        lambda **fields: tasks.sb3_vec_env(PUSH, num_workers=0, **fields),
    ],
    ids=["make", "make_vec", "task", "parallel", "sb3"],
)
def test_an_unknown_argument_is_pythons_own_error(make):
    with pytest.raises(TypeError, match="unexpected keyword argument 'frameskip'") as refused:
        make(frameskip=4)
    assert isinstance(refused.value, UnknownNameError)
    with pytest.raises(TypeError, match="Did you mean 'obs_mode'"):
        make(obs_mod="state")


def test_that_error_survives_being_sent():
    error = UnexpectedArgumentError.of(PUSH, "obs_mod", ["obs_mode"])
    again = pickle.loads(pickle.dumps(error))
    assert str(again) == str(error)
    assert (again.name, again.choices) == ("obs_mod", ("obs_mode",))


def test_an_observation_that_knows_the_time():
    env = TimeAwareObservation(gymnasium.make(f"RobotLayouts/{PUSH}", max_episode_steps=7))
    assert env.max_timesteps == 7
    assert env.reset(seed=0)[0].shape == env.observation_space.shape == (36,)


def test_copies_keep_their_spec():
    env = gymnasium.make(f"RobotLayouts/{PUSH}", max_episode_steps=7)
    for again in (pickle.loads(pickle.dumps(env)), copy.deepcopy(env)):
        assert again.spec.id == env.spec.id
        assert again.spec.max_episode_steps == 7
        assert again.reset(seed=3)[0].tolist() == env.reset(seed=3)[0].tolist()


def test_infos_have_one_set_of_keys_and_plain_values(pair):
    env = gymnasium.make(f"RobotLayouts/{PUSH}")
    infos = [env.reset(seed=0)[1], env.step(env.action_space.sample())[4]]
    infos += [info["left"] for info in (pair.reset(seed=0)[1], pair.step(still(pair))[4])]
    for first, later in zip(infos[::2], infos[1::2], strict=True):
        assert {key: type(x) for key, x in first.items()} == {k: type(x) for k, x in later.items()}
        assert all(isinstance(x, (bool, int, float, np.ndarray)) for x in later.values())
        assert first["is_success"] is first["success"] is False


def test_infos_of_vectors_say_is_success():
    env = gymnasium.make_vec(
        f"RobotLayouts/{PUSH}", num_envs=2, num_workers=0, autoreset_mode="SameStep"
    )
    assert env.autoreset_mode is env.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
    _, info = env.reset(seed=0)
    for _ in range(50):
        before, info = info, env.step(np.zeros((2, 8), np.float32))[4]
        assert {"is_success", "_is_success"} <= {*before} <= {*info}
    assert info["final_info"]["is_success"].tolist() == [False, False]


def test_options_of_others_are_ignored(pair):
    for env in (
        gymnasium.make(f"RobotLayouts/{PUSH}"),
        gymnasium.make_vec(f"RobotLayouts/{PUSH}", num_envs=1, num_workers=0),
        pair,
    ):
        env.reset(seed=1, options={"video": True})
    vector = tasks.sb3_vec_env(PUSH, num_workers=0)
    vector.set_options({"video": True})
    vector.reset()
    with pytest.raises(TaskError, match="unknown reset option 'video'"):
        tasks.make(PUSH).reset(options={"video": True})


def test_where_nothing_is_drawn_there_is_no_picture(pair):
    for env in (gymnasium.make(f"RobotLayouts/{PUSH}"), pair):
        env.reset(seed=0)
        with pytest.warns(UserWarning, match="make it with render_mode='rgb_array'"):
            assert env.render() is None


def test_spaces_of_all_robots_by_name(pair):
    for name in pair.possible_agents:
        assert pair.observation_spaces[name] is pair.observation_space(name)
        assert pair.action_spaces[name] is pair.action_space(name)


@pytest.mark.parametrize("obs_mode", ["state", "state_dict"])
def test_the_state_is_what_all_observe_together(obs_mode):
    env = tasks.parallel_env(PAIR, obs_mode=obs_mode)
    task = tasks.make(PAIR)
    env.reset(seed=4)
    flat, _ = task.reset(seed=4)
    for _ in range(3):
        assert env.state_space.contains(env.state())
        np.testing.assert_array_equal(env.state(), flat[0])
        actions = {name: env.action_space(name).sample() for name in env.agents}
        env.step(actions)
        flat, *_ = task.step({name: own[None] for name, own in actions.items()})


def still(env):
    return {name: np.zeros(space.shape, np.float32) for name, space in env.action_spaces.items()}

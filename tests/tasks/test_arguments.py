"""What a task, its resets and its steps are asked for."""

import math
import os
import subprocess
import sys

import numpy as np
import pytest
import torch

import layouts
import robots
import tasks
from robot_layouts import data, experts, motion, simulation
from robots import ActionError, TaskError, UnknownNameError
from tasks import maths, vocabulary
from tasks.registry import origin

TASK = "PickCube-v1"


@pytest.fixture(scope="module")
def env():
    return tasks.make(TASK, num_envs=2)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"num_envs": True}, "num_envs is True; it must be an integer of 1 or more"),
        ({"num_envs": 0}, "num_envs is 0"),
        ({"num_envs": 1.5}, "num_envs is 1.5"),
        ({"num_envs": 2**31}, r"that takes 8.59e\+05 GB at least, and this machine has"),
        ({"obs_mode": ["state"]}, r"unknown obs_mode \['state'\]"),
        ({"obs_mode": "rgbb"}, "unknown obs_mode 'rgbb'. Did you mean 'rgb'"),
        ({"obs_mode": "rgb+normals"}, "any of rgb, depth, segmentation, position, normal, albedo"),
        ({"obs_mode": "rgbd+state"}, "are joined by '.', and state or state_dict to them"),
        ({"reward_mode": "dens"}, "reward_mode 'dens' is not offered.*'dense'"),
        ({"simulator": "mujico"}, "'mujico' is not offered; choices: 'sapien3', 'mujoco', 'mujoc"),
        ({"headless": False}, "headless=False is not offered"),
        ({"cameras": ["base"]}, "cameras has a str; simulation.Camera is needed"),
        ({"physics": 3}, "physics is a int"),
        (
            {"layout": layouts.single({"hand": "panda"})},
            r"places \['arm'\]; the layout has \['hand",
        ),
        ({"reward_mode": np.array(["dense", "none"])}, "reward_mode .* is not offered"),
        ({"headless": None}, "headless is None; it must be True or False"),
        ({"cameras": 5}, "cameras is 5; a list of simulation.Camera is needed"),
        ({"layout": 5}, "layout is 5; a layouts.Layout is needed"),
        ({"max_episode_steps": 0}, "max_episode_steps is 0; it must be an integer from 1"),
        ({"max_episode_steps": True}, "max_episode_steps is True"),
        ({"robots": ["panda"]}, r"robots=\['panda'\] does not say .* robots={'arm': 'panda'}"),
        ({"robots": 5}, r"robots=5 does not say which place each robot takes"),
    ],
)
def test_what_no_task_can_be_made_with(fields, message):
    with pytest.raises(TaskError, match=message):
        tasks.make(TASK, **fields)


def test_a_list_of_robots_is_answered_with_their_places():
    with pytest.raises(TaskError, match="for example robots={'left': 'panda', 'right': 'so100'}"):
        tasks.make("TwoRobotPickCube-v1", robots=["panda", "so100"])
    with pytest.raises(UnknownNameError, match="Did you mean 'num_envs'"):
        tasks.make(TASK, num_env=2)


def test_counts_may_be_numpys():
    assert tasks.make(TASK, num_envs=np.int64(2)).num_envs == 2


@pytest.mark.parametrize("limit", [2, 60])
def test_an_episode_may_be_shorter_or_longer(limit):
    env = tasks.make(TASK, max_episode_steps=limit)
    env.reset(seed=0)
    ends = [env.step(np.zeros((1, 8), np.float32))[3].item() for _ in range(limit)]
    assert ends == [False] * (limit - 1) + [True]
    assert tasks.make(TASK).max_episode_steps == 50


@pytest.mark.parametrize(
    "seed",
    [True, [True, False], [0.5, 1], [[1], [2, 3]], 1j, {0}, math.nan, np.array([True, True])],
)
def test_what_is_no_seed(env, seed):
    with pytest.raises(TaskError, match="it takes an integer or a list of them"):
        env.reset(seed=seed)


def test_some_environments_may_go_on_unseeded(env):
    env.reset(seed=4)
    second = env.reset()[0]
    env.reset(seed=4)
    obs, _ = env.reset(seed=[9, None])
    assert torch.equal(obs[1], second[1])
    assert torch.equal(obs[0], env.reset(seed=9)[0][0])


@pytest.mark.parametrize("options", [5, 0, "reconfigure", ["reconfigure"], []])
def test_what_are_no_options(env, options):
    with pytest.raises(TaskError, match="options is .*; it takes a mapping"):
        env.reset(options=options)


@pytest.mark.parametrize("value", [1, 0, None, "no", []])
def test_to_rebuild_is_true_or_false(env, value):
    with pytest.raises(TaskError, match="the option 'reconfigure' is .*; it must be True or False"):
        env.reset(options={"reconfigure": value})


@pytest.mark.parametrize(
    "mask", [[True, False], np.array([True, False]), torch.tensor([True, False])]
)
def test_a_mask_is_no_list_of_numbers(env, mask):
    with pytest.raises(TaskError, match=r"not a mask: numpy.flatnonzero\(mask\) gives them"):
        env.reset(env_ids=mask)
    with pytest.raises(TaskError, match="not a mask"):
        env.step(np.zeros((2, 8), np.float32), env_ids=mask)


@pytest.mark.parametrize(
    "action",
    [
        torch.zeros(2, 8).to_sparse(),
        torch.zeros(2, 8, device="meta"),
        torch.zeros(2, 8, dtype=torch.bfloat16, device="meta"),
        torch.quantize_per_tensor(torch.zeros(2, 8), 0.1, 0, torch.qint8),
        torch.zeros(2, 8, dtype=torch.complex64),
        np.zeros((2, 8), complex),
        np.full((2, 8), None),
        [[0.0] * 8, [0.0]],
        np.full((2, 8), 1e300),
    ],
    ids=str,
)
@pytest.mark.filterwarnings("error")
def test_what_is_no_action(env, action):
    with pytest.raises(ActionError, match="action"):
        env.step(action)


@pytest.mark.parametrize("dtype", [torch.float16, torch.bfloat16, torch.float64])
def test_every_kind_of_float_is_one(env, dtype):
    action = torch.full((2, 8), 0.5)
    env.reset(seed=1)
    expected = env.step(action)[0].clone()
    env.reset(seed=1)
    assert torch.equal(env.step(action.to(dtype))[0], expected)


ROOMS = (experts, layouts, motion, robots, data, simulation, tasks)


@pytest.mark.parametrize("room", ROOMS, ids=lambda room: room.__name__)
def test_what_is_public_is_listed_and_can_be_imported(room):
    taken = {}
    exec(f"from {room.__name__} import *", taken)
    assert taken.keys() - {"__builtins__"} == {*dir(room)} == {*room.__all__}


def test_all_of_the_vocabulary_is_public():
    names = {name for name in vars(vocabulary) if not name.startswith("_")}
    assert names <= {*tasks.__all__}
    assert not {*maths.__all__} & {*tasks.__all__}  # `from tasks import *` hides no builtin
    with pytest.raises(AttributeError, match=r"no 'Cubiod'. Did you mean 'Cuboid'\? It has Area, "):
        tasks.Cubiod  # noqa: B018


@pytest.mark.long
def test_a_list_of_tasks_needs_no_robot_files(tmp_path):
    """Neither here nor from anywhere: the folder for them stays empty."""
    command = [sys.executable, "-m", "tasks", "list"]
    nowhere = {
        **os.environ,
        "ROBOT_LAYOUTS_ASSETS": str(tmp_path),
        "HF_ENDPOINT": "http://127.0.0.1:9",
    }
    done = subprocess.run(command, env=nowhere, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert not list(tmp_path.iterdir())
    rows = {line.split()[0]: line for line in done.stdout.splitlines() if line.strip()}
    own = {name for name in tasks.list_tasks() if origin(name) is None}
    assert own <= set(rows)
    assert rows["PickCube-v1"].split()[2:5] == ["8", "42", "50"]
    assert "32    –    300" in rows["FourRobotStack-v1"]

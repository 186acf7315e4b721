"""Environments over a socket: an episode from another process is that of this one, to the bit."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from queue import Queue

import numpy as np
import pytest
from gymnasium.spaces import Box, Dict
from websockets.exceptions import ConnectionClosedError
from websockets.sync.client import connect

import tasks
from layouts.commands import Server
from robot_layouts.data.playing.served.client import pack, unpack
from robot_layouts.data.serving import client
from robot_layouts.data.serving.client import (
    RemoteEnv,
    RemoteTaskError,
    read_space,
    written_space,
)
from robot_layouts.data.serving.server import MOST_BYTES, Admission, serve
from robot_layouts.simulation.rendering import vulkan_problem
from tasks.interfaces.gymnasium import info_row, row
from tests.data import expert_plays
from tests.data.plays import at_random

TASK, TWO = "PushT-v1", "TwoRobotPickCube-v1"
ROOT = Path(__file__).parents[2]


def start(task: str = TASK, **more) -> str:
    """Serve a task in a thread of this process, for as long as that lasts; returns the address."""
    ready: Queue[str] = Queue()
    settings = {"server": Server(port=0), "on_ready": ready.put, **more}
    threading.Thread(target=serve, args=(task,), kwargs=settings, daemon=True).start()
    return ready.get(timeout=60)


@pytest.fixture(scope="module")
def address() -> str:
    return start(admission=Admission(clients=3))


@pytest.fixture
def env(address) -> Iterator[RemoteEnv]:
    with closing(RemoteEnv(address)) as remote:
        yield remote


def assert_same(task, remote, seed, actions):
    """Compare every bit of an episode that is stepped here and there."""
    obs, info = task.reset(seed, {"reconfigure": True})
    seen, told = remote.reset(seed=seed)
    assert told == info_row(info, seed)
    assert row(obs).tobytes() == seen.tobytes()
    for action in actions:
        obs, reward, terminated, truncated, info = task.step(action)
        there = remote.step(action)
        assert there[0].tobytes() == row(obs).tobytes()
        assert there[1:4] == (reward[0].item(), bool(terminated[0]), bool(truncated[0]))
        assert there[4] == info_row(info, seed)


def test_an_episode_is_the_same_to_the_last_bit_whatever_was_played_before(env):
    with closing(tasks.make(TASK)) as task:
        for seed in (3, 1):
            assert_same(task, env, seed, at_random(task, seed)[:10])


def test_each_client_has_a_world_of_its_own(address, env):
    with closing(tasks.make(TASK)) as task, closing(RemoteEnv(address)) as other:
        other.reset(seed=7)
        task.reset(3, {"reconfigure": True})
        env.reset(seed=np.int64(3))
        for action in at_random(task, 3)[:5]:
            other.step(-action)
            obs = task.step(action)[0]
            assert env.step(action)[0].tobytes() == row(obs).tobytes()


def test_what_is_served_is_said_first(env):
    with closing(tasks.make(TASK)) as task:
        assert env.action_space == task.single_action_space
        assert env.observation_space == task.single_observation_space
        assert env.about["robots"] == {"arm": "panda_stick"}
        assert env.about["action_split"] == {"arm": [0, 7]}
        assert env.about["control_mode"] == "pd_joint_delta_pos"
        assert env.about["instruction"].endswith(".")


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda env: env.step("left"), "numbers are needed"),
        (lambda env: env._ask({"call": "rest"}), "Did you mean 'reset'?"),
        (lambda env: env._ask(["reset"]), "a message is a mapping"),
    ],
)
def test_bad_input_is_answered_in_a_sentence_and_the_world_is_kept(env, call, message):
    with closing(tasks.make(TASK)) as task:
        actions = at_random(task, 2)[:4]
        task.reset(2, {"reconfigure": True})
        env.reset(seed=2)
        task.step(actions[0])
        env.step(actions[0])
        with pytest.raises((RemoteTaskError, TypeError), match=message):
            call(env)
        assert env.step(actions[1])[0].tobytes() == row(task.step(actions[1])[0]).tobytes()


def test_an_episode_has_to_begin(env):
    with pytest.raises(RemoteTaskError, match="no episode has begun; reset first"):
        env.step(np.zeros(7))


def test_a_message_of_a_megabyte_is_not_read(address, env):
    env.reset(seed=0)
    with pytest.raises(RemoteTaskError, match="a message of 1,120,0.. bytes was sent; 1,048,576 a"):
        env.step(np.zeros((20_000, 7)))
    env.step(np.zeros(7))
    with connect(address) as socket:
        socket.recv()
        socket.send(bytes(MOST_BYTES + 1))
        with pytest.raises(ConnectionClosedError, match="1009"):
            socket.recv(timeout=10)


def test_messages_that_are_too_long_for_a_side_are_named(address, monkeypatch):
    with closing(RemoteEnv(address)) as env:
        with pytest.raises(RemoteTaskError, match="reads no message as long as that: .*16777216"):
            env.step(np.zeros(MOST_BYTES))
    monkeypatch.setattr(client, "MOST_BYTES", 100)
    with pytest.raises(RemoteTaskError, match="sent a message of more than 0 MB"):
        RemoteEnv(address)


def test_a_space_is_as_small_as_it_can_be():
    uneven = Box(np.array([0, 1], np.float32), np.full(2, np.inf, np.float32))
    parts = {"rgb": Box(0, 255, (512, 512, 3), np.uint8), "none": Box(0, 1, (0,)), "two": uneven}
    space = Dict(parts)
    sent = pack(written_space(space))
    assert len(sent) < 1000
    assert read_space(unpack(sent)) == space


@pytest.mark.long
@pytest.mark.skipif(vulkan_problem() is not None, reason="needs a Vulkan driver")
def test_large_pictures(renderer):
    making = {"obs_mode": "rgb", "camera_size": (512, 512)}
    address = start(TWO, **making)
    with connect(address) as socket:  # which takes a megabyte
        assert len(socket.recv()) < 10_000
    with closing(RemoteEnv(address)) as env, closing(tasks.make(TWO, **making)) as task:
        seen, _ = env.reset(seed=4)
        obs, _ = task.reset(4, {"reconfigure": True})
        assert env.observation_space.contains(seen)
        assert len(seen["sensor_data"]) == 3
        for name, camera in seen["sensor_data"].items():
            assert camera["rgb"].shape == (512, 512, 3)
            assert np.array_equal(camera["rgb"], row(obs)["sensor_data"][name]["rgb"])


def test_only_those_with_the_token_come_in(address):
    for wrong in (address.partition("?")[0], f"{address}x"):
        with pytest.raises(RemoteTaskError, match="The token is missing or another"):
            RemoteEnv(wrong)
    token = address.partition("=")[2]
    with pytest.raises(RemoteTaskError) as error:
        RemoteEnv(f"ws://127.0.0.1:9/?token={token}")
    assert token not in str(error.value)


@pytest.mark.long
def test_an_experts_episode_of_two_arms_from_another_process():
    words = [sys.executable, "-m", "robot_layouts", "serve", TWO, "--port", "0", "--no-token"]
    where = {**os.environ, "PYTHONPATH": str(ROOT)}
    process = subprocess.Popen(words, stdout=subprocess.PIPE, text=True, env=where)
    try:
        assert process.stdout is not None
        line = process.stdout.readline()
        assert line.startswith(f"{TWO}: ws://127.0.0.1:")
        env = RemoteEnv(line.partition(": ")[2].strip())
        assert_same(expert_plays.task(TWO), env, 0, expert_plays.plan(TWO, 0))
        assert env.step(np.zeros(16))[4]["success"] in (True, False)
        process.terminate()
        assert process.wait(30) == 0
    finally:
        process.kill()
        process.communicate()

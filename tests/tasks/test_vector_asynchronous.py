"""Vectors that wait for nobody: each environment's episodes are those of a vector in lockstep."""

import os
import signal
from collections import defaultdict
from contextlib import closing

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from robots import ActionError, SimulationError, TaskError
from tasks.interfaces.vector import VectorTask
from tasks.interfaces.workers import partition
from tests.quick import quick_cases
from tests.tasks.test_vector import differences, make

NUM_ENVS = 5
STEPS = 56  # an episode of PushCube, and some of the next
EVERYONE = np.arange(NUM_ENVS)


def action(env_id, step):
    """What an environment is sent as its nth action, whoever else steps."""
    return np.random.default_rng((env_id, step)).uniform(-1.2, 1.2, 8).astype(np.float32)


def said(results, row):
    """What a vector said of one environment."""
    obs, reward, terminated, truncated, info = results
    about = {
        key: value[row]
        for key, value in info.items()
        if not key.startswith("_") and key not in ("env_id", "final_info")
    }
    if (ended := info.get("_final_info")) is not None and ended[row]:
        about["final_info"] = {key: value[row] for key, value in info["final_info"].items()}
    elif about.get("final_obs", 0) is None:  # it is another environment that ended
        del about["final_obs"]
    return obs[row], reward[row], terminated[row], truncated[row], about


def in_lockstep(mode):
    env = make(num_envs=NUM_ENVS, autoreset_mode=mode)
    env.reset(seed=3)
    told = defaultdict(list)
    for step in range(STEPS):
        results = env.step(np.array([action(i, step) for i in range(NUM_ENVS)]))
        for i in range(NUM_ENVS):
            told[i].append(said(results, i))
    return told


def asynchronously(env):
    """Play until every environment has taken its steps; some are ahead of others."""
    env.reset(seed=3)
    told = defaultdict(list)
    env.send(np.array([action(i, 0) for i in EVERYONE]), EVERYONE)
    while any(len(told[i]) < STEPS for i in range(NUM_ENVS)):
        results = env.recv()
        ids = results[4]["env_id"]
        assert len(ids) == env.batch_size
        for row, i in enumerate(ids):
            told[i].append(said(results, row))
        env.send(np.array([action(i, len(told[i])) for i in ids]), ids)
    return {i: told[i][:STEPS] for i in range(NUM_ENVS)}


@pytest.fixture(scope="module")
def lockstep():
    return {mode: in_lockstep(mode) for mode in AutoresetMode}


@pytest.fixture(scope="module")
def shared():
    env = VectorTask("PushCube-v1", NUM_ENVS, num_workers=2, batch_size=2, timeout=30.0)
    yield env
    env.close()


@pytest.mark.parametrize("num_workers", quick_cases([0, 2], [2]))
@pytest.mark.parametrize("batch_size", quick_cases([1, 2, 3], [2]))
def test_every_environment_does_what_it_does_in_lockstep(num_workers, batch_size, lockstep):
    for mode in AutoresetMode if (num_workers, batch_size) == (0, 2) else ["NEXT_STEP"]:
        making = {"num_workers": num_workers, "batch_size": batch_size, "autoreset_mode": mode}
        with closing(make(num_envs=NUM_ENVS, **making)) as env:
            wanted = lockstep[env.metadata["autoreset_mode"]]
            assert differences(asynchronously(env), dict(wanted)) == []


def test_some_environments_of_a_part_step_without_the_others(lockstep):
    with closing(make(num_envs=NUM_ENVS, num_workers=0)) as env:
        env.reset(seed=3)
        env.batch_size = 1
        told = defaultdict(list)
        for i in [4, 0, 0, 2, 4, 4, 1]:
            env.send(action(i, len(told[i]))[None], [i])
            told[i].append(said(env.recv(), 0))
        wanted = lockstep[AutoresetMode.NEXT_STEP]
        assert differences(dict(told), {i: wanted[i][: len(told[i])] for i in told}) == []


def test_a_step_of_one_leaves_what_was_said_of_another_of_its_part():
    """The step in which an environment begins anew has no reward."""
    with closing(make(num_envs=2, num_workers=0)) as env:
        env.reset(seed=3)
        env.step(np.ones((2, 8), np.float32))
        env.reset(options={"reset_mask": np.array([False, True])})
        for _ in range(STEPS):
            env.send(np.ones((1, 8), np.float32), [0])
            env.send(np.ones((1, 8), np.float32), [1])
            _, reward, *_, info = env.recv()
            assert ((info["elapsed_steps"] > 0) == (reward > 0)).all()


@pytest.mark.long
def test_nobody_waits_for_the_slowest(shared):
    shared.reset(seed=0)
    slow, quick = shared._backend.workers[0], [2, 3, 4]
    os.kill(slow.pid, signal.SIGSTOP)
    try:
        shared.send(np.zeros((NUM_ENVS, 8), np.float32), EVERYONE)
        back = [shared.recv()[4]["env_id"].tolist()]
        assert set(back[0]) < set(quick)
    finally:
        os.kill(slow.pid, signal.SIGCONT)
    back += [shared.recv()[4]["env_id"].tolist()]
    shared.send(np.zeros((1, 8), np.float32), back[0][:1])
    back += [shared.recv()[4]["env_id"].tolist()]
    assert sorted(sum(back, [])) == sorted([*range(NUM_ENVS), back[0][0]])


def test_it_tells_what_it_cannot_do(shared):
    shared.reset(seed=0)
    one = np.zeros((1, 8), np.float32)
    with pytest.raises(SimulationError, match="recv.. returns 2 environments, and 0 were sent"):
        shared.recv()
    shared.send(one, [3])
    with pytest.raises(SimulationError, match="and 1 were sent actions; send.. more"):
        shared.recv()
    with pytest.raises(SimulationError, match=r"environments \[3\] were sent actions before"):
        shared.send(np.zeros((2, 8), np.float32), [2, 3])
    with pytest.raises(SimulationError, match=r"environments \[3\] were sent actions before"):
        shared.step(np.zeros((NUM_ENVS, 8), np.float32))
    for wrong, message in (
        ([5], r"env_ids \[5\] must be different numbers from 0 to 4"),
        ([-1], r"env_ids \[-1\] must be different numbers from 0 to 4"),
        ([0, 0], "must be different numbers"),
        ([0.5], "sequence of integers"),
        ([], "one at least is needed"),
        (2, "sequence of integers"),
    ):
        with pytest.raises(TaskError, match=message):
            shared.send(one, wrong)
    with pytest.raises(ActionError, match=r"must be \(2, 8\)"):
        shared.send(one, [0, 1])
    with pytest.raises(ActionError, match="is nan in environment 4"):
        shared.send(np.array([[0] * 8, [np.nan] + [0] * 7], np.float32), [1, 4])
    shared.send(one, [0])
    assert shared.recv()[4]["env_id"].tolist() == [0, 3]


@pytest.mark.parametrize("batch_size", [0, 6, 1.5, "2"])
def test_what_no_batch_size_is(batch_size):
    with pytest.raises(TaskError, match="batch_size"):
        VectorTask("PushCube-v1", NUM_ENVS, num_workers=0, batch_size=batch_size)


def test_a_reset_forgets_what_was_sent(shared):
    shared.reset(seed=0)
    shared.send(np.ones((NUM_ENVS, 8), np.float32), EVERYONE)
    obs, _ = shared.reset(seed=3)
    np.testing.assert_array_equal(obs, shared.reset(seed=3)[0])
    first = np.array([action(i, 0) for i in EVERYONE])
    with closing(make(num_envs=NUM_ENVS)) as alone:
        alone.reset(seed=3)
        for theirs, ours in zip(alone.step(first)[:4], shared.step(first)[:4], strict=True):
            np.testing.assert_array_equal(ours, theirs)
    shared.send(np.ones((NUM_ENVS, 8), np.float32), EVERYONE)
    shared.reset(options={"reset_mask": EVERYONE < 3})
    assert shared.recv()[4]["env_id"].tolist() == [3, 4]


@pytest.mark.parametrize(
    ("sizes", "shares"),
    [
        ((64, 2, 32), [[(0, 32)], [(32, 64)]]),
        ((64, 2, 16), [[(0, 16), (16, 32)], [(32, 48), (48, 64)]]),
        ((64, 2, 64), [[(0, 32)], [(32, 64)]]),
        ((5, 0, 2), [[(0, 2), (2, 4), (4, 5)]]),
        ((5, 2, 2), [[(0, 2)], [(2, 4), (4, 5)]]),
        ((4, 4, 2), [[(0, 1)], [(1, 2)], [(2, 3)], [(3, 4)]]),
    ],
)
def test_how_environments_are_shared(sizes, shares):
    found = partition(*sizes)
    assert [[(ids.start, ids.stop) for ids in share] for share in found] == shares

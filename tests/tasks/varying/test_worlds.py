"""Worlds that vary: what a seed brings back, and what stays as it was."""

import hashlib

import numpy as np
import pytest
import torch

import tasks
from simulation.sapien3.backend import worlds_below
from tasks import LogUniform, MultiRobotTask, Randomization, Uniform

TASK = "TwoRobotPickCube-v1"
REBUILT = {"reconfigure": True}
VARIED = Randomization(mass={"cube": LogUniform(0.5, 2.0), "left": Uniform(0.8, 1.2)})


def made(randomization: Randomization | None, num_envs: int = 1) -> MultiRobotTask:
    return tasks.make(TASK, num_envs, randomization=randomization)


def digest(env: MultiRobotTask, steps: int = 8) -> list[str]:
    """Play random actions and return a hash of each environment's states and observations."""
    rng, hashes = np.random.default_rng(0), [hashlib.sha256() for _ in range(env.num_envs)]
    width = env.single_action_space.shape[0]
    for _ in range(steps):
        row = rng.uniform(-1, 1, width).astype(np.float32)
        obs, *_ = env.step(np.tile(row, (env.num_envs, 1)))
        for i, own in enumerate(hashes):
            own.update(obs[i].numpy().tobytes())
            for entries in env.get_state_dict().values():
                for rows in entries.values():
                    own.update(np.asarray(rows[i]).tobytes())
    return [own.hexdigest() for own in hashes]


def test_off_means_the_bits_of_before() -> None:
    plain = tasks.make(TASK)
    for off in (None, Randomization()):
        env = made(off)
        obs, info = env.reset(seed=3, options=REBUILT)
        before, expected = plain.reset(seed=3, options=REBUILT)
        assert torch.equal(obs, before)
        assert list(info) == list(expected)
        assert digest(env) == digest(plain)
        assert env.drawn() is None


def test_the_tasks_own_draws_stay_what_they_are() -> None:
    env, plain = made(VARIED), made(None)
    for seed in (3, None):
        obs, _ = env.reset(seed=seed)
        assert torch.equal(obs, plain.reset(seed=seed)[0])


def test_a_seed_brings_the_world_back() -> None:
    alone, many = made(VARIED), made(VARIED, 3)
    many.reset(seed=4, options=REBUILT)
    drawn, digests = [many.drawn(i) for i in range(3)], digest(many)
    assert drawn[0] != drawn[1]
    for i in range(3):
        alone.reset(seed=4 + i, options=REBUILT)
        assert alone.drawn() == drawn[i]
        assert digest(alone) == [digests[i]]


def test_without_a_seed_another_world_is_drawn_and_the_same_ones_again() -> None:
    env = made(VARIED)
    env.reset(seed=4)
    drawn = [env.drawn()]
    for _ in range(2):
        env.reset()
        drawn.append(env.drawn())
    assert drawn[0] != drawn[1] != drawn[2]
    env.reset(seed=4)
    assert env.drawn() == drawn[0]
    env.reset()
    assert env.drawn() == drawn[1]


def test_info_tells_what_was_drawn() -> None:
    env = made(VARIED, 2)
    _, info = env.reset(seed=1)
    for i in range(2):
        drawn = env.drawn(i)
        assert drawn is not None
        assert float(info["drawn/mass/cube"][i]) == pytest.approx(drawn["mass"]["cube"])
        assert float(info["drawn/mass/left"][i]) == pytest.approx(drawn["mass"]["left"])


def test_another_target_leaves_the_draws_of_the_others() -> None:
    few, many = made(VARIED), made(Randomization(mass={"*": Uniform(0.9, 1.1), **VARIED.mass}))
    few.reset(seed=9)
    many.reset(seed=9)
    one, other = few.drawn(), many.drawn()
    assert one is not None
    assert other is not None
    assert one["mass"].items() < other["mass"].items()
    assert set(other["mass"]) == {"cube", "left", "right"}


def test_a_reset_begins_from_what_was_declared() -> None:
    env, plain = made(VARIED), made(None)
    (world,), (before,) = worlds_below(env.simulation), worlds_below(plain.simulation)
    for seed in (1, 2, 3):
        env.reset(seed=seed)
        drawn = env.drawn()
        assert drawn is not None
        declared, cube = before.bodies["cube"].component, world.bodies["cube"].component
        assert cube.mass == pytest.approx(declared.mass * drawn["mass"]["cube"], rel=1e-6)
        hand, link = (w.robots["left"].link("panda_hand") for w in (before, world))
        assert link.mass == pytest.approx(hand.mass * drawn["mass"]["left"], rel=1e-6)

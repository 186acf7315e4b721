"""`robot_layouts.data.evaluate`: the same whoever plays, and what one can read off it."""

import random
import re
import subprocess
import sys
import textwrap
import traceback
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import torch

import tasks
from layouts import Layout, Placement
from robot_layouts.__main__ import main
from robot_layouts.data import Score, evaluate, record
from robot_layouts.data.playing.executor import InProcessExecutor, ProcessExecutor, WorkerError
from robot_layouts.data.receipts import Receipt, verify
from robot_layouts.experts import find_expert, registry
from robots import TaskError, UnknownNameError
from tasks.episode import REBUILT, play
from tests.data.plays import NO_PLAN, Here, at_random
from tests.data.policies import ACTIONS, TASK, Wanders, fails, still

ROOT = Path(__file__).parents[2]


@pytest.mark.long
def test_who_plays_makes_no_difference():
    here = evaluate(Wanders(0.5), TASK, range(4), executor=Here())
    assert evaluate(Wanders(0.5), TASK, [3, 1, 0, 2], workers=2).scores == here.scores
    assert len(set(here.returns.values())) == 4
    assert evaluate(Wanders(0.5), tasks.make(TASK), range(4), executor=Here()) == here
    other = evaluate(Wanders(0.6), TASK, [2], executor=Here())
    assert other.returns[2] != here.returns[2]


def test_this_process_plays_the_same():
    """Policies that no other process could load included; nothing of theirs stays behind."""
    torch.manual_seed(5)
    random.seed(5)
    before = torch.get_rng_state(), random.getstate(), torch.get_num_threads()
    policy = Wanders(0.5)
    here = evaluate(policy, TASK, range(3), workers=0)
    assert policy == Wanders(0.5)
    assert here.scores == evaluate(lambda obs: policy(obs), TASK, [0], workers=0).scores | {
        seed: here.scores[seed] for seed in (1, 2)
    }
    after = torch.get_rng_state(), random.getstate(), torch.get_num_threads()
    assert torch.equal(before[0], after[0])
    assert before[1:] == after[1:]
    assert here.scores == evaluate(Wanders(0.5), TASK, range(3), executor=Here()).scores


class AtOnce:
    """Acts for all environments that are running."""

    batched = True

    def __init__(self):
        self.rows = set()

    def __call__(self, obs):
        self.rows.add(len(obs))
        return torch.tanh(obs[:, :7] * 3)

    def alone(self, obs):
        return torch.tanh(obs[:, :7] * 3)


@pytest.mark.long
def test_episodes_played_at_once_are_those_played_alone():
    """Whatever the policy draws or remembers; the last process plays fewer than the others."""
    alone = evaluate(Wanders(0.5), TASK, range(5), workers=0)
    assert evaluate(Wanders(0.5), TASK, range(5), workers=0, num_envs=3).scores == alone.scores
    assert evaluate(Wanders(0.5), TASK, range(5), workers=2, num_envs=2).scores == alone.scores
    policy = AtOnce()
    at_once = evaluate(policy, TASK, range(3), workers=0, num_envs=3)
    assert at_once.scores == evaluate(policy.alone, TASK, range(3), workers=0).scores
    assert policy.rows == {3}


def test_episodes_that_end_early_wait_for_the_others():
    alone = evaluate("expert", "PickCube-v1", range(3), workers=0)
    at_once = evaluate("expert", "PickCube-v1", range(3), workers=0, num_envs=3)
    assert at_once.scores == alone.scores
    assert len(set(alone.lengths.values())) > 1


def test_an_error_of_several_episodes_names_them():
    with pytest.raises(WorkerError, match="one of the seeds 7, 8: KeyError: 'no such key'"):
        evaluate(fails, TASK, [7, 8], workers=0, num_envs=2)


@pytest.mark.long
def test_a_policy_of_a_notebook():
    program = """
        from robot_layouts.data import evaluate

        def policy(obs):
            return [0.0] * 7

        try:
            evaluate(policy, "PushT-v1", [1], workers=2)
        except RuntimeError as error:
            print(error)
        print(evaluate(policy, "PushT-v1", [1], workers=0).lengths)
    """
    words = [sys.executable, "-c", textwrap.dedent(program)]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True)
    refused, played = done.stdout.splitlines()
    assert refused.startswith(
        "policy is defined in this notebook or interactive session, where wor"
    )
    assert "workers=0" in refused
    assert played == "{1: 100}"


@pytest.mark.parametrize("workers", [0, 1])
def test_an_error_of_a_policy_comes_whole(workers):
    with pytest.raises(
        WorkerError, match=r"seed 7: KeyError: .* \(.*policies.py:\d+, in fails\)"
    ) as e:
        evaluate(fails, TASK, [7], workers=workers)
    lines = "".join(traceback.format_exception(e.value))
    assert 'return {}["no such key"]' in lines


def test_it_is_what_one_sees_by_hand():
    robots = {"arm": "panda_stick"}
    found = evaluate(still, TASK, [3], executor=Here(), reward_mode="sparse", robots=robots)
    env = tasks.make(TASK, reward_mode="sparse")
    env.reset(3, options=REBUILT)
    total, steps, over = 0.0, 0, False
    while not over:
        _, reward, terminated, truncated, _ = env.step(torch.zeros(1, 7))
        total, steps = total + float(reward), steps + 1
        over = bool(terminated | truncated)
    assert found.scores == {3: Score(False, total, steps)}
    assert steps == env.max_episode_steps


def test_an_expert_plays_its_plan(monkeypatch):
    monkeypatch.setitem(registry.EXPERTS.registered, TASK, at_random)
    found = evaluate("expert", TASK, [4, NO_PLAN], executor=Here())
    episode = play(env := tasks.make(TASK), 4, at_random(env, 4))
    assert found.lengths == {4: 24, NO_PLAN: 0}
    assert found.reasons == {NO_PLAN: f"no plan for seed {NO_PLAN}"}
    assert str(found).endswith(f"seed {NO_PLAN}: no plan for seed {NO_PLAN}")
    assert found.returns == {4: pytest.approx(float(np.sum(episode.rewards))), NO_PLAN: 0}
    positions = evaluate("expert", TASK, [4], executor=Here(), control_mode="pd_joint_pos")
    assert positions.lengths == {4: 24}


def test_success_ends_an_episode():
    found = evaluate("expert", "PushCube-v1", [0], executor=Here())
    plan = find_expert("PushCube-v1")(tasks.make("PushCube-v1"), 0)
    assert found.successes == {0: True}
    assert 0 < found.lengths[0] <= len(plan)


@pytest.mark.parametrize(
    ("policy", "task", "seeds", "making", "error", "complaint"),
    [
        (still, "PushX-v1", [0], {}, UnknownNameError, "Did you mean 'PushT-v1'?"),
        (still, TASK, [0], {"obs_mod": "x"}, UnknownNameError, "Did you mean 'obs_mode'?"),
        (still, TASK, [0], {"num_envs": 0}, TaskError, "num_envs is 0; it must be an integer of 1"),
        (still, TASK, [], {}, TaskError, "no seeds were given; an evaluation plays one or m"),
        (still, TASK, [1, 2, 1], {}, TaskError, "seed 1 is there twice; each episode is played o"),
        (still, TASK, 5, {}, TaskError, "seeds is 5; it takes a sequence of integers"),
        (still, TASK, [0.5], {}, TaskError, r"seeds is \[0.5\]; it takes a sequence of integers"),
        (still, TASK, [-1], {}, TaskError, r"seed -1 must lie from 0 to 2\*\*32 - 1"),
        ("exprt", TASK, [0], {}, TaskError, "policy is 'exprt'; it must be MODULE:NAME, ws://H"),
        (fails, TASK, [7], {}, WorkerError, "seed 7: KeyError: 'no such key' .*policies.py:"),
        (
            lambda obs: obs,
            TASK,
            [7],
            {},
            WorkerError,
            "cannot be sent .*a policy must be def.* workers=0",
        ),
    ],
)
def test_what_cannot_be_evaluated(policy, task, seeds, making, error, complaint):
    with pytest.raises(error, match=complaint):
        evaluate(policy, task, seeds, executor=ProcessExecutor(1), **making)


def test_the_command(capsys):
    words = ["evaluate", f"--task={TASK}", "--episodes=2", "--seed=3", "--workers=1"]
    assert main([*words, "--policy=tests.data.policies:still"]) == 0
    printed = capsys.readouterr().out
    assert printed == f"{evaluate(still, TASK, [3, 4], executor=Here())}\n"
    assert re.match(r"PushT-v1, still: 0 of 2 episodes with success \(0.0%\)\non av", printed)
    assert main([*words, "--policy=tests.data.policies:stil"]) == 1
    assert "no policy 'tests.data.policies:stil': module" in capsys.readouterr().err


TWO_IN_ONE_PLACE = Layout(
    {
        "left": Placement("panda", position=(0.0, 0.0, 0.0)),
        "right": Placement("panda", position=(0.02, 0.0, 0.0)),
    }
)


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_physics_that_diverges_ends_an_episode_as_a_failure(tmp_path):
    making = {"layout": TWO_IN_ONE_PLACE, "check_layout": False}
    found = evaluate(
        lambda obs: np.zeros(16),
        "TwoRobotPickCube-v1",
        [0, 1],
        workers=0,
        receipt=tmp_path / "receipt.json",
        **making,
    )
    assert found.successes == {0: False, 1: False}
    for reason in found.reasons.values():
        assert re.match(r"physics diverged: robot '(left|right)' is thrown about", reason)
    assert Receipt.read(tmp_path / "receipt.json").episodes[1].reason == found.reasons[1]


@dataclass
class Hurries:
    """Moves faster and faster, up to a speed that each seed has."""

    fastest: float | None = None
    speed: float = 0.0

    def __call__(self, obs):
        self.fastest = self.fastest or random.uniform(0.1, 0.9)
        self.speed = min(self.speed + 0.02, self.fastest)
        return np.full(ACTIONS, self.speed)


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_what_diverges_costs_no_other_episode(monkeypatch, tmp_path):
    """Any speed is called divergence here that some seeds reach, and others do not."""
    untouched = evaluate(Hurries(), TASK, range(6), workers=0)
    monkeypatch.setattr("tasks.engine.divergence.WARNS", 0.14)
    monkeypatch.setattr("tasks.engine.divergence.REFUSES", 0.14)
    alone = evaluate(Hurries(), TASK, range(6), workers=0)
    assert 0 < len(alone.reasons) < 6
    for seed in range(6):
        if seed in alone.reasons:
            assert 0 < alone.lengths[seed] < untouched.lengths[seed]
        else:
            assert alone.scores[seed] == untouched.scores[seed]
    receipt = tmp_path / "receipt.json"
    together = evaluate(Hurries(), TASK, range(6), workers=0, num_envs=3, receipt=receipt)
    assert together.scores == alone.scores
    assert verify(receipt, InProcessExecutor(), policy=Hurries()).equal
    summary = record(TASK, range(6), tmp_path / "recorded", policy=Hurries(), workers=0)
    assert {*summary.failed} == {*alone.reasons}

"""The example that learns with Stable-Baselines3."""

import json
import pickle
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")
pytest.importorskip("matplotlib")

import tasks
from robot_layouts.data import evaluate
from robot_layouts.data.playing.policies import find_policy
from robots import TaskError
from tests.examples.learning import assert_same, examples, finish, kill_while_it_learns, start

__all__ = ["examples"]

WORDS = ["--steps", "600", "--envs", "2", "--every", "1", "--tests", "1"]
FILES = ["curve.json", "curve.png", "settings.json"]
CHECKPOINTS = [f"checkpoint-000{number}" for number in range(4)]


@pytest.fixture
def ppo(examples):
    import ppo_two_arms

    return ppo_two_arms


def state(folder):
    """Return all that a checkpoint holds and that later ones depend on."""
    from stable_baselines3 import PPO

    parameters = PPO.load(folder / "policy.zip", device="cpu").get_parameters()
    known = pickle.loads((folder / "normalization.pkl").read_bytes())
    return {
        "policy": dict(parameters["policy"]),
        "optimizer": parameters["policy.optimizer"]["state"],
        "mean": known.obs_rms.mean,
        "var": known.obs_rms.var,
    }


def last(folder):
    return state(folder / CHECKPOINTS[-1])


@pytest.mark.long
def test_a_run_leaves_checkpoints_and_its_curve(ppo, tmp_path, capsys):
    assert ppo.run([*WORDS, "--workers", "0", "--out", str(tmp_path / "run")]) == 1
    assert sorted(path.name for path in (tmp_path / "run").iterdir()) == CHECKPOINTS + FILES
    curve = json.loads((tmp_path / "run" / "curve.json").read_text())
    assert [point["steps"] for point in curve] == [200, 400, 600]
    assert all(0 < point["reward"] < 0.1 for point in curve)
    assert [point["seconds"] for point in curve] == sorted({p["seconds"] for p in curve})
    printed = capsys.readouterr()
    assert printed.err.count("while learning") == 3
    assert "0% of 1 test episodes succeed" in printed.out


@pytest.mark.long
def test_a_killed_run_and_another_have_the_same_weights(ppo, tmp_path):
    process = start("ppo_two_arms", tmp_path / "killed", *WORDS, "--workers", "1")
    kill_while_it_learns(process, tmp_path / "killed", 1)
    printed = finish(start("ppo_two_arms", tmp_path / "killed", *WORDS, "--workers", "1"))
    assert printed.count("while learning") == 2  # of three: it did not begin anew
    assert not list((tmp_path / "killed").glob("*.partial"))
    ppo.run([*WORDS, "--workers", "0", "--out", str(tmp_path / "whole")])
    assert_same(last(tmp_path / "killed"), last(tmp_path / "whole"))


def test_a_run_goes_on_only_as_it_began(ppo, tmp_path, capsys):
    ppo.run([*WORDS, "--steps", "200", "--workers", "0", "--out", str(tmp_path)])
    assert ppo.run([*WORDS, "--workers", "0", "--out", str(tmp_path)]) == 1
    assert "holds a run with steps 200, and this one has 600" in capsys.readouterr().err
    assert not (tmp_path / CHECKPOINTS[2]).exists()


def test_what_was_learned_is_a_policy_by_name(ppo, tmp_path, monkeypatch):
    ppo.run([*WORDS, "--steps", "200", "--workers", "0", "--out", str(tmp_path)])
    policy = find_policy("ppo_two_arms:policy")
    assert policy.folder == Path("runs/ppo_two_arms")
    policy = ppo.LearnedPolicy(tmp_path, policy.names, policy.load)
    assert all(path.is_file() for path in policy.files)
    making = {"control_mode": "pd_ee_delta_pos"}
    scores = evaluate(policy, "TwoRobotPickCube-v1", [5, 6], workers=0, num_envs=2, **making).scores
    env = tasks.make("TwoRobotPickCube-v1", **making)
    obs, _ = env.reset(seed=5)
    total, action = 0.0, policy(obs)
    assert action.shape == (8,)
    assert (np.abs(action) <= 1).all()
    for _ in range(100):
        obs, reward, _, _, _ = env.step(policy(obs)[None])
        total += reward.item()
    assert scores[5].total == pytest.approx(total)


def test_a_folder_without_checkpoints_is_named(ppo, tmp_path):
    with pytest.raises(TaskError) as raised:
        ppo.LearnedPolicy(tmp_path, ppo.FILES, ppo._loaded)(np.zeros((1, 66), np.float32))
    assert str(raised.value) == f"{tmp_path} holds no checkpoint; a run leaves some there"

"""The Python of README.md runs as it stands, but for the length of what takes minutes."""

import importlib
import sys

import gymnasium
import pytest
import torch
from gymnasium.utils.env_checker import check_env

import tasks
from tasks.registry import TASKS
from tests.docs.blocks import ROOT, blocks, play_apart

README = ROOT / "README.md"
PYTHON = [block.code for block in blocks(README) if block.language == "python"]
(DECLARED,) = [code for code in PYTHON if "register_task" in code]


@pytest.mark.long
def test_it_runs(tmp_path):
    done = play_apart(README, tmp_path)
    assert done.returncode == 0, done.stderr


def test_a_newcomer_reads_it_in_three_minutes():
    assert len(README.read_text(encoding="utf-8").splitlines()) <= 150


def test_a_task_of_ones_own_is_short():
    assert len(DECLARED.splitlines()) <= 45


@pytest.fixture
def env(tmp_path, monkeypatch):
    """Three environments of the task that README declares, in a file of one's own."""
    (tmp_path / "tray.py").write_text(DECLARED, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    importlib.import_module("tray")
    made = tasks.make("TwoArmTray-v1", num_envs=3)
    yield made
    made.close()
    sys.modules.pop("tray")
    TASKS.registered.pop("TwoArmTray-v1")
    gymnasium.registry.pop("RobotLayouts/TwoArmTray-v1")


def test_a_task_in_a_file_of_ones_own_runs(env, monkeypatch):
    env.reset(seed=0)
    for _ in range(20):
        obs, reward, terminated, _, info = env.step(env.action_space.sample())
    assert obs.shape == (3, 49)
    assert obs.isfinite().all()
    assert ((reward > 0) & (reward < 1) & ~info["held"] & ~terminated).all()

    state = env.get_state_dict()
    held = state["actors"]["tray"]
    held[:, :3] = torch.tensor([0.0, 0.0, 0.3])  # high, and level in the first alone
    held[:, 3:7] = torch.tensor([1.0, 0.0, 0.0, 0.0])
    held[1, 3:7] = torch.tensor([0.9, 0.0, 0.43588989, 0.0])
    env.set_state_dict(state)
    seen = env.simulation.read()
    monkeypatch.setattr(type(seen), "is_grasping", lambda seen, *_, **__: seen.full(True))
    assert env.evaluate(seen)["success"].tolist() == [True, False, True]
    reward = env.dense_reward(seen, None, env.evaluate(seen))
    assert reward[0] == 4
    assert 2 < reward[1] < 4
    monkeypatch.undo()
    check_env(gymnasium.make("RobotLayouts/TwoArmTray-v1").unwrapped, skip_render_check=True)

"""The Python of README.md runs as it stands, but for the length of what takes minutes."""

import subprocess
import sys

import pytest

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


def test_a_task_in_a_file_of_ones_own_runs(tmp_path):
    (tmp_path / "tray.py").write_text(DECLARED, encoding="utf-8")
    script = tmp_path / "script.py"
    script.write_text(USES_THE_TRAY, encoding="utf-8")
    done = subprocess.run(
        [sys.executable, str(script)], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


USES_THE_TRAY = """
import gymnasium, torch
import tasks, tray
from gymnasium.utils.env_checker import check_env

env = tasks.make("TwoArmTray-v1", num_envs=3)
env.reset(seed=0)
for _ in range(20):
    obs, reward, terminated, truncated, info = env.step(env.action_space.sample())
assert obs.shape == (3, 49) and obs.isfinite().all()
assert ((reward > 0) & (reward < 1) & ~info["held"] & ~terminated).all()

state = env.get_state_dict()
held = state["actors"]["tray"]
held[:, :3] = torch.tensor([0.0, 0.0, 0.3])  # high, and level in the first alone
held[:, 3:7] = torch.tensor([1.0, 0.0, 0.0, 0.0])
held[1, 3:7] = torch.tensor([0.9, 0.0, 0.43588989, 0.0])
env.set_state_dict(state)
seen = env.simulation.read()
type(seen).is_grasping = lambda self, robot, body, max_angle=None: self.full(True)
assert env.evaluate(seen)["success"].tolist() == [True, False, True]
reward = env.dense_reward(seen, None, env.evaluate(seen))
assert reward[0] == 4 and 2 < reward[1] < 4

check_env(gymnasium.make("RobotLayouts/TwoArmTray-v1").unwrapped, skip_render_check=True)
"""

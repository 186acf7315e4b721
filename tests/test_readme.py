"""The Python of README.md runs as it stands, but for the length of what takes minutes."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

README = Path(__file__).parents[1] / "README.md"
BLOCKS = re.findall(r"```python\n(.*?)```", README.read_text(encoding="utf-8"), flags=re.DOTALL)
GUARDED = [block for block in BLOCKS if "__main__" in block]  # those that start processes
PLAIN = [block for block in BLOCKS if "__main__" not in block]
SHORTER = {"learn(100_000)": "learn(1)", "range(100)": "range(2)", "num_envs=64": "num_envs=4"}


def run(code: str, folder: Path) -> subprocess.CompletedProcess[str]:
    for long, short in SHORTER.items():
        code = code.replace(long, short)
    script = folder / "script.py"
    script.write_text(code, encoding="utf-8")
    command = [sys.executable, str(script)]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


def test_nothing_that_is_made_shorter_is_missing():
    assert all(any(long in block for block in BLOCKS) for long in SHORTER)


@pytest.mark.long
@pytest.mark.native  # because of the cameras
def test_what_builds_on_each_other_runs(tmp_path):
    done = run("\n".join(PLAIN), tmp_path)
    assert done.returncode == 0, done.stderr
    assert {"cell.png", "cell.yaml", "cell.urdf", "check.png"} <= {
        p.name for p in tmp_path.iterdir()
    }


@pytest.mark.long
@pytest.mark.parametrize("block", GUARDED)
def test_what_starts_processes_runs(block, tmp_path):
    done = run("import tasks\n" + block, tmp_path)
    assert done.returncode == 0, done.stderr


(DECLARED,) = [block for block in PLAIN if "register_task" in block]


def test_a_task_of_ones_own_is_short():
    assert len(DECLARED.splitlines()) <= 45


def test_a_task_in_a_file_of_ones_own_runs(tmp_path):
    (tmp_path / "tray.py").write_text(DECLARED, encoding="utf-8")
    done = run(USES_THE_TRAY, tmp_path)
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

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

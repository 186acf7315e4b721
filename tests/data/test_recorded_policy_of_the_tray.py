"""The tutorial's policy records the tutorial's task, which no package lists, whatever happens."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from robot_layouts.data.reading.recording import Recording
from tests.data.test_record import wait_for_parts, wait_until_nobody_is_left
from tests.data.test_recorder import same_files

ROOT = Path(__file__).parents[2]
TUTORIALS = ROOT / "docs" / "tutorials"
FILE = "trajectory.h5"
TASK = "tray:TwoArmTray-v1"
POLICY = ["--policy=carry:carry", "--obs-mode=state_dict", "--control-mode=pd_ee_delta_pos"]


def command(*words: str) -> subprocess.Popen[str]:
    paths = os.pathsep.join([str(ROOT), str(TUTORIALS)])
    return subprocess.Popen(
        [sys.executable, "-m", "robot_layouts", *words],
        env={**os.environ, "PYTHONPATH": paths},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )


def finished(*words: str) -> str:
    process = command(*words)
    printed, _ = process.communicate(timeout=300)
    assert process.returncode == 0, printed
    return printed


def record(out: Path, episodes: int, *words: str) -> list[str]:
    return ["record", f"--task={TASK}", *POLICY, f"--episodes={episodes}", f"--out={out}", *words]


@pytest.mark.long
def test_it_is_killed_goes_on_and_replays(tmp_path):
    killed = command(*record(tmp_path / "killed", 16, "--workers=2", "--num-envs=2"))
    wait_for_parts(tmp_path / "killed", 3)
    os.killpg(killed.pid, signal.SIGKILL)
    killed.communicate()
    wait_until_nobody_is_left(killed)
    left = len(list((tmp_path / "killed" / "trajectory.parts").iterdir()))
    assert 3 <= left < 16
    printed = finished(*record(tmp_path / "killed", 16, "--workers=1", "--num-envs=7"))
    assert "of 16 episodes were recorded before" in printed
    assert f"{16 - left} new episodes, {16 - left} with success" in printed
    finished(*record(tmp_path / "whole", 16, "--workers=0"))
    assert same_files(tmp_path / "killed" / FILE, tmp_path / "whole" / FILE)
    with Recording(tmp_path / "whole" / FILE) as file:
        assert all(episode.solved for episode in file)
        assert {episode.source["name"] for episode in file} == {"carry:carry"}
    printed = finished("replay", str(tmp_path / "killed"), f"--task={TASK}")
    assert "in 16 all states are equal to the last bit" in printed

"""What datasets cost is measured on real ones, and a large one goes on where it was stopped."""

import json

import pytest

from measurements.datasets import large
from measurements.datasets.__main__ import main
from rollouts.playing.in_process import InProcessExecutor
from tasks import Randomization

TASK = "TwoRobotPickCube-v1"


def test_the_five_axes_are_axes():
    assert len(Randomization.from_json(large.FIVE).declared) == 5


@pytest.mark.long
def test_memory_of_copies(tmp_path, capsys):
    record = tmp_path / "record.json"
    words = ["memory", "--episodes=40", "--file-size=0.3", f"--record={record}"]
    assert main(words) == 0
    assert "40 episodes" in capsys.readouterr().out
    assert set(json.loads(record.read_text())[f"memory {TASK}"]) == {"text", "bytes_per_episode"}


@pytest.mark.long
def test_costs(tmp_path, capsys):
    assert main(["bench", "--episodes=3", "--workers=1", "--varied"]) == 0
    printed = capsys.readouterr().out
    assert "3 equal" in printed
    assert "100,000 would take" in printed


@pytest.mark.long
def test_a_large_one_goes_on(tmp_path):
    said: list[str] = []
    for episodes in (2, 3):
        found = large.make_large(
            tmp_path,
            ["FourRobotStack-v1"],
            episodes,
            [0],
            InProcessExecutor,
            clips=0,
            say=said.append,
        )
    assert found["FourRobotStack-v1/layout_0"]["equal"] == 3
    assert found["FourRobotStack-v1/layout_0"]["recorded_now"] == 1
    folder = tmp_path / "FourRobotStack-v1" / "layout_0"
    assert "bases/south/yaw" in (folder / "report.html").read_text()
    assert json.loads((folder / "certificate.json").read_text())["holds"]

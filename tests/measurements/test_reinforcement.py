"""What is kept of runs of reinforcement."""

import json
from pathlib import Path
from shutil import copy

import pytest

pytest.importorskip("matplotlib")

from measurements.reinforcement import PAGE

ANY_RECEIPT = (
    Path(__file__).parents[2] / "docs" / "receipts" / "imitation" / "TwoRobotPickCube-v1.json"
)
SETTINGS = {"task": "TwoRobotPickCube-v1", "steps": 20_000, "torchrl": "0.13.3"}
POINT = {"seconds": 1800.0, "reward": 0.5, "learning_success": 0.1}


def test_a_run_is_added_as_far_as_it_has_come(tmp_path):
    run, out = tmp_path / "run", tmp_path / "record.json"
    (run / "checkpoint-0002").mkdir(parents=True)
    (run / "settings.json").write_text(json.dumps(SETTINGS))
    curve = [{**POINT, "steps": steps, "success": share} for steps, share in ((5, 0), (9, 0.5))]
    (run / "checkpoint-0002" / "curve.json").write_text(json.dumps(curve))
    copy(ANY_RECEIPT, run / "receipt.json")
    assert PAGE.main([str(run), "--out", str(out)]) == 0
    row = "PickCube-v1, MAPPO | torchrl 0.13.3 | 9 of 20,000 | 0.5 | 100 | 95 (88.8 to 97.8) |"
    assert row in out.with_suffix(".md").read_text()
    assert out.with_suffix(".png").read_bytes().startswith(b"\x89PNG")


def test_folders_that_hold_no_run(tmp_path, capsys):
    out = ["--out", str(tmp_path / "record.json")]
    assert PAGE.main([str(tmp_path), *out]) == 1
    assert "settings.json cannot be read" in capsys.readouterr().err
    (tmp_path / "settings.json").write_text("{}")
    assert PAGE.main([str(tmp_path), *out]) == 1
    assert "holds no run of PPO or MAPPO" in capsys.readouterr().err
    assert not (tmp_path / "record.json").exists()

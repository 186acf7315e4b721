"""The example that trains with Stable-Baselines3."""

import json
import os
import subprocess
import sys

import pytest

pytest.importorskip("stable_baselines3")
pytest.importorskip("matplotlib")

from tests.examples.learning import EXAMPLES, ROOT, loaded

EXAMPLE = EXAMPLES / "ppo_push_cube.py"
FILES = ["learning_curve.json", "learning_curve.png", "normalization.pkl", "policy.zip"]


@pytest.fixture(scope="module")
def example():
    with loaded("ppo_push_cube") as module:
        yield module


@pytest.mark.filterwarnings("ignore:You have specified a mini-batch size")
def test_a_short_run_leaves_its_files(example, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(example, "EXAMINED_EVERY", 100)
    words = ["--steps", "150", "--envs", "4", "--tests", "2", "--workers", "0", "--seed", "3"]
    assert example.main([*words, "--out", str(tmp_path / "run")]) == 1
    assert sorted(path.name for path in (tmp_path / "run").iterdir()) == FILES
    numbers = json.loads((tmp_path / "run" / "learning_curve.json").read_text())
    assert [found["steps"] for found in numbers["curve"]] == [0, 100, 200]
    assert all(0 < found["reward"] < 1 for found in numbers["curve"])
    assert numbers["test_seeds"] == [1_000_000, 1_000_001]
    said = capsys.readouterr()
    assert said.err.count("success") == 3
    assert "0% of 2 test episodes succeed" in said.out


def test_what_it_cannot_do_is_said(example, tmp_path, capsys):
    assert example.main(["--envs", "2", "--workers", "3", "--out", str(tmp_path)]) == 1
    assert "error: num_workers is 3" in capsys.readouterr().err


@pytest.mark.long
def test_it_learns(tmp_path):
    words = ["--steps", "40000", "--tests", "20", "--workers", "2", "--out", str(tmp_path)]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run([sys.executable, str(EXAMPLE), *words], env=environment, check=False)
    assert done.returncode in (0, 1)  # 1: it has not learned enough yet
    curve = json.loads((tmp_path / "learning_curve.json").read_text())["curve"]
    assert curve[-1]["reward"] > 2 * curve[0]["reward"]


def test_the_picture_in_the_documentation_is_of_this_example(example):
    """Its numbers lie beside it, from a run with these very hyperparameters."""
    assert (ROOT / "docs" / "ppo_push_cube.png").stat().st_size < 150_000
    numbers = json.loads((ROOT / "docs" / "ppo_push_cube.json").read_text())
    rate = {"learning_rate": example.LEARNING_RATE}
    assert numbers["hyperparameters"] == {**rate, **example.HYPERPARAMETERS}
    assert numbers["curve"][-1]["success"] >= 0.9

"""The example that learns with torchrl, in an environment of its own; see tests/clients."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
import torch

from tests.clients.environments import new_environment
from tests.examples.learning import (
    ENVIRONMENT,
    ROOT,
    assert_same,
    finish,
    kill_while_it_learns,
    start,
)

pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(sys.version_info < (3, 11), reason="torchrl.txt needs Python 3.11"),
]

WORDS = ["--steps", "600", "--envs", "2", "--every", "1", "--tests", "1"]
PROGRAM = Path(__file__).parent / "mappo_program.py"


@pytest.fixture(scope="module")
def python(tmp_path_factory):
    requirements = ROOT / "tests" / "clients" / "requirements" / "torchrl.txt"
    return new_environment(tmp_path_factory.mktemp("torchrl") / "environment", requirements)


@pytest.fixture(scope="module")
def whole(python, tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs") / "whole"
    printed = finish(start("mappo_two_arms", folder, *WORDS, "--workers", "0", python=python))
    assert "0% of 1 test episodes succeed" in printed
    return folder


def state(folder, number=3):
    return torch.load(folder / f"checkpoint-{number:04d}" / "policy.pt", weights_only=True)


def test_it_leaves_checkpoints_and_its_curve(whole):
    curve = json.loads((whole / "curve.json").read_text())
    assert [point["steps"] for point in curve] == [200, 400, 600]
    assert all(0 < point["reward"] < 0.1 for point in curve)
    assert (whole / "curve.png").stat().st_size > 10_000


def test_a_killed_run_and_another_have_the_same_weights(python, whole, tmp_path):
    words = [*WORDS, "--workers", "1"]
    process = start("mappo_two_arms", tmp_path, *words, python=python)
    kill_while_it_learns(process, tmp_path, 1)
    printed = finish(start("mappo_two_arms", tmp_path, *words, python=python))
    assert printed.count("while learning") == 2  # of three: it did not begin anew
    assert_same(state(tmp_path), state(whole))


def test_an_agent_acts_by_what_it_observes(python, whole, tmp_path):
    """A program beside this file asks torchrl's own checks, PettingZoo and the actors."""
    command = [python, PROGRAM, whole]
    done = subprocess.run(command, env=ENVIRONMENT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr

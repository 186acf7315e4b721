"""Policies may observe pictures of any size, also from the command line."""

import pytest

from robot_layouts.__main__ import main

LOOKS = """
import numpy as np


def policy(observation):
    assert observation["sensor_data"]["base_camera"]["rgb"].shape == (1, 12, 16, 3)
    return np.zeros(8, np.float32)
"""
WORDS = ["--task", "PushCube-v1", "--policy", "looks:policy", "--obs-mode", "rgb"]
WORDS += ["--episodes", "1", "--workers", "0"]


@pytest.fixture(autouse=True)
def looks(tmp_path, monkeypatch, renderer):
    if renderer is None:
        pytest.skip("there is no Vulkan driver to draw pictures with")
    (tmp_path / "looks.py").write_text(LOOKS)
    monkeypatch.syspath_prepend(tmp_path)


@pytest.mark.long
def test_evaluate(capsys):
    assert main(["evaluate", *WORDS, "--camera-size", "16x12"]) == 0
    assert "0 of 1 episodes with success" in capsys.readouterr().out


@pytest.mark.long
def test_record(tmp_path, capsys):
    out = tmp_path / "data"
    assert main(["record", *WORDS, "--camera-size", "16x12", "--out", str(out)]) == 0
    assert (out / "trajectory.h5").exists()


def test_a_size_that_is_none(capsys):
    with pytest.raises(SystemExit):
        main(["evaluate", *WORDS, "--camera-size", "large"])
    assert "'large' is no size; it is WxH, as 128x96" in capsys.readouterr().err

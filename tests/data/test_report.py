"""The report of a dataset says what is in its files, and needs nothing else."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import tasks
from robot_layouts.__main__ import main
from robot_layouts.data.dataset.contents import chosen_places, measure, read_contents
from robot_layouts.data.dataset.report import make_report
from robot_layouts.data.playing.replay import open_recording
from robot_layouts.data.reading.recorded_task import task_for
from robot_layouts.data.recording.recorder import Recorder
from robots import RobotLayoutsError
from tests.data.test_recorder import short_episode

COUNT = 6
POLICY = {"kind": "policy", "name": "mine:policy", "sha256": None}


@pytest.fixture(scope="module")
def recorded(tmp_path_factory) -> Path:
    """Two arms; two sources; a mass that is said to be varied; one episode that succeeded."""
    env = tasks.make("TwoRobotPickCube-v1", obs_mode="none")
    path = tmp_path_factory.mktemp("data <set>") / "trajectory.h5"
    with Recorder(path, env, file_size=0.02, source_desc="ann") as recorder:
        for seed in range(COUNT):
            episode = short_episode(env, seed, 2 + seed)
            drawn = {"mass": {"cube": 1 + seed / 10}, "bases": {"left": {"x": -0.01}}}
            success = np.full(2 + seed, seed == 4)
            source = POLICY if seed % 3 == 0 else None
            recorder.add(replace(episode, drawn=drawn, success=success, source=source))
    return path.parent


def test_the_contents_are_read_from_all_files(recorded):
    found = read_contents(recorded)
    assert len(found.files) > 1
    assert found.steps.tolist() == [2 + seed for seed in range(COUNT)]
    assert found.success.tolist() == [seed == 4 for seed in range(COUNT)]
    assert {name: facts.episodes for name, facts in found.sources.items()} == {
        "policy mine:policy": 2,
        "scripted ann": 4,
    }
    np.testing.assert_allclose(found.drawn["mass/cube"], 1 + np.arange(COUNT) / 10)
    assert set(found.drawn) == {"mass/cube", "bases/left/x"}


def test_clips_are_of_episodes_that_differ(recorded):
    found = chosen_places(read_contents(recorded), 4)
    assert list(found) == [0, 5, 3, 1]
    assert found[5] == "the longest"


def test_the_page(recorded, tmp_path, capsys):
    page = tmp_path / "page.html"
    assert main(["certify", str(recorded), "--workers=0"]) == 1  # successes were made up
    words = ["report", str(recorded), f"--out={page}", "--clips=0", "--clearances=2"]
    assert main(words) == 0
    assert re.search(rf"{page}: \d+\.\d kB", capsys.readouterr().out)
    text = page.read_text()
    assert "data &lt;set&gt;" in text
    assert "<set>" not in text
    for expected in ("16.7%", "policy mine:policy", "mass/cube", "0 of 6", "trajectory_0001.h5"):
        assert expected in text, expected
    assert "in a sample of 2 episodes" in text
    assert not re.search(r'(src|href)="(?!data:)', text)
    assert not re.search(r"url\(", text)


def test_clearances_are_those_of_the_states(recorded):
    with open_recording(recorded, None) as file:
        task = task_for(file)
        found = measure(file, task, [0, 3])
        task.close()
    assert found is not None
    assert found.places == [0, 3]
    assert (np.abs(found.least - 0.15) < 0.03).all()  # m; hands that face each other at rest


def test_one_robot_has_no_clearance(tmp_path):
    env = tasks.make("PushT-v1")
    with Recorder(tmp_path / "trajectory.h5", env) as recorder:
        recorder.add(short_episode(env, 0))
    page = tmp_path / "page.html"
    assert main(["report", str(tmp_path), f"--out={page}", "--clips=0"]) == 0
    assert "Clearance" not in page.read_text()


def test_a_recording_without_episodes(tmp_path):
    Recorder(tmp_path / "trajectory.h5", tasks.make("PushT-v1")).close()
    with pytest.raises(RobotLayoutsError, match="holds no episodes; there is nothing to report"):
        make_report(tmp_path)

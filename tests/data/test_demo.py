"""`python -m robot_layouts demo` from end to end."""

import json
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
from rich.console import Console

import robot_layouts.data.demo as demo
from robot_layouts.__main__ import main
from robot_layouts.data.demo import DemoOptions, run_demo
from robot_layouts.data.video import film, video_problem
from robot_layouts.experts.rehearsal import Plan
from robots import AssetError, TaskError, UrdfLocator
from tests.data.hand_overs import TASK, plan, task


@pytest.fixture
def console() -> Console:
    return Console(record=True, width=200, force_terminal=False)


def test_the_command_plays_records_and_reports(tmp_path, capsys):
    assert main(["demo", "--seeds", "2", "--no-video", "--out", str(tmp_path)]) == 0
    printed = capsys.readouterr().out
    for text in (
        f"{TASK}, 2 seeds",
        "action split: left = [0:8], right = [8:16]",
        "seed   0  success",
        "seed   1  success",
        "2 of 2 succeeded",
        "steps per second while playing",
        "no video: not asked for",
    ):
        assert text in printed
    with h5py.File(tmp_path / "trajectory.h5") as file:
        np.testing.assert_array_equal(file["traj_1/actions"], plan(1))
    assert len(json.loads((tmp_path / "trajectory.json").read_text())["episodes"]) == 2
    assert not (tmp_path / "video.mp4").exists()


@pytest.mark.long
def test_the_demo_may_be_run_again(tmp_path, console):
    for _ in range(2):
        assert run_demo(DemoOptions(seeds=1, out=tmp_path, no_video=True), console)


def test_a_failure_is_named_with_its_reason(tmp_path, monkeypatch, capsys):
    def fails(task, seed):
        if seed == 1:
            raise TaskError("no plan: left.ready is out of reach")
        given = np.zeros((2, 16), np.float32).view(Plan)
        given.reason = "the episode ended at left.grasp cube"
        return given

    monkeypatch.setattr(demo, "find_expert", lambda name: fails)
    assert main(["demo", "--seeds", "2", "--no-video", "--out", str(tmp_path)]) == 1
    printed = capsys.readouterr().out
    assert "seed   0  failure    2 steps  the episode ended at left.grasp cube\n" in printed
    assert "seed   1  failure    0 steps  no plan: left.ready is out of reach\n" in printed
    (episode,) = json.loads((tmp_path / "trajectory.json").read_text())["episodes"]
    assert episode["reason"] == "the episode ended at left.grasp cube"


def test_where_nothing_can_be_drawn_one_line_says_so(tmp_path, monkeypatch, console):
    monkeypatch.setattr(
        demo, "video_problem", lambda simulator: "no usable Vulkan driver (none found)"
    )
    assert run_demo(DemoOptions(seeds=1, out=tmp_path), console)
    assert "no video: no usable Vulkan driver (none found)\n" in console.export_text()


@pytest.mark.long
def test_without_visual_meshes_one_line_says_so(tmp_path, monkeypatch, console):
    locate = UrdfLocator.locate

    def no_pictures(self: UrdfLocator, *, pictures: bool = False) -> Path:
        if pictures:
            raise AssetError("11 robot files cannot be used\n  sources tried: …")
        return locate(self)

    monkeypatch.setattr(demo, "video_problem", lambda simulator: None)
    monkeypatch.setattr(UrdfLocator, "locate", no_pictures)
    assert run_demo(DemoOptions(seeds=1, out=tmp_path), console)
    printed = console.export_text()
    assert "no video: the robots' visual meshes are missing: 11 robot files cannot be" in printed
    assert "sources tried" not in printed


def test_without_matplotlib_one_line_says_so(tmp_path, monkeypatch, console):
    for name in [name for name in sys.modules if name.partition(".")[0] == "matplotlib"]:
        monkeypatch.setitem(sys.modules, name, None)
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    assert run_demo(DemoOptions(seeds=1, out=tmp_path, no_video=True), console)
    assert "no picture of the layout: " in console.export_text()
    assert not (tmp_path / "layout.png").exists()


def test_a_task_without_an_expert_is_an_error(capsys):
    assert main(["demo", "--task", "TwoRobotPickCub", "--no-video"]) == 2
    assert "Did you mean 'TwoRobotPickCube-v1'" in capsys.readouterr().err


@pytest.mark.long
def test_a_video_shows_the_episodes(tmp_path, renderer):
    if problem := video_problem("sapien3"):
        pytest.skip(problem)
    import imageio.v3 as imageio

    import tasks
    from tasks.episode import play

    env = tasks.make(TASK, render_mode="rgb_array")
    episodes = [play(task(), seed, plan(seed)[:3]) for seed in (0, 1)]
    assert film(env, episodes, tmp_path / "two.mp4") == 2
    frames = imageio.imread(tmp_path / "two.mp4")
    assert frames.shape == (2 * (3 + 1 + 12), 512, 512, 3)
    assert frames[0].std() > 20
    assert [path.name for path in tmp_path.iterdir()] == ["two.mp4"]

    assert film(env, episodes, tmp_path / "one.mp4", seconds=0.0) == 1  # at least the first

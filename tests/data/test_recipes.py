"""A recipe makes the same bytes again, and refuses what is none."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import yaml

import robot_layouts.data as data
from robot_layouts.__main__ import main
from robot_layouts.data.recipe import load_recipe, recipe_text
from robot_layouts.experts import register_expert
from robots import TaskError
from tasks import Randomization
from tests.data.plays import at_random

TASK, TWO = "PushT-v1", "TwoRobotPickCube-v1"
ROOT = Path(__file__).parents[2]
VARIED = Randomization(mass={"*": {"uniform": [0.5, 2.0]}})


@pytest.fixture(autouse=True)
def cheap_expert(monkeypatch):
    from robot_layouts.experts import registry

    monkeypatch.setattr(registry.EXPERTS, "registered", dict(registry.EXPERTS.registered))
    register_expert(TASK, at_random)
    register_expert(TWO, at_random)


def contents(folder: Path) -> dict[str, bytes]:
    files = [path for path in folder.rglob("*") if path.is_file()]
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


def record(folder: Path, task: str = TASK, **making) -> Path:
    data.record(task, range(4, 7), folder, workers=0, **making)
    return folder


def build(recipe: Path, out: Path, *words: str) -> int:
    return main(["data", "build", str(recipe), "--out", str(out), "--workers", "0", *words])


def written(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    ("task", "making"),
    [
        (TASK, {}),
        (TASK, {"obs_mode": "state_dict", "randomization": VARIED, "max_episode_steps": 50}),
        (TWO, {"robots": {"right": "panda_stick"}, "control_mode": "pd_joint_pos"}),
        (TASK, {"policy": "tests.data.served:leans", "observations": False, "obs_mode": "state"}),
    ],
)
def test_the_recipe_of_a_recording_makes_its_bytes_again(tmp_path, capsys, task, making):
    there = record(tmp_path / "there", task, **making)
    recipe = tmp_path / "recipe.yaml"
    words = ["--out", str(recipe), "--name", "again"]
    assert main(["data", "recipe", str(there), *words]) == 0
    assert build(recipe, tmp_path / "out") == 0
    assert "every file is that of the recipe, to the last bit" in capsys.readouterr().out
    assert contents(tmp_path / "out/again") == contents(there)


def test_other_bytes_are_named(tmp_path, capsys):
    recipe = tmp_path / "recipe.yaml"
    text = recipe_text(record(tmp_path / "there"), "again", tmp_path)
    about = yaml.safe_load(text)
    about["recordings"]["again"]["randomization"] = VARIED.to_json()
    about["made_with"]["numpy"] = "1.0"
    written(recipe, yaml.safe_dump(about))
    assert build(recipe, tmp_path / "out") == 1
    said = capsys.readouterr().err
    assert "is not what the recipe is of: trajectory.h5, trajectory.json differ" in said
    assert "the recipe was made with numpy 1.0, here " in said


def test_several_recordings_in_shards_and_their_exports(tmp_path):
    recipe = written(
        tmp_path / "recipe.yaml",
        f"""
recordings:
  pushes:
    task: {TASK}
    seeds: 0-3
    file_size: 0.03
    exports:
      table: {{format: lerobot, include_failures: true, fps: 10}}
  others: {{task: {TASK}, seeds: [7, 9]}}
""",
    )
    assert build(recipe, tmp_path / "out", "--only", "pushes") == 0
    assert {p.name for p in (tmp_path / "out").iterdir()} == {"pushes", "table"}
    assert (tmp_path / "out/pushes/trajectory_0001.h5").is_file()
    assert '"fps": 10' in (tmp_path / "out/table/meta/info.json").read_text()
    before = contents(tmp_path / "out")
    assert build(recipe, tmp_path / "out") == 0
    after = contents(tmp_path / "out")
    assert before.items() < after.items()
    assert build(recipe, tmp_path / "out", "--only", "pusches") == 2


@pytest.mark.long
def test_a_build_that_was_killed_goes_on(tmp_path):
    """A process is killed in the middle; run again, the same command makes the same bytes."""
    recipe = written(
        tmp_path / "recipe.yaml",
        f"recordings: {{pushes: {{task: {TASK}, seeds: 0-29, file_size: 0.1}}}}\n",
    )
    assert build(recipe, tmp_path / "whole") == 0
    out = tmp_path / "out"
    words = ["data", "build", str(recipe), "--out", str(out), "--workers", "0"]
    process = subprocess.Popen(
        [sys.executable, "-m", "tests.data.recording_process", *words],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        cwd=ROOT,
    )
    while not list(out.glob("pushes/trajectory.parts/*")) and process.poll() is None:
        time.sleep(0.01)
    process.send_signal(signal.SIGKILL)
    assert process.wait() == -signal.SIGKILL
    assert build(recipe, out) == 0
    assert contents(out) == contents(tmp_path / "whole")


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ("{seeds: 0-3}", "it: 'task' is missing"),
        ("{task: PushT-v1}", "it: 'seeds' is missing"),
        ("{task: PushTee-v1, seeds: 1}", "Did you mean 'PushT-v1'?"),
        ("{task: PushT-v1, seeds: 1, polcy: expert}", "Did you mean 'policy'?"),
        ("{task: PushT-v1, seeds: 3-1}", "end before they begin"),
        ("{task: PushT-v1, seeds: 1, control_mode: pd_joint_pso}", "pd_joint_pos"),
        ("{task: PushT-v1, seeds: 1, layout: ../other.yaml}", "is no file below the folder"),
        ("{task: PushT-v1, seeds: 1, camera_size: big}", "a size is 'big'; it takes"),
        ("{task: PushT-v1, seeds: 1, cameras: [{ey: 1}]}", "Did you mean 'eye'?"),
        ("{task: PushT-v1, seeds: 1, sensor_configs: 7}", "sensor_configs"),
        ("{task: PushT-v1, seeds: 1, exports: {x: {}}}", "the export x needs a 'format'"),
        ("{task: PushT-v1, seeds: 1, exports: {it: {format: lerobot}}}", "two folders would be"),
        ("{task: PushT-v1, seeds: 1, exports: {x: {format: lerobot, fsp: 1}}}", "mean 'fps'?"),
        ("{task: 'mylab.tray:Tray-v1', seeds: 1}", "a file does not choose which code runs"),
        ("{task: PushT-v1, seeds: 1, policy: 'evil:run'}", "a file does not choose which code"),
        ("7", "a recording is 7.0; it takes a mapping"),
    ],
)
def test_what_is_no_recipe_is_refused_with_its_place(tmp_path, entry, message):
    recipe = written(tmp_path / "recipe.yaml", f"recordings: {{it: {entry}}}")
    with pytest.raises(TaskError) as error:
        load_recipe(recipe)
    assert str(error.value).startswith(f"{recipe}: it: ") or "two folders" in message
    assert message in str(error.value)


def test_an_empty_recipe_is_refused(tmp_path):
    with pytest.raises(TaskError, match="it needs 'recordings'"):
        load_recipe(written(tmp_path / "recipe.yaml", ""))
    with pytest.raises(TaskError, match="Did you mean 'recordings'?"):
        load_recipe(written(tmp_path / "recipe.yaml", "recording: {}"))

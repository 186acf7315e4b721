"""Pictures of any size, by any cameras and of light meshes, also from the command line."""

import json
from pathlib import Path

import h5py
import numpy as np
import pytest

from robot_layouts.__main__ import main
from robot_layouts.data.reading.json_files import TrajectoryError
from robot_layouts.data.reading.recorded_task import task_for
from robot_layouts.data.reading.recording import Recording
from tasks.engine.columns import ROBOMIMIC, picture_column
from tests.data.recordings import edited


@pytest.fixture(autouse=True)
def skip_without_renderer(renderer):
    if renderer is None:
        pytest.skip("there is no Vulkan driver to draw pictures with")


def test_a_size_that_is_none(capsys):
    with pytest.raises(SystemExit):
        main(["evaluate", "--task", "PushCube-v1", "--camera-size", "large"])
    assert "'large' is no size; it is WxH, as 128x96" in capsys.readouterr().err


CAMERAS = """
cameras:
  - {name: palm, eye: [0.05, 0, 0], quaternion: [1, 0, 0, 0], mount: [arm, panda_hand]}
  - {name: top, eye: [0, 0, 1.2], target: [0, 0.01, 0], width: 20, height: 10}
sensor_configs:
  near: 0.02
  palm: {width: 16, height: 12}
"""


def record(out: Path, *words: str) -> Path:
    plan = ["record", "--task", "PushCube-v1", "--episodes", "1", "--workers", "0"]
    assert main([*plan, "--out", str(out), "--obs-mode", "rgb", *words]) == 0
    return out


def replay(source: Path, out: Path, *words: str) -> dict[str, np.ndarray]:
    assert main(["replay", str(source), "--obs-mode", "rgb", "--out", str(out), *words]) == 0
    return seen(out)


def seen(folder: Path) -> dict[str, np.ndarray]:
    with Recording(folder) as file:
        sensors = file.observations(0)["sensor_data"]
    return {name: camera["rgb"] for name, camera in sensors.items()}


def same(one: dict[str, np.ndarray], other: dict[str, np.ndarray]) -> bool:
    return [*one] == [*other] and all(np.array_equal(one[name], other[name]) for name in one)


@pytest.mark.long
def test_a_replay_has_the_cameras_of_the_recording(tmp_path: Path):
    (tmp_path / "cameras.yaml").write_text(CAMERAS)
    by_file = ["--cameras", str(tmp_path / "cameras.yaml")]
    recorded = record(tmp_path / "data", *by_file)
    before = seen(recorded)
    assert {name: rows.shape[1:3] for name, rows in before.items()} == {
        "palm": (12, 16),
        "top": (10, 20),
    }
    assert same(replay(recorded, tmp_path / "again"), before)
    smaller = replay(recorded, tmp_path / "smaller", "--camera-size", "8x8")
    assert smaller["top"].shape[1:3] == (8, 8)
    words = ["--format", "robomimic", "--cameras", "palm", "--workers", "0"]
    assert main(["export", str(recorded), *words, "--out", str(tmp_path / "set")]) == 0
    with h5py.File(tmp_path / "set" / "image.hdf5") as dataset:
        column = picture_column(ROBOMIMIC, "palm", "rgb")
        assert np.array_equal(dataset["data/demo_0/obs"][column], before["palm"][:-1])
    header = json.loads((recorded / "trajectory.json").read_text())
    assert header["pictures"]["cameras"][0]["mount"] == ["arm", "panda_hand"]
    with edited(recorded / "trajectory.h5") as file:
        file.attrs["pictures"] = json.dumps({"cameras": [{"eye": [0, 0, 1], "targt": [0, 0, 0]}]})
    with Recording(recorded) as file, pytest.raises(TrajectoryError, match="mean 'target'"):
        task_for(file)


@pytest.mark.long
def test_a_replay_draws_light_meshes_where_the_recording_did(tmp_path: Path):
    light = record(tmp_path / "light", "--camera-size", "32x24", "--visuals", "light")
    again, full = (
        replay(light, tmp_path / name, "--camera-size", "32x24", *words)
        for name, words in (("again", []), ("full", ["--visuals", "full"]))
    )
    assert same(again, seen(light))
    assert not same(full, again)
    assert json.loads((light / "trajectory.json").read_text())["pictures"] == {"visuals": "light"}


@pytest.mark.long
def test_a_receipt_says_which_cameras_and_meshes_a_command_line_asked_for(tmp_path: Path):
    (tmp_path / "cameras.yaml").write_text(CAMERAS)
    receipt = tmp_path / "receipt.json"
    words = ["evaluate", "--task", "PushCube-v1", "--episodes", "1", "--workers", "0"]
    words += ["--obs-mode", "rgb", "--visuals", "light"]
    words += ["--cameras", str(tmp_path / "cameras.yaml"), "--receipt", str(receipt)]
    assert main(words) == 0
    making = json.loads(receipt.read_text())["making"]
    assert making["visuals"] == "light"
    assert [camera["name"] for camera in making["cameras"]] == ["palm", "top"]
    assert main(["verify", str(receipt), "--workers", "0"]) == 0

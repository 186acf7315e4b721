"""A robomimic dataset holds points of what the recording's cameras observed."""

from pathlib import Path

import numpy as np
import pyfive
import pytest

import robot_layouts as rl
from robot_layouts.__main__ import main
from robot_layouts.data.export.dataset import Export, export
from robot_layouts.data.point_clouds import point_cloud
from robot_layouts.data.reading.json_files import TrajectoryError
from robot_layouts.data.reading.recording import Recording
from robots import TaskError, UnknownNameError

TASK = "PushCube-v1"
BOX = ("0.31", "-0.3", "0.005", "0.9", "0.3", "0.5")  # m, from the base of the arm


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory, renderer: object) -> Path:
    how = {"obs_mode": "rgb+depth", "camera_size": (48, 32)}
    return rl.record(TASK, [4, 5], tmp_path_factory.mktemp("seen"), workers=0, **how).folder


def test_points_before_and_after_each_step(seen: Path, tmp_path: Path):
    words = ["export", str(seen), "--format=robomimic", f"--out={tmp_path / 'out'}", "--workers=0"]
    assert main([*words, "--points=32", "--points-box", *BOX, "--points-frame=arm"]) == 0
    dataset = pyfive.File(str(tmp_path / "out" / "low_dim.hdf5"))
    box = np.array(BOX, float).reshape(2, 3)
    with Recording(seen) as file:
        for number, episode in enumerate(file):
            bases = episode.states["articulations"]["panda"][:, :7]
            cloud = point_cloud(file.observations(number), 32, box=box, frame=bases)
            demo = dataset[f"data/demo_{number}"]
            assert cloud["count"].min() > 0
            for name, rows in cloud.items():
                assert np.array_equal(demo[f"obs/points_{name}"][:], rows[:-1]), name
                assert np.array_equal(demo[f"next_obs/points_{name}"][:], rows[1:]), name
            assert demo["obs/points_xyz"].shape == (len(episode.actions), 32, 3)


def test_what_cannot_be_exported(seen: Path, tmp_path: Path):
    out = tmp_path / "out"
    with pytest.raises(TaskError, match="a LeRobot dataset has no points here"):
        export(Export(seen, "lerobot", out, points=8))
    with pytest.raises(TaskError, match="of no use without points"):
        export(Export(seen, "robomimic", out, points_frame="arm"))
    with pytest.raises(UnknownNameError, match="unknown place 'arn'. Did you mean 'arm'"):
        export(Export(seen, "robomimic", out, points=8, points_frame="arn"))
    rl.record(TASK, [4], tmp_path / "blind", workers=0)
    with pytest.raises(TrajectoryError, match="episode 0 was recorded without observations"):
        export(Export(tmp_path / "blind", "robomimic", out, points=8))
    rl.record(TASK, [4], tmp_path / "flat", workers=0, obs_mode="state")
    with pytest.raises(TaskError, match="one flat array, and no points are in it"):
        export(Export(tmp_path / "flat", "robomimic", out, points=8))
    assert not out.exists()

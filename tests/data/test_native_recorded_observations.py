"""What `replay --obs-mode` writes is what native writes, and native's dataset reads it."""

import json
from pathlib import Path

import gymnasium
import h5py
import numpy as np
import pytest

from parity.native import make_native, quiet
from robot_layouts.data.reading.recording import Recording
from tests.data.recordings import record
from tests.data.test_recorded_observations import LENGTHS, by_name, differences, observed_again
from tests.native import NATIVE

pytestmark = [*NATIVE, pytest.mark.usefixtures("renderer")]

MODE = "rgb+segmentation+state_dict"


@pytest.fixture(scope="module")
def pushed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record(tmp_path_factory.mktemp("pushed") / "trajectory.h5", "PushCube-v1", LENGTHS)


@pytest.mark.parametrize("mode", ["state", MODE])
def test_a_file_holds_what_natives_wrapper_writes(pushed: Path, tmp_path: Path, mode: str):
    with quiet():
        from mani_skill.utils.wrappers.record import RecordEpisode
    path = observed_again(pushed, tmp_path / "seen", mode)
    native = gymnasium.wrappers.TimeLimit(make_native("PushCube-v1", obs_mode=mode), 50)
    with h5py.File(path) as ours, quiet():
        env = RecordEpisode(native, str(tmp_path), trajectory_name="native", save_video=False)
        for group in ours.values():
            seed = json.loads(group.attrs["episode"])["episode_seed"]
            env.reset(seed=seed, options={"reconfigure": True})
            for action in group["actions"][()]:
                env.step(action)
            env.flush_trajectory()
        env.close()
        with h5py.File(tmp_path / "native.h5") as theirs:
            assert list(theirs) == list(ours) == ["traj_0", "traj_1"]
            for name, group in theirs.items():
                assert differences(by_name(group["obs"]), by_name(ours[name]["obs"])) == []


def test_natives_dataset_reads_it(pushed: Path, tmp_path: Path):
    with quiet():
        from mani_skill.trajectory.dataset import ManiSkillTrajectoryDataset
    path = observed_again(pushed, tmp_path / "seen", MODE, "--camera-size", "48x32")
    read = ManiSkillTrajectoryDataset(str(path))
    assert len(read) == sum(LENGTHS)
    rgb = read[LENGTHS[0]]["obs"]["sensor_data"]["base_camera"]["rgb"]
    assert rgb.shape == (32, 48, 3)
    with Recording(path) as file:
        assert np.array_equal(rgb, file.observations(1)["sensor_data"]["base_camera"]["rgb"][0])
        assert file.env_kwargs["sensor_configs"] == {"width": 48, "height": 32}

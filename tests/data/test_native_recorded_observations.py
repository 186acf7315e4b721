"""`replay` and `record --obs-mode` write what native writes, and native's dataset reads it."""

import json
import shutil
from pathlib import Path
from typing import Any

import gymnasium
import h5py
import numpy as np
import pytest

from parity.native import make_native, quiet
from robot_layouts.data.reading.recording import Recording
from robot_layouts.data.recording.record import record
from tests.data import recordings
from tests.data.test_recorded_observations import LENGTHS, by_name, differences, observed_again
from tests.native import NATIVE
from tests.quick import quick_cases

pytestmark = [*NATIVE, pytest.mark.usefixtures("renderer")]

MODE = "rgb+segmentation+state_dict"
REPLAYED = ("state", "state_dict", "rgb", "rgb+segmentation", "rgb+depth+state", "pointcloud")
SIZE = {"width": 48, "height": 32}


@pytest.fixture(scope="module")
def pushed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("pushed") / "trajectory.h5"
    return recordings.record(path, "PushCube-v1", LENGTHS)


@pytest.mark.parametrize("mode", quick_cases(["state", MODE], [MODE]))
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


def replayed_by_native(source: Path, folder: Path, mode: str) -> Path:
    """Return what native's own replay makes of a recording, with small cameras."""
    with quiet():
        from mani_skill.trajectory.replay_trajectory import Args, main
    shutil.copytree(source.parent, folder)
    path = folder / source.name
    about = json.loads(path.with_suffix(".json").read_text())
    about["env_info"]["env_kwargs"]["sensor_configs"] = SIZE
    path.with_suffix(".json").write_text(json.dumps(about))
    how = {"save_traj": True, "allow_failure": True, "record_rewards": True}
    with quiet():
        main(Args(str(path), obs_mode=mode, **how))
    (found,) = folder.glob(f"trajectory.{mode}.*.h5")
    return found


def contents(group: Any, name: str = "") -> list[tuple[str, Any]]:
    """Return names and arrays in the order of the file, and how each array is packed.

    Native takes the textures of a camera in the order of a hash: their order is free.
    """
    found: list[tuple[str, Any]] = []
    for key in sorted(group) if "/sensor_data/" in name else group:
        own = group[key]
        if isinstance(own, h5py.Group):
            found += [(f"{name}{key}/", None), *contents(own, f"{name}{key}/")]
        else:
            packed = own.compression, own.compression_opts, own.chunks
            found.append((f"{name}{key}", (own.dtype, own.shape, packed, own[()])))
    return found


@pytest.mark.parametrize("mode", quick_cases(REPLAYED, ["rgb+depth+state"]))
def test_a_file_is_what_natives_own_replay_makes(pushed: Path, tmp_path: Path, mode: str):
    path = observed_again(pushed, tmp_path / "seen", mode, "--camera-size", "48x32")
    native = replayed_by_native(pushed, tmp_path / "native", mode)
    with h5py.File(path) as ours, h5py.File(native) as theirs:
        assert list(theirs) == list(ours) == ["traj_0", "traj_1"]
        for name, group in theirs.items():
            mine, expected = contents(ours[name]), contents(group)
            order = [key for key, _ in expected]
            assert [key for key, _ in mine] == order
            for (key, a), (_, b) in zip(mine, expected, strict=True):
                if b is not None:
                    assert a[:-1] == b[:-1], key
                    assert np.array_equal(a[-1], b[-1]), key


@pytest.mark.long
def test_what_an_expert_is_recorded_with_is_what_native_makes_of_it(tmp_path: Path):
    plain, seen = tmp_path / "plain", tmp_path / "seen"
    record("PushCube-v1", [4], plain, workers=0)
    making = {"obs_mode": "rgb+state", "camera_size": (48, 32)}
    record("PushCube-v1", [4], seen, workers=0, **making)
    native = replayed_by_native(plain / "trajectory.h5", tmp_path / "native", "rgb+state")
    with h5py.File(seen / "trajectory.h5") as ours, h5py.File(native) as theirs:
        mine, expected = by_name(ours["traj_0"]), by_name(theirs["traj_0"])
        assert differences(expected, mine) == []


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

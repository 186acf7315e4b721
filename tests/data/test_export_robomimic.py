"""A robomimic dataset holds the recording's numbers; read back with pyfive, not with h5py."""

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pyfive
import pytest

import tasks
from layouts import Layout, Placement
from robot_layouts.data.export.columns import ColumnReader
from robot_layouts.data.export.dataset import Export, export
from robots import RecordingError
from tests.data.recordings import (
    FINGERS,
    LEFT_KEY,
    PANDA_ARM,
    RIGHT_KEY,
    SECOND,
    TWO_ROBOTS,
    read,
    record,
    succeed,
)

LENGTHS = [4, 1, 6]
KEYS = {"left": LEFT_KEY, "right": RIGHT_KEY}


@pytest.fixture(scope="module")
def recording(tmp_path_factory) -> Path:
    path = record(tmp_path_factory.mktemp("two") / "two.h5", TWO_ROBOTS, LENGTHS, SECOND)
    succeed(path, 1)
    return path


@pytest.fixture(scope="module")
def dataset(recording, tmp_path_factory) -> pyfive.File:
    out = tmp_path_factory.mktemp("robomimic") / "dataset"
    export(Export(recording, "robomimic", out, include_failures=True))
    assert [path.name for path in out.iterdir()] == ["low_dim.hdf5"]
    return pyfive.File(str(out / "low_dim.hdf5"))


def demo(dataset, number: int) -> dict[str, np.ndarray]:
    """Return every array of a demonstration by its path."""
    found: dict[str, np.ndarray] = {}

    def visit(group, prefix: str) -> None:
        for name in group:
            if isinstance(group[name], Mapping):
                visit(group[name], f"{prefix}{name}/")
            else:
                found[prefix + name] = group[name][:]

    visit(dataset[f"data/demo_{number}"], "")
    return found


def test_every_number_is_the_recordings(recording, dataset):
    for number, episode in enumerate(read(recording)):
        steps, arrays = LENGTHS[number], demo(dataset, number)
        observed = {"object": episode.poses("cube", "goal_site")}
        for place, key in KEYS.items():
            observed |= {f"{place}_qpos": episode.qpos(key), f"{place}_qvel": episode.qvel(key)}
        wanted = {
            "actions": episode.arrays["actions"],
            "rewards": episode.arrays["rewards"],
            "dones": (np.arange(steps) == steps - 1).astype(np.int64),
            **{f"obs/{key}": rows[:-1] for key, rows in observed.items()},
            **{f"next_obs/{key}": rows[1:] for key, rows in observed.items()},
        }
        others = {"states", *(f"{o}/{p}_tcp_pose" for o in ("obs", "next_obs") for p in KEYS)}
        assert set(arrays) == set(wanted) | others
        for name, values in wanted.items():
            np.testing.assert_array_equal(arrays[name], values, err_msg=name)
            assert arrays[name].dtype == values.dtype
        assert dataset[f"data/demo_{number}"].attrs["num_samples"] == steps
        assert dataset[f"data/demo_{number}"].attrs["seed"] == 10 + number
    assert dataset["data"].attrs["total"] == sum(LENGTHS)


def test_flat_states_say_which_number_is_which(recording, dataset):
    layout = json.loads(dataset["data"].attrs["state_layout"])
    for number, episode in enumerate(read(recording)):
        states = demo(dataset, number)["states"]
        assert {part["entry"].split("/")[1] for part in layout} == set(episode.states)
        assert [part["start"] for part in layout] == [0, *(part["stop"] for part in layout[:-1])]
        assert layout[-1]["stop"] == states.shape[1]
        for part in layout:
            rows = episode.states[part["entry"].split("/")[1]]
            np.testing.assert_array_equal(states[:, part["start"] : part["stop"]], rows[:-1])


def test_tool_poses_are_where_the_tools_were(recording, dataset):
    task = tasks.make(TWO_ROBOTS, robots=SECOND, obs_mode="none")
    arrays = demo(dataset, 2)
    task.reset(12, options={"reconfigure": True})
    for t, action in enumerate(read(recording)[2].arrays["actions"]):
        task.step(action)
        state = task.simulation.read()
        for place in KEYS:
            found = arrays[f"next_obs/{place}_tcp_pose"][t]
            np.testing.assert_allclose(found, state.tcp_pose(place)[0], atol=1e-6)
    moved = arrays["next_obs/left_tcp_pose"][-1] - arrays["obs/left_tcp_pose"][0]
    assert np.abs(moved).max() > 1e-3


def test_limbs_have_tool_poses_and_numbers_of_poses_have_names():
    cell = Layout({"cell": Placement("mobile_panda_dual", position=(2.5, 0.0, 1.0))})
    task = tasks.make(TWO_ROBOTS, layout=cell, obs_mode="robomimic", control_mode="pd_ee_pose")
    poses = {key for key in task.start[0] if key.endswith("_tcp_pose")}
    assert poses == {"cell.left_tcp_pose", "cell.right_tcp_pose"}
    read = task.simulation.read()
    for limb in ("left", "right"):
        given = task.start[0][f"cell.{limb}_tcp_pose"].numpy()
        np.testing.assert_allclose(given, read.tcp_pose(limb), atol=1e-6)
    names = ColumnReader(task).action_names
    assert len(set(names)) == len(names) == 15
    assert names[:2] == ["cell.left_arm.x", "cell.left_arm.y"]


def test_numbers_have_names(dataset):
    names = json.loads(dataset["data"].attrs["names"])
    left, right = ([f"{place}.{joint}" for joint in PANDA_ARM] for place in ("left", "right"))
    assert names["actions"] == [*left, "left.gripper", *right]
    assert names["left_qpos"] == [*PANDA_ARM, *FINGERS]
    assert names["right_qvel"] == PANDA_ARM
    assert names["object"][6:8] == ["cube.qz", "goal_site.x"]
    sizes = {
        key.removeprefix("obs/"): rows.shape[1]
        for key, rows in demo(dataset, 0).items()
        if key == "actions" or key.startswith("obs/")
    }
    assert {key: len(values) for key, values in names.items()} == sizes


def test_the_environment_can_be_made_again(dataset):
    environment = json.loads(dataset["data"].attrs["env_args"])
    assert set(environment) == {"env_name", "type", "env_kwargs"}
    env = tasks.make(environment["env_name"], **environment["env_kwargs"])
    assert env.layout.action_dim == 15
    assert env.control_mode == "pd_joint_delta_pos"


def test_filter_keys_split_the_demonstrations(dataset, tmp_path):
    masks = {name: [x.decode() for x in dataset[f"mask/{name}"][:]] for name in dataset["mask"]}
    assert masks == {"train": ["demo_0", "demo_1"], "valid": ["demo_2"], "success": ["demo_1"]}

    recording = record(tmp_path / "many.h5", "PushT-v1", [1] * 21)
    export(Export(recording, "robomimic", tmp_path / "many", include_failures=True))
    many = pyfive.File(str(tmp_path / "many/low_dim.hdf5"))
    masks = {name: [x.decode() for x in many[f"mask/{name}"][:]] for name in many["mask"]}
    assert masks["valid"] == ["demo_9", "demo_19"]
    assert sorted(masks["train"] + masks["valid"]) == sorted(many["data"])
    assert len(masks["train"]) == 19
    assert "success" not in masks


@pytest.mark.parametrize("free", [0, 8, 24, 40])  # kB; the dataset takes 48
def test_a_full_disk_is_one_clear_error(small_disk, recording, free):
    (small_disk / "others").write_bytes(bytes((512 - free) * 1024))
    out = small_disk / "dataset"
    with pytest.raises(RecordingError, match=rf"^cannot write {out}: No space left on device$"):
        export(Export(recording, "robomimic", out, include_failures=True))
    assert [path.name for path in small_disk.iterdir()] == ["others"]

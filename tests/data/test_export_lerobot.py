"""A LeRobot dataset holds the recording's numbers; read back with duckdb and ffmpeg."""

import json
import re
import subprocess
from pathlib import Path
from typing import Any

import duckdb
import numpy as np
import pytest

import tasks
from robot_layouts.data.export.columns import ColumnReader
from robot_layouts.data.export.dataset import Export, export
from robot_layouts.data.export.lerobot import FileLimits, LeRobotWriter
from robot_layouts.data.reading.recorded_task import task_for
from robot_layouts.data.reading.recording import Recording
from robot_layouts.data.video import video_problem
from tests.data.recordings import (
    FINGERS,
    LEFT_KEY,
    PANDA_ARM,
    RIGHT_KEY,
    SECOND,
    TWO_ROBOTS,
    Recorded,
    read,
    record,
)

LENGTHS = [5, 1, 40]
QUANTILES = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}


@pytest.fixture(scope="module")
def recording(tmp_path_factory) -> Path:
    return record(tmp_path_factory.mktemp("two") / "two.h5", TWO_ROBOTS, LENGTHS, SECOND)


@pytest.fixture(scope="module")
def dataset(recording, tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("lerobot") / "dataset"
    done = export(Export(recording, "lerobot", out, include_failures=True))
    assert (done.episodes, done.steps, done.left_out) == (len(LENGTHS), sum(LENGTHS), 0)
    return out


def query(text: str) -> dict[str, list[Any]]:
    """Return the columns of a query's result."""
    cursor = duckdb.execute(text)
    names = [column[0] for column in cursor.description]
    rows = cursor.fetchall()
    return {name: [row[i] for row in rows] for i, name in enumerate(names)}


def frames(dataset: Path) -> dict[str, np.ndarray]:
    """Return every data column in the order of the frames."""
    columns = query(f"select * from '{dataset}/data/*/*.parquet' order by index")
    return {name: np.array(values) for name, values in columns.items()}


def expected(episodes: list[Recorded]) -> dict[str, np.ndarray]:
    """Return the columns that a two-robot recording must become, from its own numbers."""
    parts: dict[str, list[np.ndarray]] = {}
    for number, episode in enumerate(episodes):
        steps = len(episode.arrays["actions"])
        last = np.arange(steps) == steps - 1
        columns = {
            "action": episode.arrays["actions"],
            "observation.state": np.hstack([episode.qpos(LEFT_KEY), episode.qpos(RIGHT_KEY)])[:-1],
            "observation.velocity": np.hstack([episode.qvel(LEFT_KEY), episode.qvel(RIGHT_KEY)])[
                :-1
            ],
            "observation.environment_state": episode.poses("cube", "goal_site")[:-1],
            "next.reward": episode.arrays["rewards"],
            "next.success": episode.arrays["success"],
            "next.done": last | episode.arrays["terminated"] | episode.arrays["truncated"],
            "timestamp": np.arange(steps, dtype=np.float32) / np.float32(20),
            "frame_index": np.arange(steps),
            "episode_index": np.full(steps, number),
            "task_index": np.zeros(steps, int),
        }
        for name, values in columns.items():
            parts.setdefault(name, []).append(values)
    joined = {name: np.concatenate(values) for name, values in parts.items()}
    return joined | {"index": np.arange(len(joined["action"]))}


def test_every_number_is_the_recordings(recording, dataset):
    found, wanted = frames(dataset), expected(read(recording))
    assert set(found) == set(wanted)
    for name, values in wanted.items():
        np.testing.assert_array_equal(found[name].astype(values.dtype), values, err_msg=name)
    assert (np.abs(wanted["observation.velocity"]) > 0.1).any()


def test_columns_have_lerobots_types(dataset):
    described = query(f"describe select * from '{dataset}/data/*/*.parquet'")
    types = dict(zip(described["column_name"], described["column_type"], strict=True))
    vectors = ("action", *(f"observation.{n}" for n in ("state", "velocity", "environment_state")))
    numbers = ("frame_index", "episode_index", "index", "task_index")
    assert types == {
        **dict.fromkeys(vectors, "FLOAT[]"),
        **dict.fromkeys(("next.reward", "timestamp"), "FLOAT"),
        **dict.fromkeys(("next.success", "next.done"), "BOOLEAN"),
        **dict.fromkeys(numbers, "BIGINT"),
    }


def test_info_names_every_number(dataset):
    info = json.loads((dataset / "meta/info.json").read_text())
    left, right = ([f"{place}.{joint}" for joint in PANDA_ARM] for place in ("left", "right"))
    joints = [*left, *(f"left.{finger}" for finger in FINGERS), *right]
    pose = ("x", "y", "z", "qw", "qx", "qy", "qz")
    bodies = [f"{body}.{number}" for body in ("cube", "goal_site") for number in pose]
    features = info.pop("features")
    for key, names in (
        ("action", [*left, "left.gripper", *right]),
        ("observation.state", joints),
        ("observation.velocity", joints),
        ("observation.environment_state", bodies),
    ):
        assert features[key] == {"dtype": "float32", "shape": [len(names)], "names": names}
    for key, dtype in (("next.done", "bool"), ("index", "int64"), ("timestamp", "float32")):
        assert features[key] == {"dtype": dtype, "shape": [1], "names": None}
    assert set(features) == set(frames(dataset))
    assert info == {
        "codebase_version": "v3.0",
        "robot_type": "panda_wristcam+panda_stick",
        "total_episodes": 3,
        "total_frames": sum(LENGTHS),
        "total_tasks": 1,
        "chunks_size": 1000,
        "data_files_size_in_mb": 100,
        "video_files_size_in_mb": 200,
        "fps": 20,
        "splits": {"train": "0:3"},
        "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
        "video_path": None,
    }


def test_episodes_say_where_their_frames_are(dataset):
    rows = query(
        "select episode_index, tasks, length, dataset_from_index, dataset_to_index,"
        ' "data/chunk_index", "data/file_index", "meta/episodes/chunk_index",'
        f" \"meta/episodes/file_index\" from '{dataset}/meta/episodes/*/*.parquet'"
    )
    text = (
        "Hand a cube over: it starts out of the right arm's reach, the goal is out of the left's."
    )
    assert (
        list(rows.values())
        == [[0, 1, 2], [[text]] * 3, LENGTHS, [0, 5, 6], [5, 6, sum(LENGTHS)]] + [[0] * 3] * 4
    )
    task = query(f"select * from '{dataset}/meta/tasks.parquet'")
    assert task == {"task_index": [0], "task": [text]}
    pandas = query(f"select value from parquet_kv_metadata('{dataset}/meta/tasks.parquet')")
    described = [json.loads(value) for value in pandas["value"] if value.startswith(b'{"index_c')]
    assert described[0]["index_columns"] == ["task"]
    origin = json.loads((dataset / "meta/recording.json").read_text())
    assert origin["episodes"] == [{"episode_id": i, "seed": 10 + i} for i in range(3)]
    assert origin["layout"]["right"]["robot"] == "panda_stick"


def statistics(numbers: np.ndarray) -> dict[str, np.ndarray]:
    values = numbers.astype(float).reshape(len(numbers), -1)
    return {
        **{name: getattr(np, name)(values, axis=0) for name in ("min", "max", "mean", "std")},
        **{name: np.quantile(values, share, axis=0) for name, share in QUANTILES.items()},
        "count": np.array([len(values)]),
    }


def test_statistics_are_those_of_the_numbers(recording, dataset):
    wanted = expected(read(recording))
    total = json.loads((dataset / "meta/stats.json").read_text())
    assert set(total) == set(wanted)
    episodes = query(f"select * from '{dataset}/meta/episodes/*/*.parquet' order by episode_index")
    for name, values in wanted.items():
        assert set(total[name]) == set(statistics(values))
        for kind, numbers in statistics(values).items():
            np.testing.assert_allclose(total[name][kind], numbers, rtol=1e-12, atol=1e-15)
        for episode in range(len(LENGTHS)):
            part = statistics(values[wanted["episode_index"] == episode])
            for kind, numbers in part.items():
                found = episodes[f"stats/{name}/{kind}"][episode]
                np.testing.assert_allclose(found, numbers, rtol=1e-12, atol=1e-15)


def test_statistics_of_joints_add_up_column_by_column(recording, dataset):
    """An export made again is the same to the last bit, which the order of a sum decides."""
    wanted = expected(read(recording))
    episodes = query(f"select * from '{dataset}/meta/episodes/*/*.parquet' order by episode_index")
    for name in ("observation.state", "observation.velocity"):
        for episode in range(len(LENGTHS)):
            rows = wanted[name][wanted["episode_index"] == episode].astype(float)
            columns = [np.std(np.ascontiguousarray(column)) for column in rows.T]
            assert episodes[f"stats/{name}/std"][episode] == columns


def test_full_files_are_followed_by_others(recording, tmp_path):
    with Recording(recording) as file:
        reader = ColumnReader(task_for(file))
        limits = FileLimits(data_megabytes=1e-6, files=2)
        with LeRobotWriter(
            tmp_path, reader, task_text="go", fps=20, origin={}, limits=limits
        ) as writer:
            for trajectory in [*file, file[0]]:
                writer.add(reader.read(trajectory), (), lambda _: None, None)
    names = sorted(str(path.relative_to(tmp_path)) for path in tmp_path.glob("data/*/*"))
    assert names == [f"data/chunk-00{c}/file-00{f}.parquet" for c in (0, 1) for f in (0, 1)]
    found = frames(tmp_path)
    assert found["index"].tolist() == list(range(sum(LENGTHS) + LENGTHS[0]))
    places = query(
        'select "data/chunk_index", "data/file_index"'
        f" from '{tmp_path}/meta/episodes/*/*.parquet' order by episode_index"
    )
    assert list(places.values()) == [[0, 0, 1, 1], [0, 1, 0, 1]]
    third = query(f"select episode_index from '{tmp_path}/data/chunk-001/file-000.parquet'")
    assert set(third["episode_index"]) == {2}


def test_another_robot_has_other_columns(tmp_path):
    recording = record(tmp_path / "so100.h5", "PickCubeSO100-v1", [2])
    export(Export(recording, "lerobot", tmp_path / "out", fps=30, include_failures=True))
    info = json.loads((tmp_path / "out/meta/info.json").read_text())
    joints = ["shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper"]
    names = [f"arm.{joint}" for joint in joints]
    assert info["features"]["action"]["names"] == names
    assert info["features"]["observation.state"]["names"] == names
    assert (info["fps"], info["robot_type"]) == (30, "so100")
    found, (episode,) = frames(tmp_path / "out"), read(recording)
    state = found["observation.state"].astype(np.float32)
    np.testing.assert_array_equal(state, episode.qpos("so100")[:-1])
    np.testing.assert_array_equal(
        found["timestamp"].astype(np.float32), np.array([0, 1 / 30], np.float32)
    )


FILMED = "PushT-v1"
FRAMES = [2, 1, 3]
CAMERA = "observation.images.overview"


@pytest.fixture(scope="module")
def filmed(tmp_path_factory, renderer) -> Path:
    """Return a folder with a recording, and a dataset with video that was made of it."""
    if problem := video_problem("sapien3"):
        pytest.skip(problem)
    folder = tmp_path_factory.mktemp("filmed")
    recording = record(folder / "recording.h5", FILMED, FRAMES)
    export(Export(recording, "lerobot", folder / "dataset", video=True, include_failures=True))
    return folder


def test_a_video_has_a_frame_per_row(filmed):
    import imageio.v2 as imageio

    path = filmed / f"dataset/videos/{CAMERA}/chunk-000/file-000.mp4"
    with imageio.get_reader(path) as reader:
        about, count = reader.get_meta_data(), reader.count_frames()
    assert count == len(frames(filmed / "dataset")["index"]) == sum(FRAMES)
    assert (about["fps"], about["size"], about["codec"]) == (20, (512, 512), "h264")
    assert about["pix_fmt"].startswith("yuv420p")
    assert [time for time, _ in times(path)] == [i / 20 for i in range(sum(FRAMES))]
    assert [key for _, key in times(path)] == [True, False] * (sum(FRAMES) // 2)

    feature = json.loads((filmed / "dataset/meta/info.json").read_text())["features"][CAMERA]
    assert (feature["dtype"], feature["shape"]) == ("video", [512, 512, 3])
    assert feature["info"]["video.fps"] == 20
    text = f"select * from '{filmed}/dataset/meta/episodes/*/*.parquet' order by episode_index"
    rows = query(text)
    assert rows[f"videos/{CAMERA}/from_timestamp"] == [0.0, 0.1, 0.15]
    assert rows[f"videos/{CAMERA}/to_timestamp"] == [0.1, 0.15, 0.3]
    assert rows[f"videos/{CAMERA}/file_index"] == [0, 0, 0]


def times(path: Path) -> list[tuple[float, bool]]:
    """Return when each frame of a video is shown (s), and whether it is a keyframe."""
    import imageio_ffmpeg

    words = ["-i", path, "-vf", "showinfo", "-f", "null", "-"]
    done = subprocess.run(
        [imageio_ffmpeg.get_ffmpeg_exe(), *words], capture_output=True, text=True, check=True
    )
    found = re.findall(r"pts_time:(\S+) .*iskey:(\d)", done.stderr)
    return [(float(time), key == "1") for time, key in found]


def test_a_frame_shows_the_state_of_its_row(filmed):
    import imageio.v3 as imageio

    path = filmed / f"dataset/videos/{CAMERA}/chunk-000/file-000.mp4"
    shown = imageio.imread(path).astype(int)
    task = tasks.make(FILMED, render_mode="rgb_array")
    task.reset(12, options={"reconfigure": True})
    for action in read(filmed / "recording.h5")[2].arrays["actions"][:-1]:
        task.step(action)
    differences = np.abs(shown - task.render()[0]).mean((1, 2, 3))
    assert differences.argmin() == sum(FRAMES) - 1
    assert differences[-1] < 3
    total = json.loads((filmed / "dataset/meta/stats.json").read_text())[CAMERA]
    assert total["count"] == [sum(FRAMES)]
    np.testing.assert_allclose(np.ravel(total["mean"]), shown.mean((0, 1, 2)) / 255, atol=0.01)

"""Exports with the cameras of task and robots hold what `obs_mode="rgb+depth"` gives, by bits."""

import io
import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np
import pyarrow.parquet as pq
import pytest
from PIL import Image

import tasks
from robot_layouts.__main__ import main
from robot_layouts.data.export.columns import ColumnReader, state_row
from robot_layouts.data.export.dataset import Export, export
from robot_layouts.data.export.drawing import Drawing, DrawnEpisode
from robot_layouts.data.export.lerobot import FileLimits, LeRobotWriter
from robot_layouts.data.export.shots import PictureChannel, choose_shots
from robot_layouts.data.playing.executor import ProcessExecutor
from robot_layouts.data.reading.recorded_task import task_for
from robot_layouts.data.reading.recording import Recording
from robot_layouts.data.recording.recorder import Recorder
from robot_layouts.simulation import Camera
from robot_layouts.simulation.rendering import Observers, vulkan_problem
from robots import TaskError, UnknownNameError
from tasks import Normal, Randomization, Shift, Uniform, Whole
from tasks.episode import play
from tests.data.clusters import running_cluster
from tests.data.plays import DiesAmidAnEpisode
from tests.data.recordings import edited, record

TASK, ROBOTS = "TwoRobotPickCube-v1", {"left": "panda_wristcam", "right": "panda_wristcam"}
NATIVE = {  # by place
    "base_camera": "base_camera",
    "left.hand_camera": "panda_wristcam-0-hand_camera",
    "right.hand_camera": "panda_wristcam-1-hand_camera",
}
LENGTHS = [2, 1]
SIZE = (32, 24)
REBUILT = {"reconfigure": True}


@pytest.fixture(scope="module")
def driver(renderer) -> None:
    """Skip where nothing can be drawn."""
    if problem := vulkan_problem():
        pytest.skip(problem)


drawn = pytest.mark.usefixtures("driver")


@pytest.fixture(scope="module")
def recording(tmp_path_factory) -> Path:
    return record(tmp_path_factory.mktemp("two") / "two.h5", TASK, LENGTHS, ROBOTS)


@pytest.fixture(scope="module")
def seen(recording, driver) -> list[list[dict[str, np.ndarray]]]:
    """Return what an environment with cameras sees in every moment of every episode."""
    fields = {"obs_mode": "rgb+depth", "robots": ROBOTS, "camera_size": SIZE}
    env = tasks.make(TASK, **fields)
    with Recording(recording) as file:
        return [list(observed(env, episode)) for episode in file]


def observed(env, episode) -> Iterator[dict[str, np.ndarray]]:
    obs, _ = env.reset(seed=episode.seed, options=REBUILT)
    for action in [*episode.actions, None]:
        yield {
            f"{name} {texture}": obs["sensor_data"][native][texture][0].numpy()
            for name, native in NATIVE.items()
            for texture in ("rgb", "depth")
        }
        if action is not None:
            obs, *_ = env.step(action[None])


@pytest.fixture(scope="module")
def robomimic(recording, seen, tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("robomimic") / "out"
    wanted = Export(
        recording, "robomimic", out, cameras="all", depth=True, size=SIZE, include_failures=True
    )
    export(wanted)
    assert [path.name for path in out.iterdir()] == ["image.hdf5"]
    return out


@pytest.mark.long
@drawn
def test_arrays_of_robomimic_are_what_the_environment_sees(seen, robomimic):
    with h5py.File(robomimic / "image.hdf5") as file:
        for number, moments in enumerate(seen):
            demo = file[f"data/demo_{number}"]
            for key in moments[0]:
                name, texture = key.split()
                column = f"{name.replace('.', '_')}_{'image' if texture == 'rgb' else 'depth'}"
                wanted = np.array([moment[key] for moment in moments])
                for rows, expected in (("obs", wanted[:-1]), ("next_obs", wanted[1:])):
                    held = demo[f"{rows}/{column}"]
                    assert held.dtype == expected.dtype
                    np.testing.assert_array_equal(held[()], expected, err_msg=column)
            assert demo.attrs["pictures_exact"]
            assert json.loads(demo.attrs["ep_meta"])["lang"].startswith("Hand a cube over")
    assert len({moment["left.hand_camera rgb"].tobytes() for moment in seen[0]}) == 3  # it moves


@pytest.mark.long
@drawn
def test_images_of_lerobot_are_what_the_environment_sees(recording, seen, tmp_path):
    names = ["left.hand_camera", "base_camera"]
    words = ["--cameras", *names, "--images", "--depth", "--size", "32x24"]
    out = tmp_path / "out"
    words += ["--format", "lerobot", "--include-failures", "--workers", "0", "--out", str(out)]
    assert main(["export", str(recording), *words]) == 0
    table = pq.read_table(out / "data").to_pydict()
    features = json.loads((out / "meta/info.json").read_text())["features"]
    moments = [moment for episode in seen for moment in episode[:-1]]
    for name in names:
        for texture, end, shape in (("rgb", "", [24, 32, 3]), ("depth", "_depth", [24, 32, 1])):
            key = f"observation.images.{name}{end}"
            assert features[key]["dtype"] == "image"
            assert features[key]["shape"] == shape
            for image, moment in zip(table[key], moments, strict=True):
                pixels = np.array(Image.open(io.BytesIO(image["bytes"])))
                wanted = moment[f"{name} {texture}"]
                if texture == "depth":
                    wanted = wanted.view(np.uint16)[..., 0]
                assert pixels.dtype == wanted.dtype
                np.testing.assert_array_equal(pixels, wanted)
    depth = features["observation.images.base_camera_depth"]
    assert depth["info"] == {"is_depth_map": True, "depth_unit": "mm"}
    assert "observation.images.right.hand_camera" not in features
    statistics = json.loads((out / "meta/stats.json").read_text())
    all_depths = np.array([moment["base_camera depth"].view(np.uint16) for moment in moments])
    assert all_depths.max() == 32768  # or farther
    found = statistics["observation.images.base_camera_depth"]
    np.testing.assert_allclose(np.ravel(found["mean"]), all_depths.mean(), rtol=1e-9)
    assert np.shape(found["mean"]) == (1, 1, 1)
    origins = json.loads((out / "meta/recording.json").read_text())["episodes"]
    assert [origin["pictures_exact"] for origin in origins] == [True, True]


@drawn
@pytest.mark.parametrize("form", ["lerobot", "robomimic"])
def test_the_columns_of_such_an_export_step_by_step(recording, seen, form):
    env = tasks.make(TASK, obs_mode=f"{form}+cameras+depth", robots=ROBOTS, camera_size=SIZE)
    with Recording(recording) as file:
        obs, _ = env.reset(seed=file[0].seed, options=REBUILT)
    for key, picture in seen[0][0].items():
        name, texture = key.split()
        column = (
            f"observation.images.{name}{'_depth' if texture == 'depth' else ''}"
            if form == "lerobot"
            else f"{name.replace('.', '_')}_{'image' if texture == 'rgb' else 'depth'}"
        )
        np.testing.assert_array_equal(obs[column][0].numpy(), picture, err_msg=column)
    assert ("observation.state" in obs) == (form == "lerobot")


@drawn
def test_where_no_replay_ends_pictures_are_of_the_recorded_states(tmp_path):
    path = record(tmp_path / "push.h5", "PushT-v1", [3])
    with edited(path) as file:
        file["traj_0/env_states/actors/Tee"][1:, 0] += 0.05
    with Recording(path) as file:
        task = task_for(file, pictures=True)
        columns = ColumnReader(task).read(file[0])
        shots = choose_shots(task, ["base_camera"], size=SIZE)
        drawing = Drawing(task, columns, shots)
        pictures = [picture for frame in drawing for picture in frame.values()]
    assert not drawing.exact
    assert (pictures[0] != pictures[1]).any()
    task.reset(seed=10, options=REBUILT)
    for t, picture in enumerate(pictures):
        if t > 0:  # the first follows from the seed
            task.set_state_dict(state_row(columns.states, t))
        (view,) = Observers(task.simulation, shots.cameras, ["rgb"]).look(0).values()
        np.testing.assert_array_equal(view.images["rgb"], picture)


@pytest.mark.long
@drawn
def test_worlds_that_vary_are_drawn_as_they_were(tmp_path):
    varied = Randomization(
        size={"cube": Uniform(0.6, 1.6)},
        bases={"*": Shift(x=Uniform(-0.05, 0.05), yaw=Uniform(-0.1, 0.1))},
        action_noise={"left.arm": Normal(0.1)},
        action_delay=Whole(0, 2),
    )
    task = tasks.make(TASK, obs_mode="none", randomization=varied)
    with Recorder(tmp_path / "varied.h5", task) as recorder:
        recorder.add(play(task, 3, np.full((2, task.layout.action_dim), 0.5, np.float32)))
    env = tasks.make(TASK, obs_mode="rgb+depth", camera_size=SIZE, randomization=varied)
    with Recording(tmp_path / "varied.h5") as file:
        moments = list(observed(env, file[0]))
        task = task_for(file, pictures=True)
        shots = choose_shots(task, ["all"], size=SIZE, depth=True)
        drawing = Drawing(task, ColumnReader(task).read(file[0]), shots, last=True)
        for frame, moment in zip(drawing, moments, strict=True):
            for channel, picture in frame.items():
                wanted = moment[f"{channel.camera} {channel.texture}"]
                np.testing.assert_array_equal(picture, wanted)
    assert drawing.exact


def flat(camera: str, value: int, moments: int = 2) -> tuple[PictureChannel, np.ndarray]:
    return PictureChannel(camera, "rgb", 16, 16), np.full((moments, 16, 16, 3), value, np.uint8)


def test_full_video_files_are_followed_by_others(tmp_path):
    path = record(tmp_path / "push.h5", "PushT-v1", [2, 2, 2])
    with Recording(path) as file:
        reader = ColumnReader(task_for(file))
        channels = [flat("a", 0)[0], flat("b", 0)[0]]
        limits = FileLimits(video_megabytes=3 * 16 * 16 / 8 / 2**20)  # three frames
        with LeRobotWriter(
            tmp_path / "out", reader, task_text="go", fps=20, origin={}, channels=channels,
            limits=limits,
        ) as writer:  # fmt: skip
            for i, trajectory in enumerate(file):
                pictures = DrawnEpisode(dict([flat("a", i), flat("b", 9 * i)]), True)
                text = "stop" if i == 1 else None
                writer.add(reader.read(trajectory), pictures, lambda _: None, text)
    rows = pq.read_table(tmp_path / "out/meta/episodes").to_pydict()
    for camera in "ab":
        key = f"videos/observation.images.{camera}"
        assert rows[f"{key}/file_index"] == [0, 0, 1]
        assert rows[f"{key}/from_timestamp"] == [0.0, 0.1, 0.0]
        assert rows[f"{key}/to_timestamp"] == [0.1, 0.2, 0.1]
    assert rows["tasks"] == [["go"], ["stop"], ["go"]]
    assert rows["stats/observation.images.b/max"][2] == [[[18 / 255]]] * 3
    tasks_ = pq.read_table(tmp_path / "out/meta/tasks.parquet").to_pydict()
    assert tasks_ == {"task_index": [0, 1], "task": ["go", "stop"]}
    data = pq.read_table(tmp_path / "out/data").to_pydict()
    assert data["task_index"] == [0, 0, 1, 1, 0, 0]
    assert json.loads((tmp_path / "out/meta/info.json").read_text())["total_tasks"] == 2


def test_texts_come_from_whoever_says_them(tmp_path):
    path = record(tmp_path / "push.h5", "PushT-v1", [1, 1, 1])
    entries = json.loads(path.with_suffix(".json").read_text())
    entries["episodes"][1]["source"] = {"kind": "person", "instruction": "gently"}
    path.with_suffix(".json").write_text(json.dumps(entries))
    for form in ("lerobot", "robomimic"):
        export(
            Export(path, form, tmp_path / form, instruction={2: "at once"}, include_failures=True)
        )
    texts = pq.read_table(tmp_path / "lerobot/meta/episodes").to_pydict()["tasks"]
    assert texts[1:] == [["gently"], ["at once"]]
    assert texts[0][0].startswith("Push")
    with h5py.File(tmp_path / "robomimic/low_dim.hdf5") as file:
        found = [dict(file[f"data/demo_{i}"].attrs).get("ep_meta") for i in range(3)]
    assert found == [None, '{"lang": "gently"}', '{"lang": "at once"}']
    words = ["--format", "lerobot", "--out", str(tmp_path / "all"), "--instruction", "Slide it"]
    words.append("--include-failures")
    assert main(["export", str(path), *words]) == 0
    texts = pq.read_table(tmp_path / "all/meta/episodes").to_pydict()["tasks"]
    assert texts == [["Slide it"]] * 3


def test_the_seed_chooses_among_a_task_s_phrasings(tmp_path):
    path = record(tmp_path / "put.h5", "CellPutAndClose-v1", [1, 1, 1])  # of seeds 10, 11, 12
    export(Export(path, "lerobot", tmp_path / "out", include_failures=True))
    texts = pq.read_table(tmp_path / "out/meta/episodes").to_pydict()["tasks"]
    phrasings = tasks.get_task_class("CellPutAndClose-v1").instruction
    assert texts == [[phrasings[1]], [phrasings[2]], [phrasings[0]]]


class Spoken(tasks.get_task_class("PushT-v1")):
    """Push something."""

    instruction = "Push the T onto its goal."


def test_a_task_may_say_its_own_instruction():
    from tasks.description import instruction_of

    assert instruction_of(Spoken) == "Push the T onto its goal."
    assert instruction_of(tasks.get_task_class("PickCube-v1")).startswith("Grasp a cube")
    with pytest.raises(TaskError, match="instruction is 5; a sentence is needed"):
        type("Mute", (Spoken,), {"instruction": 5})(Spoken.scenario)


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        ({"depth": True}, "depth is of no use without cameras"),
        ({"images": True, "video": True, "cameras": "all"}, "either a video or images"),
        ({"cameras": []}, "no camera is named"),
        ({"cameras": "all", "size": (8, 0)}, "size is 0; it must be an integer from 1"),
        ({"cameras": "all", "format": "robomimic", "images": True}, "has no images here"),
    ],
)
def test_options_that_make_no_sense(tmp_path, options, complaint):
    wanted = {"format": "lerobot", "out": tmp_path / "out", **options}
    with pytest.raises(TaskError, match=complaint):
        export(Export(tmp_path / "none.h5", **wanted, include_failures=True))


def test_cameras_are_chosen_by_place():
    two = tasks.make(TASK, robots=ROBOTS, obs_mode="none")
    assert [*choose_shots(two, ["all"]).cameras] == [*NATIVE]
    shots = choose_shots(two, ["right.hand_camera", "overview"], size=SIZE, depth=True)
    assert shots.channels == [
        PictureChannel("overview", "rgb", 512, 512),
        PictureChannel("right.hand_camera", "rgb", 32, 24),
        PictureChannel("right.hand_camera", "depth", 32, 24),
    ]
    with pytest.raises(UnknownNameError, match="'left.hand_camera'") as refused:
        choose_shots(two, ["left.hand_camer"])
    assert refused.value.choices == ("all", "overview", *NATIVE)
    with pytest.raises(TaskError, match="the overview has neither"):
        choose_shots(two, ["overview"], size=SIZE)


@pytest.mark.parametrize("name", ["left.hand_camera", "left_hand_camera", "overview", "a/b"])
def test_names_that_cannot_be_told_apart_are_refused(name):
    camera = Camera((0.0, 0.0, 1.0), (0.1, 0.0, 0.0), name=name)
    task = tasks.make(TASK, robots=ROBOTS, obs_mode="none", cameras=[camera])
    if name != "left_hand_camera":
        with pytest.raises(TaskError, match="would both be called|takes no '/'"):
            choose_shots(task, ["all"])
    if name in ("left.hand_camera", "left_hand_camera"):
        with pytest.raises(TaskError, match="would both be called"):
            tasks.make(TASK, robots=ROBOTS, obs_mode="robomimic+cameras", cameras=[camera])


def test_videos_have_even_sides(tmp_path):
    from robot_layouts.data.export.lerobot_files import PictureWriter

    channels = [PictureChannel("a", "rgb", 15, 16)]
    with pytest.raises(TaskError, match="a have 15 × 16 pixels; videos need even numbers"):
        PictureWriter(tmp_path, channels, 20, FileLimits(), images=False)
    PictureWriter(tmp_path, channels, 20, FileLimits(), images=True)


@dataclass
class Struck:
    """Two processes, one of which dies while it draws."""

    folder: Path

    def run(self, prepare, seeds):
        return ProcessExecutor(2).run(DiesAmidAnEpisode(prepare, self.folder), seeds)


@drawn
@pytest.mark.long
@pytest.mark.parametrize(
    "options", [{"format": "robomimic", "depth": True}, {"format": "lerobot"}], ids=["rm", "lr"]
)
def test_it_does_not_matter_who_draws(recording, tmp_path, options):
    files, told = [], []
    for executor in (None, ProcessExecutor(1), Struck(tmp_path)):
        out = tmp_path / f"{len(files)}"
        wanted = Export(
            recording, out=out, cameras="all", size=SIZE, **options, include_failures=True
        )
        export(wanted, executor=executor, tell=told.append)
        found = {
            path.relative_to(out): path.read_bytes() for path in out.rglob("*") if path.is_file()
        }
        files.append(found)
    assert files[0] == files[1] == files[2]
    assert sum("another takes its place" in text for text in told) == 1


@drawn
@pytest.mark.long
def test_a_cluster_draws_the_same(recording, robomimic, tmp_path):
    from robot_layouts.data.playing.ray_executor import RayExecutor

    with running_cluster() as nodes:
        nodes.grow(1)
        wanted = Export(
            recording,
            "robomimic",
            tmp_path / "out",
            cameras="all",
            depth=True,
            size=SIZE,
            include_failures=True,
        )
        export(wanted, executor=RayExecutor(nodes.address))
    name = "image.hdf5"
    assert (tmp_path / "out" / name).read_bytes() == (robomimic / name).read_bytes()

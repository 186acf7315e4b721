"""`obs_mode="lerobot"` and `"robomimic"` observe what exports of the same episode hold."""

import gymnasium
import h5py
import numpy as np
import pyarrow.parquet as pq
import pytest

import tasks
from robot_layouts.data import evaluate
from robot_layouts.data.export.columns import ColumnReader
from robot_layouts.data.export.dataset import Export, export
from robot_layouts.data.export.drawing import Drawing
from robot_layouts.data.export.shots import choose_shots
from robot_layouts.data.reading.recorded_task import task_for
from robot_layouts.data.reading.recording import Recording
from robot_layouts.simulation.rendering import vulkan_problem
from robots import TaskError
from tests.data.recordings import SECOND, TWO_ROBOTS, record

LENGTHS = [12, 5]
RECORDED = [
    (TWO_ROBOTS, SECOND),
    ("PickCubeSO100-v1", None),  # joints in another order than native's
    ("PegInsertionSide-v1", None),  # bodies that a reset makes
    ("PushT-v1", None),
]
REBUILT = {"reconfigure": True}  # as episodes are recorded


@pytest.fixture(scope="module", params=RECORDED, ids=[task for task, _ in RECORDED])
def recording(request, tmp_path_factory):
    task_id, robots = request.param
    return record(
        tmp_path_factory.mktemp("one") / "one.h5", task_id, LENGTHS, robots
    ), request.param


def lerobot(file, folder):
    """Return actions and observations of each episode of an export, (T, k)."""
    export(Export(file, "lerobot", folder, include_failures=True))
    table = pq.read_table(folder / "data")
    columns = {
        name: np.array(table[name].to_pylist(), np.float32)
        for name in table.column_names
        if name == "action" or name.startswith("observation.")
    }
    episode = np.array(table["episode_index"])
    for i in range(len(LENGTHS)):
        own = {name: rows[episode == i] for name, rows in columns.items()}
        yield own.pop("action"), own


def robomimic(file, folder):
    export(Export(file, "robomimic", folder, include_failures=True))
    with h5py.File(folder / "low_dim.hdf5") as data:
        for i in range(len(LENGTHS)):
            demo = data[f"data/demo_{i}"]
            yield demo["actions"][:], {name: rows[:] for name, rows in demo["obs"].items()}


@pytest.mark.parametrize("exported", [lerobot, robomimic])
def test_the_columns_of_an_export_step_by_step(recording, exported, tmp_path):
    file, (task_id, robots) = recording
    env = gymnasium.make(
        f"RobotLayouts/{task_id}",
        obs_mode=exported.__name__,
        robots=robots,
        disable_env_checker=True,
    )
    for i, (actions, columns) in enumerate(exported(file, tmp_path / "out")):
        assert len(actions) == LENGTHS[i]
        obs, _ = env.reset(seed=10 + i, options=REBUILT)
        assert {*obs} == {*columns}
        for t, action in enumerate(actions):
            assert env.observation_space.contains(obs)
            for name, rows in columns.items():
                assert obs[name].tobytes() == rows[t].tobytes(), (i, t, name)
            obs, *_ = env.step(action)


@pytest.mark.long
@pytest.mark.parametrize("task_id", ["PushCube-v1", TWO_ROBOTS])
def test_the_pictures_that_an_export_films(task_id, tmp_path):
    if problem := vulkan_problem():
        pytest.skip(problem)
    task = tasks.make(task_id, obs_mode="lerobot+video")
    task.reset(seed=99)  # as another world it draws the same
    with Recording(record(tmp_path / "one.h5", task_id, [4, 3])) as file:
        drawn = task_for(file, pictures=True)
        for trajectory in file:
            columns = ColumnReader(drawn).read(trajectory)
            obs, _ = task.reset(seed=trajectory.seed, options=REBUILT)
            shots = choose_shots(drawn, ["overview"])
            frames = Drawing(drawn, columns, shots)
            for frame, action in zip(frames, trajectory.actions, strict=True):
                (picture,) = frame.values()
                assert picture.std() > 10
                np.testing.assert_array_equal(obs["observation.images.overview"][0], picture)
                obs, *_ = task.step(action[None])


@pytest.mark.parametrize("obs_mode", ["lerobot", "robomimic"])
def test_a_vector_observes_the_same(obs_mode):
    vector = gymnasium.make_vec(
        "RobotLayouts/PickCube-v1", num_envs=2, num_workers=0, obs_mode=obs_mode
    )
    task = tasks.make("PickCube-v1", num_envs=2, obs_mode=obs_mode)
    many, _ = vector.reset(seed=3)
    same, _ = task.reset(seed=3)
    for _ in range(5):
        for name, rows in same.items():
            np.testing.assert_array_equal(many[name], rows.numpy())
        action = vector.action_space.sample()
        many, same = vector.step(action)[0], task.step(action)[0]


def test_a_policy_is_evaluated_with_it():
    def policy(obs):
        assert {*obs} == {"arm_qpos", "arm_qvel", "arm_tcp_pose", "object"}
        return np.zeros((1, 8), np.float32)

    found = evaluate(policy, "PushCube-v1", [0], workers=0, obs_mode="robomimic")
    assert found.lengths == {0: 50}


def test_robots_that_observe_for_themselves_have_no_such_columns():
    with pytest.raises(TaskError, match="takes no obs_mode='lerobot'"):
        tasks.parallel_env(TWO_ROBOTS, obs_mode="lerobot")

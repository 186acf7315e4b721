"""Recorded episodes are read as they were written, and every damage is told in words."""

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest

import tasks
from layouts import Layout
from robot_layouts.data.reading.json_files import TrajectoryError
from robot_layouts.data.reading.recording import Recording
from robot_layouts.data.recording.recorder import Recorder
from robots import LocalUrdf, RobotRegistry
from tasks.episode import play
from tests.data.recordings import edited

TASK = "PushT-v1"


@pytest.fixture(scope="module")
def episodes():
    env = tasks.make(TASK)
    rng = np.random.default_rng(0)
    return env, [
        play(env, seed, rng.uniform(-1, 1, (4 + seed, 7)).astype(np.float32)) for seed in (0, 1, 2)
    ]


@pytest.fixture
def path(episodes, tmp_path):
    env, played = episodes
    with Recorder(tmp_path / "trajectory.h5", env) as recorder:
        for episode in played:
            recorder.add(episode)
    return recorder.path


def edit_json(path, edit):
    beside = path.with_suffix(".json")
    summary = json.loads(beside.read_text())
    edit(summary)
    beside.write_text(json.dumps(summary))


def read_all(path):
    with Recording(path) as file:
        return list(file)


def test_what_was_recorded_is_read(episodes, path):
    with Recording(path) as file:
        assert (file.task_id, file.control_mode, file.max_episode_steps) == (
            *(TASK, "pd_joint_delta_pos", 100),
        )
        assert file.env_kwargs["sim_backend"] == "physx_cpu"
        assert file.source_type == "scripted"
        assert file.action_split == {"arm": slice(0, 7)}
        assert file.layout is not None
        assert file.layout["arm"]["robot"] == "panda_stick"
        assert file.seeds == (0, 1, 2)
        assert len(file) == 3
        assert [t.seed for t in file[1:]] == [1, 2]
        assert file[-1].episode_id == 2
        with pytest.raises(IndexError):
            file[3]
        for episode, read in zip(episodes[1], file, strict=True):
            np.testing.assert_array_equal(read.actions, episode.actions)
            for name in ("rewards", "success", "terminated", "truncated"):
                column = getattr(read, name)
                np.testing.assert_array_equal(column, getattr(episode, name))
                assert column.dtype == getattr(episode, name).dtype
            assert read.states is not None
            for kind, entries in episode.states.items():
                for name, rows in entries.items():
                    np.testing.assert_array_equal(read.states[kind][name], rows)


def test_what_a_file_lacks_is_none(path):
    with edited(path) as file:
        for name in ("env_states", "rewards", "success", "terminated", "truncated"):
            del file[f"traj_0/{name}"]
        del file.attrs["layout"], file.attrs["simulation"]
    with Recording(path) as file:
        assert (file.layout, file.action_split, file.simulation) == (None, None, None)
        file.expect_world(tasks.make(TASK))
        first = file[0]
    assert [first.states, first.rewards, first.success, first.terminated] == [None] * 4


def change(name, value, episode=0):
    def edit(path):
        with edited(path) as file:
            del file[f"traj_{episode}/{name}"]
            if isinstance(value, dict):
                for key, array in value.items():
                    file[f"traj_{episode}/{name}/{key}"] = array
            elif value is not None:
                file[f"traj_{episode}/{name}"] = value

    return edit


@pytest.mark.parametrize(
    ("edit", "complaint"),
    [
        (change("actions", None), r"traj_0 of .*trajectory.h5 cannot be played: it has no actions"),
        (change("actions", np.zeros(4)), r"shape \(4,\), not \(T, A\)"),
        (change("actions", np.zeros((0, 7))), r"shape \(0, 7\), not \(T, A\)"),
        (change("actions", np.full((4, 7), np.nan)), "not all finite"),
        (change("actions", np.zeros((4, 7), int)), "floating-point"),
        (
            change("actions", {"panda-0": np.zeros((4, 8)), "panda-1": np.zeros((4, 8))}),
            r"by robot \(panda-0, panda-1\), not one flat array",
        ),
        (change("success", np.zeros(9, bool)), r"success has shape \(9,\), not \(4,\)"),
        (
            change("env_states/actors/Tee", np.zeros((4, 13))),
            r"states of Tee have shape \(4, 13\), not \(5, k\)",
        ),
        (change("actions", np.zeros((4, 8))), r"shape \(4, 8\), not \(T, 7\): the robots are"),
    ],
)
def test_an_episode_that_cannot_be_played(path, edit, complaint):
    edit(path)
    with Recording(path) as file, pytest.raises(TrajectoryError, match=complaint):  # noqa: PT012
        file.expect(TASK, 7)
        list(file)


def set_mode(mode):
    def edit(summary):
        summary.pop("layout", None)  # as in a file of ManiSkill's
        for episode in summary["episodes"]:
            episode["control_mode"] = mode

    return edit


def mix_modes(summary):
    summary["episodes"][1]["control_mode"] = "pd_joint_pos"


@pytest.mark.parametrize(
    ("edit", "complaint"),
    [
        (set_mode("pd_ee_dance"), "recorded in pd_ee_dance; an episode can be played in"),
        (set_mode({"a-0": "pd_joint_pos", "b-1": "pd_ee_dance"}), "pd_ee_dance and pd_joint_pos"),
        (mix_modes, "recorded in pd_joint_delta_pos and pd_joint_pos"),
        (lambda summary: summary.pop("episodes"), "has no episodes"),
        (lambda summary: summary["env_info"].pop("env_id"), "has no env_info.env_id;"),
        (lambda summary: summary["episodes"].append({"seed": 1}), "not a demonstration's json"),
        (lambda summary: summary["episodes"].append({"episode_id": 1}), "lists an episode twice"),
        (lambda summary: summary["episodes"].append({"episode_id": 9}), "traj_9 .* not in the"),
    ],
)
def test_a_json_that_does_not_fit(path, edit, complaint):
    edit_json(path, edit)
    with pytest.raises(TrajectoryError, match=complaint):
        read_all(path)


def test_the_environment_names_the_control_mode_if_episodes_do_not(path):
    def move(summary):
        for episode in summary["episodes"]:
            del episode["control_mode"]
        summary["env_info"]["env_kwargs"]["control_mode"] = "pd_joint_pos"

    edit_json(path, move)
    assert {t.control_mode for t in read_all(path)} == {"pd_joint_pos"}
    edit_json(path, lambda summary: summary["env_info"].pop("env_kwargs"))
    with pytest.raises(TrajectoryError, match="in no control mode that it names"):
        Recording(path)


def test_another_task_or_no_episodes(path):
    with (
        Recording(path) as file,
        pytest.raises(TrajectoryError, match=r"recorded in PushT-v1, not in PickCube-v1"),
    ):
        file.expect("PickCube-v1", 8)
    edit_json(path, lambda summary: summary["episodes"].clear())
    with Recording(path) as file, pytest.raises(TrajectoryError, match="holds no episodes"):
        file.expect(TASK, 7)


class TestOtherWorlds:
    """A replay where anything that physics depends on differs is refused, and it is named."""

    def refusal(self, path, env):
        with Recording(path) as file, pytest.raises(TrajectoryError) as caught:
            file.expect_world(env)
        return str(caught.value)

    def test_another_robot(self, path):
        panda = replace(RobotRegistry.load("panda"), name="my_panda")
        panda = replace(panda, keyframes={**panda.keyframes, "push_start": (0.0,) * 9})
        said = self.refusal(path, tasks.make(TASK, robots=panda))
        assert "recorded in another world than this PushT-v1" in said
        assert 'arm.robot: recorded "panda_stick", here "my_panda"' in said
        assert "; and " in said

    def test_another_place(self, path):
        placement = replace(tasks.get_task_class(TASK).layout["arm"], position=(-0.6, 0.0, 0.0))
        said = self.refusal(path, tasks.make(TASK, layout=Layout({"arm": placement})))
        assert said.endswith("arm.position: recorded [-0.615, 0.0, 0.0], here [-0.6, 0.0, 0.0]")

    def test_another_drive(self, path):
        stick = RobotRegistry.load("panda_stick")
        stiff = replace(stick.action_split.groups["arm"], stiffness=1010.0)
        robot = replace(stick, action_split=stick.action_split.replace(arm=stiff))
        said = self.refusal(path, tasks.make(TASK, robots=robot))
        assert said.endswith("arm.joint_groups.arm.stiffness: recorded 1000.0, here 1010.0")

    def test_other_robot_files(self, path, tmp_path):
        folder = shutil.copytree(
            RobotRegistry.load("panda_stick").urdf.locate().parent, tmp_path / "panda"
        )
        urdf = folder / "panda_stick.urdf"
        copied = replace(RobotRegistry.load("panda_stick"), urdf=LocalUrdf(urdf))
        with Recording(path) as file:
            file.expect_world(tasks.make(TASK, robots=copied))  # the place makes no difference
        urdf.write_text(urdf.read_text().replace("</robot>", "<!-- changed --></robot>"))
        said = self.refusal(path, tasks.make(TASK, robots=copied))
        assert "arm.assets: recorded" in said

    def test_other_physics(self, path):
        physics = replace(tasks.get_task_class(TASK).physics, position_iterations=14)
        said = self.refusal(path, tasks.make(TASK, physics=physics))
        assert said.endswith("physics.position_iterations: recorded 15, here 14")


def test_a_json_of_an_earlier_moment(path):
    def swap(summary):
        first, second, _ = summary["episodes"]
        first["episode_seed"], second["episode_seed"] = 1, 0

    edit_json(path, swap)
    with pytest.raises(TrajectoryError, match=r"the json beside it says seed 1, the file 0: .*re"):
        read_all(path)


def test_a_json_or_a_file_that_is_not_there(path):
    with pytest.raises(TrajectoryError, match=r"no file .*trajectry.h5; did you mean .*tory.h5"):
        Recording(path.with_name("trajectry.h5"))
    path.with_suffix(".json").rename(path.with_name("other.json"))
    with pytest.raises(TrajectoryError, match=r"cannot read .*trajectory.json, which belongs"):
        Recording(path)

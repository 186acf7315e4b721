"""Where episodes come from, and what is said about files that hold none."""

import json

import h5py
import numpy as np
import pytest

import tasks
from parity.compare.episodes import (
    find_demonstrations,
    load_episodes,
    random_episodes,
    recorded_episodes,
)
from rollouts.reading.recording import TrajectoryError

TASK = "PickCube-v1"


def demonstration(folder, name="trajectory", env_id=TASK, width=8, **changes):
    """Write a demonstration of two episodes in ManiSkill's format; return its path."""
    folder.mkdir(parents=True, exist_ok=True)
    episodes = [
        {
            "episode_id": number,
            "control_mode": "pd_joint_delta_pos",
            "reset_kwargs": {"seed": 40 + number, "options": None},
            **changes,
        }
        for number in (0, 1)
    ]
    about = {"env_info": {"env_id": env_id}, "episodes": episodes}
    path = folder / f"{name}.h5"
    path.with_suffix(".json").write_text(json.dumps(about))
    with h5py.File(path, "w") as file:
        for number in (0, 1):
            file[f"traj_{number}/actions"] = np.full((3 + number, width), number, np.float32)
    return path


def test_random_episodes_are_seeded_and_partly_out_of_range():
    first, second = random_episodes([4, 5], 50, 8)
    again = random_episodes([5], 50, 8)[0]
    np.testing.assert_array_equal(second.actions, again.actions)
    assert (first.seed, second.seed) == (4, 5)
    assert first.actions.shape == (50, 8)
    assert first.actions.dtype == np.float32
    assert not np.array_equal(first.actions, second.actions)
    assert abs(first.actions[20:30]).max() > 2.5
    assert abs(np.delete(first.actions, slice(20, 30), axis=0)).max() <= 1


def test_demonstrations(tmp_path):
    first, second = load_episodes(demonstration(tmp_path), TASK, 8)
    assert (first.seed, second.seed) == (40, 41)
    assert first.actions.shape == (3, 8)
    np.testing.assert_array_equal(second.actions, np.ones((4, 8), np.float32))


def test_a_control_mode_of_other_width(tmp_path):
    path = demonstration(tmp_path, width=7, control_mode="pd_ee_delta_pose")
    episodes, mode = recorded_episodes(path, tasks.get_task_class(TASK))
    assert mode == "pd_ee_delta_pose"
    assert episodes[1].actions.shape == (4, 7)


def test_seed_in_a_list_and_control_mode_by_robot(tmp_path):
    path = demonstration(
        tmp_path,
        reset_kwargs={"seed": [9]},
        control_mode={"panda-0": "pd_joint_delta_pos", "panda-1": "pd_joint_delta_pos"},
    )
    assert [episode.seed for episode in load_episodes(path, TASK, 8)] == [9, 9]


def test_arrays(tmp_path):
    path = tmp_path / "actions.npz"
    np.savez(path, seeds=[3, 1], a0=np.zeros((2, 8)), a1=np.ones((5, 8), np.float32))
    first, second = load_episodes(path, TASK, 8)
    assert (first.seed, second.seed) == (3, 1)
    assert first.actions.dtype == second.actions.dtype == np.float32
    assert second.actions.shape == (5, 8)


def test_find_demonstrations(tmp_path):
    push = demonstration(tmp_path / "push" / "planned", env_id="PushT-v1")
    pick = demonstration(tmp_path / "pick")
    assert find_demonstrations(tmp_path) == {"PushT-v1": [push], TASK: [pick]}
    with pytest.raises(TrajectoryError, match="there is no folder"):
        find_demonstrations(tmp_path / "nowhere")


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"env_id": "PushT-v1"}, "was recorded in PushT-v1, not in PickCube-v1"),
        ({"control_mode": "pd_ee_dance"}, "recorded in pd_ee_dance"),
        ({"reset_kwargs": {}}, "no reset seed"),
        ({"reset_kwargs": {"seed": [1, 2]}}, "no reset seed"),
    ],
)
def test_demonstrations_that_do_not_fit(tmp_path, changes, complaint):
    with pytest.raises(TrajectoryError, match=complaint):
        load_episodes(demonstration(tmp_path, **changes), TASK, 8)


def test_an_episode_that_is_listed_but_absent(tmp_path):
    path = demonstration(tmp_path)
    with h5py.File(path, "a") as file:
        del file["traj_1"]
    with pytest.raises(TrajectoryError, match=r"traj_1 .* not in the file"):
        load_episodes(path, TASK, 8)


def test_actions_of_another_robot(tmp_path):
    with pytest.raises(TrajectoryError, match=r"traj_0 .* shape \(3, 8\), not \(T, 16\)"):
        load_episodes(demonstration(tmp_path), TASK, 16)


def test_actions_by_robot_are_refused(tmp_path):
    path = demonstration(tmp_path)
    with h5py.File(path, "w") as file:
        file["traj_0/actions/panda-0"] = np.zeros((3, 8))
    with pytest.raises(TrajectoryError, match=r"by robot \(panda-0\), not one flat array"):
        load_episodes(path, TASK, 8)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_actions_that_are_not_finite(tmp_path, bad):
    np.savez(tmp_path / "a.npz", seeds=[0], a0=np.full((2, 8), bad))
    with pytest.raises(TrajectoryError, match="not all finite"):
        load_episodes(tmp_path / "a.npz", TASK, 8)


def test_a_missing_file_names_its_neighbour(tmp_path):
    demonstration(tmp_path)
    with pytest.raises(TrajectoryError, match=r"no file .*trajectry.h5; did you mean .*y.h5"):
        load_episodes(tmp_path / "trajectry.h5", TASK, 8)


def test_unknown_kind(tmp_path):
    (tmp_path / "actions.csv").write_text("1,2")
    with pytest.raises(TrajectoryError, match=r"unknown kind '.csv'; known are .h5, .npz"):
        load_episodes(tmp_path / "actions.csv", TASK, 8)


@pytest.mark.parametrize("name", ["garbage.h5", "garbage.npz"])
def test_garbage(tmp_path, name):
    demonstration(tmp_path, "garbage")
    (tmp_path / name).write_bytes(b"this is neither")
    with pytest.raises(TrajectoryError, match="no readable episodes"):
        load_episodes(tmp_path / name, TASK, 8)


def test_a_truncated_file(tmp_path):
    path = demonstration(tmp_path)
    path.write_bytes(path.read_bytes()[:-200])
    with pytest.raises(TrajectoryError, match="no readable episodes"):
        load_episodes(path, TASK, 8)


def test_json_missing_or_foreign(tmp_path):
    path = demonstration(tmp_path)
    path.with_suffix(".json").write_text('{"something": "else"}')
    with pytest.raises(TrajectoryError, match=r"is not a demonstration's json"):
        load_episodes(path, TASK, 8)
    path.with_suffix(".json").unlink()
    with pytest.raises(TrajectoryError, match=r"cannot read .*trajectory.json"):
        load_episodes(path, TASK, 8)


@pytest.mark.parametrize(
    ("arrays", "complaint"),
    [
        ({"a0": np.zeros((2, 8))}, "no array 'seeds'; it has a0"),
        ({"seeds": [0, 1], "a0": np.zeros((2, 8))}, "2 seeds but no actions a1"),
        ({"seeds": np.zeros(0, int)}, "holds no episodes"),
        ({"seeds": [0], "a0": np.zeros((0, 8))}, r"shape \(0, 8\)"),
        ({"seeds": [0], "a0": np.zeros((2, 8), int)}, "floating-point"),
    ],
)
def test_arrays_that_do_not_fit(tmp_path, arrays, complaint):
    np.savez(tmp_path / "a.npz", **arrays)
    with pytest.raises(TrajectoryError, match=complaint):
        load_episodes(tmp_path / "a.npz", TASK, 8)

"""Where episodes come from."""

import json

import h5py
import numpy as np
import pytest

import tasks
from parity.episodes import (
    find_demonstrations,
    load_episodes,
    over_range_episodes,
    random_episodes,
    recorded_source,
)
from robot_layouts.data.reading.json_files import TrajectoryError
from robots import TaskError

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


def test_over_range_actions_go_beyond_in_both_directions():
    first, second = over_range_episodes([3, 4], 50, 8)
    assert first.actions.shape == (50, 8)
    assert first.actions.dtype == np.float32
    assert (first.seed, second.seed) == (3, 4)
    assert not np.array_equal(first.actions, second.actions)
    assert -3 <= first.actions.min() < -2.5
    assert 2.5 < first.actions.max() <= 3
    assert 0.5 < (np.abs(first.actions) > 1).mean() < 0.8


def test_demonstrations(tmp_path):
    first, second = load_episodes(demonstration(tmp_path), TASK, 8)
    assert (first.seed, second.seed) == (40, 41)
    assert first.actions.shape == (3, 8)
    np.testing.assert_array_equal(second.actions, np.ones((4, 8), np.float32))


def test_a_control_mode_of_other_width(tmp_path):
    path = demonstration(tmp_path, width=7, control_mode="pd_ee_delta_pose")
    source = recorded_source(path, tasks.get_task_class(TASK))
    assert source.control_mode == "pd_ee_delta_pose"
    assert source.name == f"{tmp_path.name}/trajectory"
    assert source.episodes[1].actions.shape == (4, 7)
    with pytest.raises(TaskError, match=r"recorded in pd_ee_delta_pose; leave --control-mode pd_j"):
        recorded_source(path, tasks.get_task_class(TASK), "pd_joint_pos")


def test_seed_in_a_list_and_control_mode_by_robot(tmp_path):
    path = demonstration(
        tmp_path,
        reset_kwargs={"seed": [9]},
        control_mode={"panda-0": "pd_joint_delta_pos", "panda-1": "pd_joint_delta_pos"},
    )
    assert [episode.seed for episode in load_episodes(path, TASK, 8)] == [9, 9]


def test_find_demonstrations(tmp_path):
    push = demonstration(tmp_path / "push" / "planned", env_id="PushT-v1")
    pick = demonstration(tmp_path / "pick")
    assert find_demonstrations(tmp_path) == {"PushT-v1": [push], TASK: [pick]}
    with pytest.raises(TrajectoryError, match="there is no folder"):
        find_demonstrations(tmp_path / "nowhere")

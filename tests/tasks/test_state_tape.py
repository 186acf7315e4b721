"""A tape of states holds what the state dicts say, of every task."""

import numpy as np
import pytest

import tasks
from tasks.native import format as native_format
from tests.quick import quick_cases


@pytest.mark.parametrize("task_id", quick_cases(tasks.list_tasks()))
def test_a_tape_is_a_row_of_state_dicts(task_id, monkeypatch):
    monkeypatch.setattr(native_format, "_MOMENTS", 3)  # so that it has to be made longer
    env = tasks.make(task_id, num_envs=2)
    env.reset(3)
    rng = np.random.default_rng(0)
    tape, moments = env.begin_tape(), []
    for _ in range(4):
        env.write_tape(tape)
        moments.append(env.get_state_dict())
        env.step(rng.uniform(-1, 1, env.action_space.shape).astype(np.float32))
    read = tape.read()
    assert list(read) == list(moments[0])
    for kind, entries in read.items():
        assert list(entries) == list(moments[0][kind])
        for name, rows in entries.items():
            expected = np.stack([moment[kind][name].numpy() for moment in moments])
            np.testing.assert_array_equal(rows, expected)
            assert rows.dtype == np.float32
    movable = [rows[-1] - rows[0] for rows in read["articulations"].values()]
    assert any(np.abs(moved).max() > 0.01 for moved in movable), "nothing moved"


def test_a_tape_begins_with_states_that_were_set():
    env = tasks.make("TwoRobotPickCube-v1")
    env.reset(3)
    state = env.get_state_dict()
    for number, rows in enumerate((*state["actors"].values(), *state["articulations"].values())):
        rows[:, 7:13] = 0.01 * (number + 1)  # m/s, rad/s, of robots' roots too
    env.set_state_dict(state)
    tape, moments = env.begin_tape(), []
    for _ in range(3):
        env.write_tape(tape)
        moments.append(env.get_state_dict())
        env.step(np.zeros(env.layout.action_dim, np.float32))
    for kind, entries in tape.read().items():
        for name, rows in entries.items():
            expected = np.stack([moment[kind][name].numpy() for moment in moments])
            np.testing.assert_array_equal(rows, expected)
    roots = tape.read()["articulations"]["panda_wristcam-agent-1"][:, 0, 7:13]
    assert (roots[0] > 0.04).all()
    assert not roots[1:].any()

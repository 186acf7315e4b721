"""A tape of states holds what the state dicts say, of every task."""

import numpy as np
import pytest

import tasks


@pytest.mark.parametrize("task_id", tasks.list_tasks())
def test_a_tape_is_a_row_of_state_dicts(task_id):
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

"""Every task says what is wrong with bad input, and nothing has moved afterwards."""

import numpy as np
import pytest
import torch

import tasks
from robots import ActionError, TaskError, UnknownNameError
from tests.quick import quick_cases

TASKS = tasks.list_tasks()


@pytest.mark.parametrize("task_id", quick_cases(TASKS))
def test_robots_that_cannot_be(task_id: str):
    place = next(iter(tasks.get_task_class(task_id).layout))
    with pytest.raises(UnknownNameError, match="unknown robot 'pandda'. Did you mean 'panda'"):
        tasks.make(task_id, robots={place: "pandda"})
    with pytest.raises(UnknownNameError, match="robot of this layout 'nobody'"):
        tasks.make(task_id, robots={"nobody": "panda"})
    with pytest.raises(TaskError, match="reward_mode 'densest' is not offered; choices: None"):
        tasks.make(task_id, reward_mode="densest")


@pytest.mark.parametrize("task_id", quick_cases(TASKS))
def test_bad_calls_change_nothing(task_id: str):
    env = tasks.make(task_id, num_envs=2)
    env.reset(seed=0)
    before = env.get_state_dict()
    size = env.layout.action_dim
    name = list(env.layout)[-1]
    bad = torch.zeros(2, size)
    bad[1, -1] = torch.nan
    with pytest.raises(ActionError, match=f"action number {size - 1} is nan.*robot '{name}'"):
        env.step(bad)
    with pytest.raises(ActionError, match=rf"shape \(2, {size + 1}\); it must be \(2, {size}\)"):
        env.step(np.zeros((2, size + 1), np.float32))
    with pytest.raises(TaskError, match=r"env_ids \[2\] must be different numbers from 0 to 1"):
        env.reset(env_ids=[2])
    with pytest.raises(TaskError, match="1 seeds for 2 environments"):
        env.reset(seed=[0], options={"reconfigure": True})
    for group, entries in env.get_state_dict().items():
        for key, rows in entries.items():
            assert torch.equal(rows, before[group][key]), key

"""What tests of this project's own tasks share: bodies put where success is told from."""

from collections.abc import Iterable
from typing import Any

import torch

import tasks
from tasks import TaskEnv

UPRIGHT = (1.0, 0.0, 0.0, 0.0)


def make(task_id: str, **fields: object) -> TaskEnv:
    """Make a task and begin an episode."""
    env = tasks.make(task_id, **fields)
    env.reset(seed=0)
    return env


def put(env: TaskEnv, **poses: tuple[float, ...]) -> dict[str, torch.Tensor]:
    """Put bodies at poses (m, wxyz; turned upright if left out), at rest, and return the info."""
    state = env.get_state_dict()
    for body, pose in poses.items():
        row = torch.zeros(env.num_envs, 13)
        row[:, :7] = torch.tensor((*pose, *UPRIGHT)[:7])
        state["actors"][body] = row
    env.set_state_dict(state)
    return look(env)


def told(env: TaskEnv, flags: str, scenes: Iterable[dict[str, Any]]) -> list[list[bool]]:
    """Put bodies at poses, or their joints, and return what flags say of each scene."""
    world, found = env.simulation.worlds[0], []
    for scene in scenes:
        for body, place in scene.items():
            if isinstance(place, dict):
                world.set_joints(body, **place)
            else:
                world.set_pose(body, place[:3], place[3:] or UPRIGHT)
        info = look(env)
        found.append([info[flag].item() for flag in flags.split()])
    return found


def look(env: TaskEnv) -> dict[str, torch.Tensor]:
    """Return what the present state is judged as, without a step."""
    told = env.evaluate(env.simulation.read())
    return {key: torch.as_tensor(value) for key, value in told.items()}

"""What tests of tasks share: bodies put where success is told from, and a short recording."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import torch

import tasks
from robot_layouts.data.recording.recorder import Recorder
from tasks import TaskEnv
from tasks.episode import play

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


def recorded(task_id: str, folder: Path) -> Path:
    """Record two episodes of random actions."""
    path, random = folder / "trajectory.h5", np.random.default_rng(0)
    task = tasks.make(task_id, obs_mode="none")
    with Recorder(path, task) as recorder:
        for seed in (3, 5):
            actions = random.uniform(-1, 1, (20, task.layout.action_dim)).astype(np.float32)
            recorder.add(play(task, seed, actions))
    return path


def look(env: TaskEnv) -> dict[str, torch.Tensor]:
    """Return what the present state is judged as, without a step."""
    told = env.evaluate(env.simulation.read())
    return {key: torch.as_tensor(value) for key, value in told.items()}

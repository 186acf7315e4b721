"""A short recording of the tutorial's tray, whose arms carry cameras, and what is seen in it."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

import tasks
from robot_layouts.data.reading.recording import Trajectory
from robot_layouts.data.recording.recorder import Recorder
from tasks.episode import play

ROOT = Path(__file__).parents[3]
sys.path.insert(0, str(ROOT / "docs" / "tutorials"))

TASK = "tray:TwoArmTray-v1"
TEXT = "Lift a tray with a gripper at each end, level, to 20 cm."
ROBOTS = {"left": "panda_wristcam", "right": "panda_wristcam"}
SIZE = (48, 32)
CAMERAS = ("base_camera", "left.hand_camera", "right.hand_camera")
LENGTHS = [4, 2]


def record(path: Path) -> Path:
    """Record episodes of random actions."""
    task, rng = tasks.make(TASK, robots=ROBOTS, obs_mode="none"), np.random.default_rng(0)
    path.parent.mkdir(parents=True)
    with Recorder(path, task) as recorder:
        for seed, steps in enumerate(LENGTHS):
            shape = steps, task.layout.action_dim
            recorder.add(play(task, seed, rng.uniform(-1, 1, shape).astype(np.float32)))
    return path


def environment(obs_mode: str) -> tasks.MultiRobotTask:
    """Return the task as it observes with an export's cameras."""
    return tasks.make(TASK, robots=ROBOTS, obs_mode=obs_mode, camera_size=SIZE)


def observed(env: tasks.MultiRobotTask, episode: Trajectory) -> Iterator[dict[str, Any]]:
    """Give what an environment observes before each step of an episode, and after the last."""
    obs, _ = env.reset(seed=episode.seed, options={"reconfigure": True})
    yield {key: value[0].numpy() for key, value in obs.items()}
    for action in episode.actions:
        obs, *_ = env.step(action[None])
        yield {key: value[0].numpy() for key, value in obs.items()}

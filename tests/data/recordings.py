"""Short recordings of random actions to export, and what they hold, read without our reader."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np

import tasks
from robot_layouts.data.recording.recorder import Recorder
from tasks.episode import play

TWO_ROBOTS, SECOND = "TwoRobotPickCube-v1", {"right": "panda_stick"}  # 8 + 7 action numbers
LEFT_KEY, RIGHT_KEY = "panda_wristcam-agent-0", "panda_stick-agent-1"
PANDA_ARM = [f"panda_joint{i}" for i in range(1, 8)]
FINGERS = ["panda_finger_joint1", "panda_finger_joint2"]


def record(
    path: Path, task_id: str, lengths: list[int], robots: Any = None, *, first: int = 10
) -> Path:
    """Record episodes of random actions; that with ``lengths[i]`` steps has seed ``first`` + i."""
    task = tasks.make(task_id, robots=robots, obs_mode="none")
    rng = np.random.default_rng(0)
    with Recorder(path, task) as recorder:
        for i, steps in enumerate(lengths):
            actions = rng.uniform(-1, 1, (steps, task.layout.action_dim)).astype(np.float32)
            recorder.add(play(task, first + i, actions))
    return path


@contextmanager
def edited(path: Path) -> Iterator[h5py.File]:
    """Open a recording to change it on purpose, which its checksums would otherwise give away."""
    with h5py.File(path, "r+") as file:
        yield file
        for group in file.values():
            group.attrs.pop("checksum", None)


def succeed(path: Path, *episodes: int) -> None:
    """Write into a recording that the last step of some episodes was a success."""
    with edited(path) as file:
        for episode in episodes:
            file[f"traj_{episode}/success"][-1] = True


class Recorded(NamedTuple):
    """An episode as h5py reads it; states are by the last word of their name."""

    arrays: dict[str, np.ndarray]
    states: dict[str, np.ndarray]

    def qpos(self, key: str) -> np.ndarray:
        """Return joint positions, (T + 1, dof), in the order of the file."""
        return self.states[key][:, 13 : 13 + (self.states[key].shape[1] - 13) // 2]

    def qvel(self, key: str) -> np.ndarray:
        """Return joint velocities, (T + 1, dof), in the order of the file."""
        return self.states[key][:, 13 + (self.states[key].shape[1] - 13) // 2 :]

    def poses(self, *bodies: str) -> np.ndarray:
        """Return poses of bodies side by side, (T + 1, 7 · bodies)."""
        return np.concatenate([self.states[body][:, :7] for body in bodies], 1)


def read(path: Path) -> list[Recorded]:
    """Return every episode of a recording."""
    episodes = json.loads(path.with_suffix(".json").read_text())["episodes"]
    with h5py.File(path) as file:
        groups = [file[f"traj_{episode['episode_id']}"] for episode in episodes]
        return [
            Recorded(
                {name: group[name][()] for name in group if name != "env_states"},
                {
                    name: rows[()]
                    for entries in group["env_states"].values()
                    for name, rows in entries.items()
                },
            )
            for group in groups
        ]

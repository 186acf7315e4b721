"""Writes episodes in ManiSkill's own trajectory format, h5 with a json beside it."""

from __future__ import annotations

import json
import os
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any

import h5py

from layouts import Layout
from robots import RecordingError
from rollouts.episode import REBUILT, Episode
from tasks import MultiRobotTask
from tasks.native_format import observation_keys

COMPRESSION = {"compression": "gzip", "compression_opts": 4}


class Recorder:
    """A recording that grows by whole episodes; whatever ends it, the finished ones stay.

    In the h5 file ``traj_i`` holds the flat actions (T, A), env states (T + 1, k), rewards and
    flags (T,). Its attribute ``action_split`` is json: robot name → first and last + 1 action
    number. The file's attribute ``layout`` is json too; see `describe_layout`.

    Attributes:
        path: The h5 file.
        json_path: The json file beside it.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        task: MultiRobotTask,
        *,
        overwrite: bool = False,
        source: str = "scripted",
    ) -> None:
        """Begin a recording.

        Args:
            path: Name of the h5 file; its folder is made.
            task: The task whose episodes are recorded.
            overwrite: Whether a recording that is already there may be replaced.
            source: Where the actions come from, in ManiSkill's words (``source_type``).

        Raises:
            RecordingError: If the file is there already, or cannot be made.
        """
        self.path = Path(path)
        self.json_path = self.path.with_suffix(".json")
        if self.path.exists() and not overwrite:
            raise RecordingError(
                f"{self.path} is there already; choose another name, or pass overwrite=True"
            )
        self._control_mode = _control_mode(task)
        self._split = {n: [part.start, part.stop] for n, part in task.action_split.items()}
        layout = describe_layout(task.layout)
        self._summary: dict[str, Any] = {
            "env_info": {
                "env_id": task.task_id,
                "env_kwargs": {
                    "obs_mode": "none",
                    "reward_mode": task.reward_mode,
                    "control_mode": task.made_from.control_mode,
                    "sim_backend": "physx_cpu",
                },
                "max_episode_steps": task.max_episode_steps,
            },
            "episodes": [],
            "source_type": source,
            "layout": layout,
        }
        with _disk_errors(self.path):
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self.json_path.unlink(missing_ok=True)
            self._file = h5py.File(self.path, "w")
            self._file.attrs["layout"] = json.dumps(layout)
            self._file.flush()
            self._write_summary()

    def __enter__(self) -> Recorder:
        """Return itself."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Close the file."""
        self.close()

    def __len__(self) -> int:
        """Return the number of episodes recorded."""
        return len(self._summary["episodes"])

    def add(self, episode: Episode) -> None:
        """Write one episode; it is in both files when this returns.

        It becomes part of the h5 file in one small step after all its data are on disk, so that a
        process killed in between leaves the file as it was.

        Raises:
            RecordingError: If it cannot be written; the episodes before it stay.
        """
        number = len(self)
        with _disk_errors(self.path):
            group = self._file.create_group(None)
            self._fill(group, episode)
            self._file.flush()
            self._file[f"traj_{number}"] = group
            self._file.flush()
            self._summary["episodes"].append(
                {
                    "episode_id": number,
                    "episode_seed": episode.seed,
                    "control_mode": self._control_mode,
                    "elapsed_steps": len(episode.actions),
                    "reset_kwargs": {"seed": episode.seed, "options": REBUILT},
                    "success": episode.solved,
                }
            )
            self._write_summary()

    def close(self) -> None:
        """Close the h5 file; closing twice is allowed."""
        with _disk_errors(self.path):
            self._file.close()

    def _fill(self, group: h5py.Group, episode: Episode) -> None:
        group.attrs["action_split"] = json.dumps(self._split)
        group.create_dataset("actions", data=episode.actions, **COMPRESSION)
        for kind, entries in episode.states.items():
            for name, rows in entries.items():
                group.create_dataset(f"env_states/{kind}/{name}", data=rows, **COMPRESSION)
        for name in ("rewards", "success", "terminated", "truncated"):
            group.create_dataset(name, data=getattr(episode, name))

    def _write_summary(self) -> None:
        """Replace the json file in one step."""
        partial = self.json_path.with_name(f"{self.json_path.name}.{os.getpid()}.partial")
        partial.write_text(json.dumps(self._summary, indent=1) + "\n")
        os.replace(partial, self.json_path)


def describe_layout(layout: Layout) -> dict[str, dict[str, Any]]:
    """Return robot, base pose (m, wxyz), keyframe, noise (rad) and action numbers by robot name.

    Everything in it can be written as json; the order is that of the action numbers.
    """
    split = layout.action_split
    return {
        name: {
            "robot": placement.robot.name,
            "position": list(placement.base_position),
            "quaternion": list(placement.base_quaternion),
            "keyframe": placement.start_keyframe,
            "qpos_noise": placement.qpos_noise,
            "action": [split[name].start, split[name].stop],
        }
        for name, placement in layout.items()
    }


def _control_mode(task: MultiRobotTask) -> str | dict[str, str]:
    """Return the control mode as native writes it: by robot where there are several."""
    mode = task.made_from.control_mode
    keys = [key for key in observation_keys(task.layout).values() if key is not None]
    return dict.fromkeys(keys, mode) if keys else mode


@contextmanager
def _disk_errors(path: Path) -> Generator[None]:
    """Turn what the disk refuses into one of our errors; h5py says it in several ways."""
    try:
        yield
    except RecordingError:
        raise
    except (OSError, RuntimeError, ValueError) as error:
        raise RecordingError(f"cannot write {path}: {error}") from error

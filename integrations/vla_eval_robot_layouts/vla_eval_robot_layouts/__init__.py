"""Tasks of robot-layouts as a benchmark of vla-eval: ``vla_eval_robot_layouts:RobotLayouts``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from vla_eval.benchmarks.base import StepBenchmark, StepResult
from vla_eval.specs import IMAGE_RGB, LANGUAGE, DimSpec
from vla_eval.types import Action, EpisodeResult, Observation, Task

import tasks as our_tasks
from robot_layouts.data.playing.served.keys import Keys, vla_eval
from robots import TaskError
from tasks import TaskEnv
from tasks.interfaces.gymnasium import info_row
from tasks.language.stages import STAGE_SCORE

DEFAULT = ("CellSortCubes-v1", "CellLoadTray-v1", "CellPassAround-v1")
SUITE = "robot-layouts"
_STATE = "state"


class RobotLayouts(StepBenchmark):
    """Tasks with all their arms; see `vla_eval.benchmarks.base.StepBenchmark`.

    Episode i of a task is that of its seed ``first_seed`` + i, as `robot_layouts.evaluate` plays
    it. Policies see the pictures of all cameras, the instruction, and the joint positions of all
    robots, a number for each that drives joints (rad or m). Actions are those of all robots.
    """

    render_backends = frozenset({"gpu", "cpu"})

    @classmethod
    def configure_render(cls, mode: str) -> dict[str, str]:
        """Leave what draws as it is: SAPIEN takes the Vulkan driver that it finds."""
        return {}

    def __init__(
        self,
        tasks: Sequence[str] = DEFAULT,
        first_seed: int = 0,
        cameras: bool = True,
        making: dict[str, Any] | None = None,
    ) -> None:
        """Look the tasks up.

        Args:
            tasks: Their ids; ``module:Id`` for those of your own.
            first_seed: Seed of the first episode of each.
            cameras: Whether policies see pictures; they need a Vulkan driver.
            making: Other arguments of `tasks.make`, such as ``control_mode`` and ``camera_size``.

        Raises:
            UnknownNameError: If there is no such task.
            TaskError: If no task is named.
        """
        super().__init__()
        self._classes = {cls.task_id: cls for cls in map(our_tasks.get_task_class, tasks)}
        if not self._classes:
            raise TaskError("no task is named; tasks takes one or more ids")
        obs_mode = "rgb+state_dict" if cameras else "state_dict"
        self._making = {"obs_mode": obs_mode, **(making or {})}
        self._names = dict(zip(self._classes, tasks, strict=True))
        self._first, self._seed, self._cameras = first_seed, first_seed, cameras
        self._env: TaskEnv | None = None
        self._keys: Keys | None = None

    def get_tasks(self) -> list[Task]:
        """Return the tasks by their ids."""
        return [{"name": name, "suite": SUITE} for name in self._classes]

    def reset(self, task: Task) -> Any:
        """Begin an episode in a world that is built anew."""
        env = self._made(task["name"])
        self._seed = self._first + task.get("episode_idx", 0)
        obs, _ = env.reset(self._seed, {"reconfigure": True})
        self._recorder.record_video(self._frame(obs))
        return obs

    def step(self, action: Action) -> StepResult:
        """Advance by one control step; its action is ``actions``, (A,).

        Raises:
            ActionError: If that has the wrong shape or numbers that are not finite.
        """
        assert self._env is not None, "no episode has begun"
        numbers = np.array(action.get("actions"), np.float32)
        obs, reward, terminated, truncated, info = self._env.step(numbers)
        done, told = bool(terminated[0] or truncated[0]), info_row(info, self._seed)
        self._recorder.record_video(self._frame(obs))
        success = bool(told.get("success", False))
        self._recorder.record_step(reward=reward[0].item(), done=done, success=success)
        return StepResult(obs, reward[0].item(), done, told)

    def make_obs(self, raw_obs: Any, task: Task) -> Observation:
        """Return pictures by camera, joint positions, and what is to be done."""
        assert self._keys is not None, "no episode has begun"
        return self._keys.sent(raw_obs, self._seed)

    def get_step_result(self, step_result: StepResult) -> EpisodeResult:
        """Return whether the last step was a success, and how far the episode came in stages."""
        told = step_result.info
        found: EpisodeResult = {"success": bool(told.get("success", False))}
        if STAGE_SCORE in told:
            found[STAGE_SCORE] = float(told[STAGE_SCORE])
        return found

    def get_metric_keys(self) -> dict[str, str]:
        """Return success, and the score of stages if all tasks have some."""
        staged = all(cls.stages for cls in self._classes.values())
        return {"success": "mean", **({STAGE_SCORE: "mean"} if staged else {})}

    def get_action_spec(self) -> dict[str, DimSpec]:
        """Return how many numbers the actions of the first task have, and what they ask for."""
        env = self._made(next(iter(self._classes)))
        dims = env.single_action_space.shape[0] if len(self._classes) == 1 else 0
        return {"actions": DimSpec("actions", dims, str(env.control_mode))}

    def get_observation_spec(self) -> dict[str, DimSpec]:
        """Return what policies see."""
        pictures = {"image": IMAGE_RGB} if self._cameras else {}
        return {**pictures, _STATE: DimSpec(_STATE, 0, "joint_positions"), "language": LANGUAGE}

    def get_metadata(self) -> dict[str, Any]:
        """Return the most steps of any task; each ends by itself after its own."""
        own = self._making.get("max_episode_steps")
        steps = max(own or cls.max_episode_steps for cls in self._classes.values())
        return {"max_steps": steps, "first_seed": self._first}

    def cleanup(self) -> None:
        """Let the world go."""
        if self._env is not None:
            self._env.close()
        self._env = self._keys = None

    def _made(self, name: str) -> TaskEnv:
        """Return the environment of a task; one is kept."""
        if self._env is None or self._env.task_id != name:
            self.cleanup()
            env = our_tasks.make(self._names[name], **self._making)
            self._env = env
            self._keys = Keys(vla_eval(env), env)
        return self._env

    def _frame(self, obs: Any) -> Any:
        """Return the picture of the first camera for videos; None if there is none."""
        first = next(iter(obs.get("sensor_data", {}).values()), None)
        return None if first is None else first["rgb"][0].numpy(force=True)

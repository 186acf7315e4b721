"""Tasks of robot-layouts in Inspect Robots: a simulated embodiment, and a benchmark of seeds.

inspect-robots run --task robot_layouts --embodiment robot_layouts --policy …
"""

from __future__ import annotations

from typing import Any

import numpy as np
from inspect_robots.embodiment import (
    AUTO_RESET,
    PRIVILEGED_SUCCESS,
    RESETTABLE,
    SEEDABLE,
    EmbodimentInfo,
)
from inspect_robots.scene import Scene
from inspect_robots.spaces import (
    ActionSemantics,
    Box,
    CameraSpec,
    ObservationSpace,
    StateField,
    StateSpec,
)
from inspect_robots.task import Task
from inspect_robots.types import Action, Observation, StepResult

import tasks
from robot_layouts.data.playing.served.keys import Keys
from robots import TaskError
from tasks.description import instruction_of
from tasks.interfaces.gymnasium import info_row

DEFAULT = "TwoRobotPickCube-v1"
MODES = {
    "pd_joint_pos": "joint_pos",
    "pd_joint_delta_pos": "joint_delta",
    "pd_joint_vel": "joint_vel",
    "pd_ee_delta_pos": "eef_delta_pos",
}
"""Control modes that mean the same there."""
_SEEDS = 2**32  # as many as NumPy's generators take
_POSITIONS = "joint_pos"


class RobotLayouts:
    """All arms of a task as one embodiment; see `inspect_robots.embodiment.Embodiment`.

    An episode is that of its scene's seed, as `robot_layouts.evaluate` plays it.

    Attributes:
        info: Spaces, rate and names. The action numbers of all arms follow one another.
        env: The environment.
    """

    def __init__(self, task: str = DEFAULT, *, cameras: bool = False, **making: Any) -> None:
        """Make the task.

        Args:
            task: Its id; ``module:Id`` for one of your own.
            cameras: Whether policies see the pictures of its cameras and its robots'.
            making: Other arguments of `tasks.make`, such as ``control_mode`` and ``robots``.

        Raises:
            TaskError: If the task cannot be made like that, or its control mode has no name there.
        """
        obs_mode = "rgb+state_dict" if cameras else "state_dict"
        self.env = env = tasks.make(task, obs_mode=obs_mode, **making)
        mode = env.control_mode
        if mode not in MODES:
            raise TaskError(f"Inspect Robots has no {mode}; take one of {', '.join(MODES)}")
        self._keys = Keys({"observation": {_POSITIONS: {"joints": list(env.layout)}}}, env)
        self._seed = 0
        first = self._observed(env.start[0])
        space = env.single_action_space
        numbers = [(p, n) for p, one in env.layout.items() for n in one.robot.describe_action()]
        self.info = EmbodimentInfo(
            name=env.task_id,
            action_space=Box(
                space.shape,
                space.low.astype(float),
                space.high.astype(float),
                ActionSemantics(
                    MODES[mode],
                    gripper="continuous",
                    dim_labels=tuple(f"{place}.{number.name}" for place, number in numbers),
                ),
            ),
            observation_space=ObservationSpace(
                tuple(CameraSpec(name, *seen.shape) for name, seen in first.images.items()),
                state=StateSpec(
                    (StateField(_POSITIONS, first.state[_POSITIONS].shape, "rad or m"),)
                ),
            ),
            control_hz=env.scenario.control_frequency,
            is_simulated=True,
            capabilities=frozenset({SEEDABLE, RESETTABLE, AUTO_RESET, PRIVILEGED_SUCCESS}),
            docs="\n".join(
                f"- {place}.{number.name}: {number.unit}, {number.lower:g} to {number.upper:g}"
                for place, number in numbers
            ),
        )

    def reset(self, scene: Scene, *, seed: int | None = None) -> Observation:
        """Begin the episode of a scene's seed, or else of the trial's."""
        self._seed = (seed or 0) % _SEEDS if scene.init_seed is None else scene.init_seed
        obs, _ = self.env.reset(self._seed, {"reconfigure": True})
        return self._observed(obs)

    def step(self, action: Action) -> StepResult:
        """Advance by one control step."""
        data = np.array(action.data, np.float32)
        obs, reward, terminated, truncated, info = self.env.step(data)
        told = info_row(info, self._seed)
        ended, success = bool(terminated[0]), bool(told.get("success", False))
        over = ended or bool(truncated[0])
        return StepResult(
            self._observed(obs),
            reward[0].item(),
            terminated=over and (ended or success),
            termination_reason=("success" if success else "failure") if over else None,
            truncated=over and not (ended or success),
            info=told,
        )

    def close(self) -> None:
        """Let the world go."""
        self.env.close()

    def _observed(self, obs: Any) -> Observation:
        pictures = obs.get("sensor_data", {})
        return Observation(
            {name: seen["rgb"][0].numpy(force=True) for name, seen in pictures.items()},
            self._keys.sent(obs, self._seed),
            instruction_of(self.env.task_class, self._seed),
        )


def benchmark(
    task: str = DEFAULT, *, episodes: int = 10, first_seed: int = 0, max_steps: int | None = None
) -> Task:
    """Return a benchmark: a scene for each seed of a task, which succeeds as the task says.

    Args:
        task: Its id; ``module:Id`` for one of your own.
        episodes: How many seeds.
        first_seed: The first of them.
        max_steps: Control steps of an episode; None: the task's own.
    """
    cls = tasks.get_task_class(task)
    scenes = [
        Scene(f"{cls.task_id}-{seed}", instruction_of(cls, seed), init_seed=seed)
        for seed in range(first_seed, first_seed + episodes)
    ]
    return Task(cls.task_id, scenes, "success_at_end", max_steps or cls.max_episode_steps)

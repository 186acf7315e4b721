"""A task as a PettingZoo environment: an agent per robot or limb, named as in the layout."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, ClassVar, TypeVar

import numpy as np
from gymnasium.spaces import Box, Space
from numpy.typing import NDArray
from pettingzoo import ParallelEnv

from robot_layouts.core.bounds import shown
from robots import TaskError, UnknownNameError
from tasks.engine.observation import TIPS, read_mode, space_of
from tasks.engine.scenario import RENDER_MODES
from tasks.interfaces.gymnasium import OneEnvironment, info_row, row
from tasks.native.controllers import CONTROLLER
from tasks.native.format import native_places, observation_keys

JOINTS = ("qpos", "qvel")

Observation = Any
"""An array, or with images a mapping of them."""
RobotReward = Callable[[str, Observation, float, dict[str, Any]], float]
"""Robot, its observation, the task's reward, info → what the robot earns."""

_Space = TypeVar("_Space", bound=Space[Any])


class ParallelTask(OneEnvironment, ParallelEnv[str, Observation, NDArray[np.float32]]):
    """What `tasks.parallel_env` gives: every robot observes and acts for itself.

    The limbs of a robot that has several are agents of their own. A robot observes its own joint
    positions and velocities, then all that the task observes besides joints (TCP poses, objects,
    goals), and where images are asked for, what the task's cameras and its own see. Its action is
    its own slice of the task's. All robots end together: when the task succeeds or is truncated,
    ``agents`` is emptied.

    Attributes:
        task: The task, with one environment.
        possible_agents: The places that take action numbers, or the limbs, as in the task's
            ``action_split``.
        agents: The same during an episode, else nothing.
        observed: Robot → the numbers of the task's flat observation that it observes.
        observation_spaces: Robot → what it observes.
        action_spaces: Robot → what it may do.
        state_space: Of what `state` returns.
    """

    metadata: ClassVar[dict[str, Any]] = {
        "name": "robot_layouts",
        "render_modes": [*RENDER_MODES],
        "render_fps": 20,
        "is_parallelizable": True,
    }

    def __init__(
        self,
        task_id: str,
        robot_reward: RobotReward | None = None,
        render_mode: str | None = None,
        **fields: Any,
    ) -> None:
        """Make the task; see `tasks.parallel_env`."""
        if "num_envs" in fields:
            raise TaskError("parallel_env takes no num_envs: it is one environment")
        mode = read_mode(name := fields.get("obs_mode", "state"))
        if mode.nothing or mode.columns or mode.points:
            raise TaskError(f"parallel_env takes no obs_mode={name!r}; choices: 'state', 'rgb', …")
        frames = self._make(task_id, render_mode, fields)
        self.metadata = {**self.metadata, "name": self.task.task_id, "render_fps": frames}  # type: ignore[misc]
        if not (robot_reward is None or callable(robot_reward)):
            raise TaskError(f"robot_reward is {shown(robot_reward)}; a function is needed, or None")
        self._robot_reward = robot_reward
        split = self.task.action_split
        self.possible_agents = [name for name, part in split.items() if part.stop > part.start]
        self.agents: list[str] = []
        layout, index = self.task.layout, self.task.simulation.index
        self._robots = {name: layout.owner(name) for name in self.possible_agents}
        self._joints = {name: native_places(index, layout, name) for name in self.possible_agents}
        self.observed = self._observed() if self.task.observation_slices else {}
        bounds = self.task.single_action_space
        self.action_spaces = {
            name: Box(bounds.low[part], bounds.high[part], dtype=np.float32)
            for name, part in self.task.action_split.items()
        }
        start = self._observations(self.task.start[0])
        self.observation_spaces = {name: space_of(own) for name, own in start.items()}
        self.state_space = space_of(self.state())

    def observation_space(self, agent: str) -> Space[Observation]:
        """Return what a robot observes; always the same object."""
        return _look_up(self.observation_spaces, agent)

    def action_space(self, agent: str) -> Space[NDArray[np.float32]]:
        """Return what a robot may do; always the same object."""
        return _look_up(self.action_spaces, agent)

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Observation], dict[str, dict[str, Any]]]:
        """Begin a new episode.

        Args:
            seed: Seed of the episode; None lets the random streams run on, the first time from one
                that the system's entropy gives. ``info["seed"]`` is what they began with.
            options: ``{"reconfigure": True}`` rebuilds the world; others are ignored.

        Returns:
            Observation and info of every robot.

        Raises:
            TaskError: If an argument is not valid; nothing is reset then.
        """
        obs, info, _ = self._begin(seed, options)
        self.agents = list(self.possible_agents)
        return self._observations(obs), self._infos(info)

    def step(
        self, actions: Mapping[str, NDArray[np.float32]]
    ) -> tuple[
        dict[str, Observation],
        dict[str, float],
        dict[str, bool],
        dict[str, bool],
        dict[str, dict[str, Any]],
    ]:
        """Advance by one control step.

        Args:
            actions: What each robot does, (a,) each.

        Returns:
            Observation, reward, terminated, truncated and info of every robot.

        Raises:
            ActionError: If a robot's action is missing or wrong; nothing moves then.
            TaskError: If the episode is over, or a reward is not finite.
        """
        if not self.agents:
            raise TaskError("no episode is being played; call reset() first")
        obs, reward, terminated, truncated, info = self._step(actions)
        observations, shared = self._observations(obs), reward[0].item()
        own_info = info_row(info, self._seed)
        over, late = bool(terminated[0]), bool(truncated[0])
        agents = self.agents
        if over or late:
            self.agents = []
        return (
            observations,
            {name: self._reward(name, observations[name], shared, own_info) for name in agents},
            dict.fromkeys(agents, over),
            dict.fromkeys(agents, late),
            self._infos(own_info),
        )

    def state(self) -> NDArray[np.float32]:
        """Return what all robots together would observe as ``"state"``, flat, for critics."""
        return self.task.flat_state()[0]

    # -- inside ------------------------------------------------------------------------------

    def _observed(self) -> dict[str, NDArray[np.intp]]:
        slices = self.task.observation_slices
        joints = {f"{robot}.{kind}" for robot in self.task.layout for kind in JOINTS}
        besides = {robot: _besides(robot) for robot in self.task.layout}
        owned = tuple(beginning for own in besides.values() for beginning in own)

        def places(robot: str) -> list[NDArray[np.intp]]:
            """Return where the observation has what a robot alone observes, and all robots."""
            return [
                np.arange(part.start, part.stop)
                for key, part in slices.items()
                if key.startswith(besides[robot]) or not (key in joints or key.startswith(owned))
            ]

        return {
            name: np.concatenate(
                [slices[f"{self._robots[name]}.{kind}"].start + own for kind in JOINTS]
                + places(self._robots[name])
            )
            for name, own in self._joints.items()
        }

    def _observations(self, obs: Any) -> dict[str, Observation]:
        whole = row(obs)
        return {name: self._own(name, whole) for name in self.possible_agents}

    def _own(self, agent: str, whole: Any) -> Any:
        """Return what one robot or limb observes of all that is observed."""
        if not isinstance(whole, Mapping):
            return whole[self.observed[agent]]
        own = dict(whole)
        if "state" in whole:
            own["state"] = whole["state"][self.observed[agent]]
        if "agent" in whole:
            key = observation_keys(self.task.layout)[self._robots[agent]]
            joints = whole["agent"] if key is None else whole["agent"][key]
            own["agent"] = dict(joints)
            own["agent"].update({kind: joints[kind][self._joints[agent]] for kind in JOINTS})
        cameras = self.task.observer.seen_by(self._robots[agent])
        for kind in ("sensor_param", "sensor_data"):
            if kind in whole:
                own[kind] = {name: whole[kind][name] for name in cameras}
        return own

    def _infos(self, info: dict[str, Any]) -> dict[str, dict[str, Any]]:
        return {name: dict(info) for name in self.possible_agents}

    def _reward(self, name: str, observation: Observation, shared: float, info: Any) -> float:
        if self._robot_reward is None:
            return shared
        earned = self._robot_reward(name, observation, shared, info)
        try:
            reward = float(earned)
        except (TypeError, ValueError, RuntimeError):
            reward = math.nan
        if not math.isfinite(reward):
            raise TaskError(
                f"robot_reward returned {shown(earned)} for {name!r} at step"
                f" {info['elapsed_steps']}; it must be a finite number"
            )
        return reward


def _besides(robot: str) -> tuple[str, str]:
    """Return how the names begin of what a robot observes of itself besides its joints."""
    return f"{robot}.{CONTROLLER}.", f"{robot}.{TIPS}"


def _look_up(spaces: Mapping[str, _Space], agent: str) -> _Space:
    if agent not in spaces:
        raise UnknownNameError("agent", agent, spaces)
    return spaces[agent]

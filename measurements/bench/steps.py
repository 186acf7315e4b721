"""What one step costs, beside its physics alone: by task, environments, robots and contacts."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
import torch
from numpy.typing import NDArray

import tasks
from measurements.bench.measurement import Measurement, SomeValue, by_series
from measurements.bench.settings import Settings
from measurements.bench.worlds import make_crowd, make_pile
from tasks import MultiRobotTask

STEP, PHYSICS = "step", "physics alone"


class Played:
    """A task whose step is timed under random actions, and the physics of the same motion."""

    def __init__(self, env: MultiRobotTask, settings: Settings) -> None:
        """Take a task; its first action is played now, as building leaves work to it."""
        self.env, self._settings = env, settings
        env.step(torch.from_numpy(self.actions(0)[0]))

    def step(self, number: int) -> float:
        """Return the time of a whole step, for each environment (µs)."""
        actions = [torch.from_numpy(action) for action in self.actions(number)]
        self.env.reset(number)
        start = self._settings.clock.now()
        for action in actions:
            self.env.step(action)
        return self._each(self._settings.clock.now() - start)

    def physics(self, number: int) -> float:
        """Return the time of its physics alone, for each environment (µs)."""
        self.env.reset(number)
        step, clock = self.env.simulation.timed_step, self._settings.clock.now
        return self._each(sum(step(action, clock) for action in self.actions(number)))

    def actions(self, number: int) -> NDArray[np.float32]:
        """Return the actions of a round, shape (steps, N, A)."""
        return random_actions(number, self._settings.steps, self.env.num_envs, width(self.env))

    def _each(self, seconds: float) -> float:
        return seconds / (self._settings.steps * self.env.num_envs) * 1e6


def width(env: MultiRobotTask) -> int:
    """Return how many numbers an action has."""
    return env.single_action_space.shape[0]


def random_actions(seed: int, steps: int, envs: int, numbers: int) -> NDArray[np.float32]:
    """Return actions within the range, shape (steps, envs, numbers)."""
    drawn = np.random.default_rng(seed).uniform(-1, 1, (steps, envs, numbers))
    return drawn.astype(np.float32)


def step(settings: Settings) -> Measurement:
    """Time one environment of each task."""
    envs = {task_id: tasks.make(task_id, **settings.making) for task_id in settings.tasks}
    return _beside_physics(
        settings, "step", "One step of one environment, by task", "task", {STEP: envs}
    )


def environments(settings: Settings) -> Measurement:
    """Time a step with one environment, with some, and with many in this process."""
    task_id, settings = settings.tasks[0], replace(settings, steps=settings.batch_steps)
    envs = {
        count: tasks.make(task_id, num_envs=count, **settings.making)
        for count in settings.environments
    }
    title = f"One step per environment of one process, {task_id}"
    return _beside_physics(settings, "environments", title, "environments", {STEP: envs})


def robots(settings: Settings) -> Measurement:
    """Time a step with one robot, with two, and so on, in rings of one kind and of several."""
    rings = {"one kind": settings.kinds[:1], "mixed": settings.kinds}
    envs = {
        name: {count: make_crowd(count, kinds) for count in settings.robots}
        for name, kinds in rings.items()
    }
    title = f"One step of a ring of robots: {settings.kinds[0]}, or {' + '.join(settings.kinds)}"
    return _beside_physics(settings, "robots", title, "robots", envs)


def contacts(settings: Settings) -> Measurement:
    """Time a step of a robot beside piles of cubes that touch."""
    envs: dict[int, MultiRobotTask] = {}
    for cubes in settings.cubes:
        env = make_pile(cubes)
        env.step(torch.from_numpy(random_actions(0, 1, 1, width(env))[0]))
        envs[env.touching()] = env
    return _beside_physics(
        settings, "contacts", "One step beside cubes that touch", "pairs that touch", {STEP: envs}
    )


def _beside_physics(
    settings: Settings,
    name: str,
    title: str,
    variable: str,
    envs: Mapping[str, Mapping[SomeValue, MultiRobotTask]],
) -> Measurement:
    """Time steps and physics; one series is beside `PHYSICS`, several are each beside its own."""
    floors = {series: PHYSICS if len(envs) == 1 else f"{series}, physics" for series in envs}
    played = {
        (series, value): Played(env, settings)
        for series, at_values in envs.items()
        for value, env in at_values.items()
    }
    variants: dict[tuple[str, SomeValue], Callable[[int], float]] = {}
    for (series, value), one in played.items():
        variants[series, value] = one.step
        variants[floors[series], value] = one.physics
    samples = settings.interleave(variants)
    values = list(dict.fromkeys(value for _, value in played))
    return Measurement(
        name=name,
        title=title,
        unit="µs per step",
        variable=variable,
        values=tuple(values),
        samples=by_series(values, samples),
        floors=tuple(floors.values()),
        ratios=tuple(floors.items()),
    )

"""Noise of sensors and actions, and delays: actions that arrive later, observations that are older.

Noise is a function of the episode, the step and what it is added to.
"""

from __future__ import annotations

import copy
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from robot_layouts.simulation.maths import Array, Floats
from robots import UnknownNameError
from tasks.arrays import row_of, stacked
from tasks.randomization.distributions import Distribution, Stream
from tasks.randomization.targets import RandomizedThings, matching

Noisy = Callable[[str, Array], Array]
"""Returns a named part of an observation, (N, k) or (N,), with its noise."""


def noise(
    streams: Sequence[Stream],
    steps: Sequence[int],
    drawn: Distribution,
    width: int,
    *names: str,
) -> Floats:
    """Return noise for N environments, (N, width) float32.

    Args:
        streams: Where the numbers of each environment's episode come from.
        steps: How many control steps each has taken.
        drawn: What each number is drawn from.
        width: How many numbers each gets.
        names: What they are for.
    """
    rows = [
        [drawn.value(u) for u in stream.numbers(width, *names, step)]
        for stream, step in zip(streams, steps, strict=True)
    ]
    return np.array(rows, np.float32).reshape(len(streams), width)


class ActionNoise:
    """What is added to the numbers of actions."""

    def __init__(self, targets: Mapping[str, RandomizedThings]) -> None:
        """Take what is drawn for which numbers, by name; of the same number the last one counts."""
        owners = {number: name for name, target in targets.items() for number in target.means}
        self._parts = {
            name: ([n for n in target.means if owners[n] == name], target)
            for name, target in targets.items()
        }

    def added(self, actions: Floats, streams: Sequence[Stream], steps: Sequence[int]) -> Floats:
        """Return actions, (N, A), with their noise."""
        noisy = actions.copy()
        for name, (numbers, target) in self._parts.items():
            own = [target.means.index(number) for number in numbers]
            drawn = noise(streams, steps, target.takes, len(target.means), "action_noise", name)
            noisy[:, numbers] += drawn[:, own]
        return noisy


class SensorNoise:
    """What is added to the named parts of observations."""

    def __init__(self, declared: Mapping[str, Distribution]) -> None:
        """Take what is drawn, by patterns of names."""
        self._declared = declared
        self._known = False

    def expect(self, parts: Sequence[str]) -> None:
        """Refuse patterns that no part of the observation matches.

        Raises:
            UnknownNameError: If there is one.
        """
        if self._known:
            return
        for pattern in self._declared:
            if not any(matching(pattern, [part]) for part in parts):
                raise UnknownNameError("part of the observation for sensor_noise", pattern, parts)
        self._known = True

    def on(self, streams: Sequence[Stream], steps: Sequence[int]) -> Noisy:
        """Return what adds the noise of a moment; see `noise`."""

        def noisy(name: str, values: Array) -> Array:
            patterns = [p for p in self._declared if matching(p, [name])]
            if not patterns:
                return values
            drawn, rows = self._declared[patterns[-1]], np.asarray(values)
            width = 1 if rows.ndim == 1 else rows.shape[1]
            added = noise(streams, steps, drawn, width, "sensor_noise", name)
            return rows + added.reshape(rows.shape)

        return noisy


class ActionDelay:
    """The actions of N environments that are on their way."""

    def __init__(self, num_envs: int) -> None:
        """Begin without any."""
        self._delays = [0] * num_envs
        self._sent: list[deque[Floats]] = [deque() for _ in range(num_envs)]

    def begin(self, env: int, delay: int) -> None:
        """Forget what was sent in an environment; its episode's actions take ``delay`` steps."""
        self._delays[env] = delay
        self._sent[env].clear()

    def arriving(self, actions: Floats, env_ids: Sequence[int]) -> tuple[Floats, list[int]]:
        """Send actions, (N, A), and return those that arrive, and where none does yet."""
        arrived, waiting = actions.copy(), list[int]()
        for env in env_ids:
            sent = self._sent[env]
            sent.append(actions[env].copy())
            if len(sent) > self._delays[env]:
                arrived[env] = sent.popleft()
            else:
                waiting.append(env)
        return arrived, waiting


class ObservationDelay:
    """The latest observations of N environments, the oldest of which are what is seen."""

    def __init__(self, num_envs: int) -> None:
        """Begin without any."""
        self._kept: list[deque[Any]] = [deque(maxlen=1) for _ in range(num_envs)]

    def begin(self, env: int, delay: int) -> None:
        """Forget what was observed in an environment; its episode's are ``delay`` steps old."""
        self._kept[env] = deque(maxlen=delay + 1)

    def seen(self, observation: Any, env_ids: Sequence[int]) -> Any:
        """Return observations as they are seen.

        Args:
            observation: Of all environments now: an array (N, …), or mappings of such arrays.
            env_ids: The environments of which it is a new one.
        """
        for env in env_ids:
            self._kept[env].append(copy.deepcopy(row_of(observation, env)))
        return stacked([kept[0] for kept in self._kept])

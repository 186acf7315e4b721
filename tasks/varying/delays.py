"""Delays: actions that arrive later, observations that are older."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from robot_layouts.simulation.maths import Floats


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
            self._kept[env].append(_row(observation, env))
        return _joined([kept[0] for kept in self._kept])


def _row(tree: Any, env: int) -> Any:
    if isinstance(tree, Mapping):
        return {key: _row(part, env) for key, part in tree.items()}
    return tree[env].copy()


def _joined(rows: Sequence[Any]) -> Any:
    if isinstance(rows[0], Mapping):
        return {key: _joined([row[key] for row in rows]) for key in rows[0]}
    return np.stack(rows)

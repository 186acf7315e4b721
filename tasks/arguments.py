"""Checks of what a task is asked for: which environments, which seeds, which places."""

from __future__ import annotations

import operator
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from torch import Tensor

from layouts import Layout
from robots import TaskError, unknown_name_message


def checked_ids(env_ids: Sequence[int] | None, num_envs: int) -> list[int]:
    """Return environment numbers as a list, all if None.

    Raises:
        TaskError: If they are no different numbers of environments.
    """
    if env_ids is None:
        return list(range(num_envs))
    try:
        ids = [operator.index(i) for i in env_ids]
    except TypeError:
        raise TaskError(f"env_ids is {env_ids!r}; it takes a sequence of integers") from None
    wrong = [i for i in ids if not 0 <= i < num_envs]
    if wrong or len(set(ids)) != len(ids):
        raise TaskError(f"env_ids {ids} must be different numbers from 0 to {num_envs - 1}")
    return ids


def checked_seeds(seed: int | Sequence[int] | None, ids: list[int]) -> list[int | None]:
    """Return the seed of each environment in ``ids``; None where its streams run on.

    Raises:
        TaskError: If they are no seeds, or not as many as environments.
    """
    if seed is None:
        return [None] * len(ids)
    try:
        if isinstance(seed, Sequence | np.ndarray | Tensor) and np.ndim(seed) == 1:
            seeds = [operator.index(s) for s in seed]
        else:
            seeds = [operator.index(seed) + i for i in ids]  # type: ignore[arg-type]
    except TypeError:
        raise TaskError(f"seed is {seed!r}; it takes an integer or a list of them") from None
    if len(seeds) != len(ids):
        raise TaskError(f"{len(seeds)} seeds for {len(ids)} environments")
    if not all(0 <= s < 2**32 for s in seeds):
        raise TaskError(f"seeds {seeds} must lie from 0 to 2**32 - 1")
    return list(seeds)


def wants_rebuild(options: Mapping[str, Any] | None) -> bool:
    """Return whether the options of a reset ask for new worlds.

    Raises:
        TaskError: If there is no such option.
    """
    for key in options or {}:
        if key != "reconfigure":
            raise TaskError(unknown_name_message("reset option", key, ("reconfigure",)))
    return bool((options or {}).get("reconfigure", False))


def check_places(task: str, layout: Layout, own: Layout, robot_counts: range | None) -> None:
    """Refuse a layout whose places are not the task's; their order is the layout's own.

    Args:
        task: The task's name.
        layout: The layout.
        own: The task's own layout.
        robot_counts: How many robots it may have, called as one likes; None for those of ``own``.

    Raises:
        TaskError: If the places are wrong.
    """
    if robot_counts is not None:
        if len(layout) not in robot_counts:
            raise TaskError(
                f"{task} takes {robot_counts[0]} to {robot_counts[-1]} robots;"
                f" the layout has {len(layout)}: {list(layout)}"
            )
    elif set(layout) != set(own):
        raise TaskError(
            f"{task} has the places {list(own)}; the layout has {list(layout)}."
            " Give the layout's robots the names of the places"
        )

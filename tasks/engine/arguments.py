"""Checks of what a task is asked for: which environments, which seeds."""

from __future__ import annotations

import operator
from collections.abc import Collection, Mapping, Sequence
from typing import Any, SupportsIndex

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

from robot_layouts.core.bounds import checked_flag, shown
from robots import TaskError, unknown_name_message

RECONFIGURE = "reconfigure"  # option of a reset, and in its info: whether worlds are rebuilt
ELAPSED = "elapsed_steps"  # in info: control steps since the reset
SEED = "seed"  # in the info of fronts: what the random streams began with
SUCCESS = "is_success"  # there, too: what other packages call success


def checked_ids(env_ids: Sequence[int] | None, num_envs: int) -> list[int]:
    """Return environment numbers as a list, all if None.

    Raises:
        TaskError: If they are no different numbers of environments.
    """
    if env_ids is None:
        return list(range(num_envs))
    if _has_flags(env_ids):
        raise TaskError(
            f"env_ids is {shown(env_ids)}; it takes numbers of environments, not a mask:"
            " numpy.flatnonzero(mask) gives them"
        )
    try:
        ids = [operator.index(i) for i in env_ids]
    except (TypeError, ValueError, RuntimeError):
        raise TaskError(f"env_ids is {shown(env_ids)}; it takes a sequence of integers") from None
    wrong = [i for i in ids if not 0 <= i < num_envs]
    if wrong or len(set(ids)) != len(ids):
        raise TaskError(f"env_ids {shown(ids)} must be different numbers from 0 to {num_envs - 1}")
    return ids


def checked_seeds(seed: int | Sequence[int | None] | None, ids: Sequence[int]) -> list[int | None]:
    """Return the seed of each environment in ``ids``; None where its streams run on.

    Raises:
        TaskError: If they are no seeds, or not as many as environments.
    """
    if seed is None:
        return [None] * len(ids)
    try:
        seeds = _integers(seed, ids)
    except (TypeError, ValueError, RuntimeError):
        raise TaskError(f"seed is {shown(seed)}; it takes an integer or a list of them") from None
    if len(seeds) != len(ids):
        raise TaskError(f"{len(seeds)} seeds for {len(ids)} environments")
    if not all(s is None or 0 <= s < 2**32 for s in seeds):
        raise TaskError(f"seeds {shown(seeds)} must lie from 0 to 2**32 - 1")
    return seeds


def checked_options(options: Mapping[str, Any] | None) -> Mapping[str, Any]:
    """Return the options of a reset; none if None.

    Options that are not ours pass: fronts are given those of other packages, and ignore them.

    Raises:
        TaskError: If they are no mapping, or ``reconfigure`` is no truth value.
    """
    if options is None:
        return {}
    if not isinstance(options, Mapping):
        raise TaskError(
            f"options is {shown(options)}; it takes a mapping: {{{RECONFIGURE!r}: True}}"
        )
    checked_flag(f"the option {RECONFIGURE!r}", options.get(RECONFIGURE, False), TaskError)
    return options


def wants_rebuild(options: Mapping[str, Any] | None) -> bool:
    """Return whether the options of a reset ask for new worlds.

    Raises:
        TaskError: If they make no sense, or one does not exist.
    """
    known = own_options(options)
    for key in options or ():
        if key not in known:
            raise TaskError(unknown_name_message("reset option", key, known))
    return known[RECONFIGURE]


def own_options(options: Mapping[str, Any] | None) -> dict[str, bool]:
    """Return those options of a reset that tasks know; the others are left out.

    Raises:
        TaskError: See `checked_options`.
    """
    return {RECONFIGURE: bool(checked_options(options).get(RECONFIGURE, False))}


def check_info(task: str, info: Collection[str]) -> None:
    """Refuse keys of a task's ``evaluate()`` that info has already, of its own or of fronts.

    Raises:
        TaskError: If there is one.
    """
    taken = [key for key in (RECONFIGURE, SEED, SUCCESS) if key in info]
    if taken:
        raise TaskError(
            f"{task}.evaluate() returned {', '.join(taken)}, which info already has; call it"
            " something else"
        )


def _integers(
    seed: SupportsIndex | Sequence[int | None] | NDArray[Any] | Tensor, ids: Sequence[int]
) -> list[int | None]:
    """Return one integer per environment, or several as they are given."""
    if isinstance(seed, (str, bytes)) or _has_flags(seed):
        raise TypeError(seed)
    if isinstance(seed, Sequence) or (isinstance(seed, (np.ndarray, Tensor)) and seed.ndim == 1):
        return [None if s is None else operator.index(s) for s in seed]
    return [operator.index(seed) + i for i in ids]  # pyright: ignore[reportArgumentType]


def _has_flags(values: Any) -> bool:
    """Whether values are truth values, which Python and torch take for the numbers 0 and 1."""
    if isinstance(values, (np.ndarray, Tensor)):
        return "bool" in str(values.dtype)
    if isinstance(values, (list, tuple)):
        return any(map(_has_flags, values))
    return isinstance(values, (bool, np.bool_))

"""Spaces and plain numbers for what a task returns as tensors."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from gymnasium.spaces import Box, Dict, Space


def observation_space(observation: Any) -> Space[Any]:
    """Return the space of one environment's observation, as `row` returns it."""
    if isinstance(observation, Mapping):
        return Dict({key: observation_space(part) for key, part in observation.items()})
    return Box(-np.inf, np.inf, observation.shape, np.float32)


def row(observation: Any, env: int = 0) -> Any:
    """Return one environment's part of a batched observation, as float32 arrays.

    Observing nothing gives an array without numbers: spaces may be empty, mappings may not.
    """
    if isinstance(observation, Mapping) and not observation:
        return np.empty(0, np.float32)
    if isinstance(observation, Mapping):
        return {key: row(part, env) for key, part in observation.items()}
    return observation[env].numpy().astype(np.float32)


def info_row(info: Mapping[str, Any]) -> dict[str, Any]:
    """Return the info of the only environment as Python numbers, and arrays where it has them."""
    told: dict[str, Any] = {}
    for key, value in info.items():
        if isinstance(value, bool):  # "reconfigure" is said once for all environments
            told[key] = value
        else:
            told[key] = value[0].item() if value.ndim == 1 else value[0].numpy().copy()
    return told

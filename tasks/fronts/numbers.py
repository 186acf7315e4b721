"""Plain numbers and arrays for what a task returns."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tasks.engine.arguments import RECONFIGURE, SEED, SUCCESS
from tasks.engine.observation import observed_dtype
from tasks.engine.task import MultiRobotTask


def stepper(task: MultiRobotTask) -> Callable[..., Any]:
    """Return what steps a task without making tensors, unless its class has a step of its own."""
    return task.advance if type(task).step is MultiRobotTask.step else task.step


def as_array(value: Any) -> NDArray[Any]:
    """Return what a task gave as an array, which shares its memory."""
    return value if isinstance(value, np.ndarray) else value.numpy()


def row(observation: Any, env: int = 0) -> Any:
    """Return one environment's part of a batched observation, as arrays.

    Images keep their type, all else is float32. Observing nothing gives an array without numbers:
    spaces may be empty, mappings may not.
    """
    if isinstance(observation, Mapping) and not observation:
        return np.empty(0, np.float32)
    if isinstance(observation, Mapping):
        return {key: row(part, env) for key, part in observation.items()}
    return np.array(as_array(observation)[env], observed_dtype(observation))


def info_row(info: Mapping[str, Any], seed: int) -> dict[str, Any]:
    """Return the info of the only environment as Python numbers, and arrays where it has them.

    It has the same keys after a reset and after a step: "reconfigure" is left out.

    Args:
        info: What the task returned.
        seed: What the environment's random streams began with.
    """
    row_info: dict[str, Any] = {
        key: value[0].item() if value.ndim == 1 else as_array(value)[0].copy()
        for key, value in info.items()
        if key != RECONFIGURE
    }
    row_info[SUCCESS] = row_info["success"]
    row_info[SEED] = seed
    return row_info

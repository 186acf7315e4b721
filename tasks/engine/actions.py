"""Turns what a user passes as an action into one checked float32 batch."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from layouts import Layout
from robot_layouts.simulation.maths import all_finite
from robots import ActionError, UnknownNameError
from tasks.arrays import array_of


class ActionReader:
    """Reads flat actions and dicts by robot name, and refuses what a robot cannot follow."""

    def __init__(self, layout: Layout, num_envs: int) -> None:
        """Take the layout whose robots are driven."""
        self._layout, self._num_envs = layout, num_envs
        self._split = layout.action_split
        self._width = layout.action_dim
        self.checked: NDArray[np.float32] | None = None
        """An array, (N, A), whose numbers were checked by the code that writes them there."""

    def read(
        self, action: Any, env_ids: NDArray[np.integer[Any]] | None = None
    ) -> NDArray[np.float32]:
        """Return the action as a float32 array of shape (N, A), in the layout's order.

        Args:
            action: Tensor or array (N, A), or a mapping robot name → (N, a). With one
                environment the first dimension may be left out.
            env_ids: The environments whose rows these are; all if None.

        Raises:
            ActionError: If its shape, type or a number is wrong; says which robot's.
        """
        if action is self.checked and self.checked is not None:
            return self.checked
        count = self._num_envs if env_ids is None else len(env_ids)
        if type(action) is torch.Tensor or not isinstance(action, Mapping):
            flat = self._array(action, count, self._width, "the action")
        else:
            flat = self._join(action, count)
        if not all_finite(flat):
            self._refuse_number(flat, env_ids)
        return flat

    def _join(self, action: Mapping[str, Any], count: int) -> NDArray[np.float32]:
        parts = [
            self._array(action[name], count, part.stop - part.start, f"the action of {name!r}")
            for name, part in given_robots(action, self._split).items()
        ]
        return np.concatenate(parts, axis=1)

    def _array(self, value: Any, count: int, width: int, what: str) -> NDArray[np.float32]:
        array = array_of(value, what, ActionError)
        if array.dtype.kind != "f":
            raise ActionError(f"{what} has dtype {array.dtype}; it must be floating (float32)")
        if array.ndim == 1 and count == 1:
            array = array[None]
        if array.shape != (count, width):
            raise ActionError(
                f"{what} has shape {array.shape}; it must be {(count, width)}:"
                f" {count} environment(s), {self._describe(width)}"
            )
        if array.dtype == np.float32:
            return array
        with np.errstate(over="ignore"):  # what is too large is refused as inf
            return array.astype(np.float32)

    def _describe(self, width: int) -> str:
        if width != self._width or len(self._split) == 1:
            return f"{width} numbers"
        sizes = " + ".join(f"{p.stop - p.start} ({n})" for n, p in self._split.items())
        return f"{width} = {sizes} numbers"

    def _refuse_number(
        self, flat: NDArray[np.float32], env_ids: NDArray[np.integer[Any]] | None
    ) -> None:
        row, column = (int(i) for i in np.argwhere(~np.isfinite(flat))[0])
        env = row if env_ids is None else int(env_ids[row])
        name, part = next((n, p) for n, p in self._split.items() if p.start <= column < p.stop)
        number = self._layout.arm(name).robot.describe_action()[column - part.start]
        raise ActionError(
            f"action number {column} is {flat[row, column]} in environment {env}: that is number"
            f" {number.index} ({number.name}) of robot {name!r}; nothing was moved"
        )


def given_robots(action: Mapping[str, Any], split: Mapping[str, slice]) -> dict[str, slice]:
    """Return the part of each robot that an action by robot's name moves, in the layout's order.

    Raises:
        UnknownNameError: If one of its names is no robot's.
        ActionError: If it lacks a robot that takes numbers.
    """
    for name in action:
        if name not in split:
            raise UnknownNameError("robot of this layout", name, split)
    needed = [name for name, part in split.items() if part.stop > part.start]
    if missing := [name for name in needed if name not in action]:
        raise ActionError(f"the action has no numbers for {missing}; the robots are {list(split)}")
    return {name: part for name, part in split.items() if name in action}

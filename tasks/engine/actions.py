"""Turns what a user passes as an action into one checked float32 batch."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from layouts import Layout
from robots import ActionError, UnknownNameError
from simulation.maths import all_finite
from tasks.arrays import array_of


class ActionReader:
    """Reads flat actions and dicts by robot name, and refuses what a robot cannot follow."""

    def __init__(self, layout: Layout, num_envs: int) -> None:
        """Take the layout whose robots are driven."""
        self._layout, self._num_envs = layout, num_envs
        self._split = layout.action_split
        self._width = layout.action_dim
        self.checked: NDArray[np.float32] | None = None
        """An array, (N, A), whose numbers were checked by whoever writes them there."""

    def read(self, action: Any) -> NDArray[np.float32]:
        """Return the action as a float32 array of shape (N, A), in the layout's order.

        Args:
            action: Tensor or array (N, A), or a mapping robot name → (N, a). With one
                environment the first dimension may be left out.

        Raises:
            ActionError: If its shape, type or a number is wrong; says which robot's.
        """
        if action is self.checked and self.checked is not None:
            return self.checked
        if type(action) is not torch.Tensor and isinstance(action, Mapping):
            flat = self._join(action)
        else:
            flat = self._array(action, self._width, "the action")
        if not all_finite(flat):
            self._refuse_number(flat)
        return flat

    def _join(self, action: Mapping[str, Any]) -> NDArray[np.float32]:
        for name in action:
            if name not in self._split:
                raise UnknownNameError("robot of this layout", name, self._split)
        needed = [name for name, part in self._split.items() if part.stop > part.start]
        missing = [name for name in needed if name not in action]
        if missing:
            raise ActionError(
                f"the action has no numbers for {missing}; the robots are {list(self._split)}"
            )
        parts = [
            self._array(action[name], part.stop - part.start, f"the action of {name!r}")
            for name, part in self._split.items()
            if name in action
        ]
        return np.concatenate(parts, axis=1)

    def _array(self, value: Any, width: int, what: str) -> NDArray[np.float32]:
        array = array_of(value, what, ActionError)
        if array.dtype.kind != "f":
            raise ActionError(f"{what} has dtype {array.dtype}; it must be floating (float32)")
        if array.ndim == 1 and self._num_envs == 1:
            array = array[None]
        if array.shape != (self._num_envs, width):
            raise ActionError(
                f"{what} has shape {array.shape}; it must be {(self._num_envs, width)}:"
                f" {self._num_envs} environment(s), {self._describe(width)}"
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

    def _refuse_number(self, flat: NDArray[np.float32]) -> None:
        env, column = (int(i) for i in np.argwhere(~np.isfinite(flat))[0])
        name, part = next((n, p) for n, p in self._split.items() if p.start <= column < p.stop)
        number = self._layout.arm(name).robot.describe_action()[column - part.start]
        raise ActionError(
            f"action number {column} is {flat[env, column]} in environment {env}: that is number"
            f" {number.index} ({number.name}) of robot {name!r}; nothing was moved"
        )

"""What a client asks of the world that is its own, and what it is answered."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import metadata
from typing import Any

import numpy as np
from gymnasium.spaces import Box, Dict, Space
from numpy.typing import NDArray

from robot_layouts.core.processes.transport import as_ours
from robot_layouts.core.quoting import shown
from robot_layouts.data.playing.served.client import pack, unpack
from robots import TaskError, UnknownNameError
from robots.control_modes import plain_mode
from tasks import TaskEnv
from tasks.description import instruction_of
from tasks.engine.checks import RECONFIGURE
from tasks.interfaces.gymnasium import info_row, row

CALL, ERROR = "call", "error"
_RESET, _STEP = "reset", "step"
MOST_READ = 2**20  # bytes of a client's message: an action takes some hundred


class ClientWorld:
    """The world of one client; it is made when an episode first begins."""

    def __init__(self, make: Callable[[], TaskEnv]) -> None:
        """Keep how it is made."""
        self._make = make
        self._env: TaskEnv | None = None

    def answer(self, data: bytes | str) -> bytes:
        """Return the answer to a message; to one that is invalid, why, and nothing has changed."""
        try:
            return pack(self._answer(data))
        except Exception as error:  # also of a user's own task: others go on
            return pack({ERROR: str(as_ours(error))})

    def close(self) -> None:
        """Let the world go."""
        if self._env is not None:
            self._env.close()

    def _answer(self, data: bytes | str) -> dict[str, Any]:
        if isinstance(data, str):
            raise TaskError(f"a text was sent, {shown(data)}; a message is a mapping in msgpack")
        if len(data) > MOST_READ:
            raise TaskError(
                f"a message of {len(data):,} bytes was sent; {MOST_READ:,} are most, and an action"
                " takes some hundred"
            )
        message = unpack(data)
        if not isinstance(message, Mapping):
            raise TaskError(f"{shown(message)} was sent; a message is a mapping")
        call, given = message.get(CALL), {k: v for k, v in message.items() if k != CALL}
        if call == _RESET:
            return self._reset(**_only(given, "seed"))
        if call == _STEP:
            return self._step(**_only(given, "action"))
        raise UnknownNameError("call", call, (_RESET, _STEP))

    def _reset(self, seed: Any = None) -> dict[str, Any]:
        if self._env is None:
            self._env = self._make()
        obs, info = self._env.reset(seed, {RECONFIGURE: True})
        return {"observation": row(obs), "info": info_row(info, self._env.seeds[0])}

    def _step(self, action: Any = None) -> dict[str, Any]:
        if self._env is None:
            raise TaskError("no episode has begun; reset first")
        parts = isinstance(action, Mapping)
        own = {name: np.array(part) for name, part in action.items()} if parts else np.array(action)
        obs, reward, terminated, truncated, info = self._env.step(own)
        return {
            "observation": row(obs),
            "reward": reward[0].item(),
            "terminated": bool(terminated[0]),
            "truncated": bool(truncated[0]),
            "info": info_row(info, self._env.seeds[0]),
        }


def _only(given: Mapping[Any, Any], name: str) -> dict[str, Any]:
    for key in given:
        if key != name:
            raise UnknownNameError("part of the message", key, (CALL, name))
    return {name: given[name]} if name in given else {}


def about(env: TaskEnv) -> dict[str, Any]:
    """Return what clients are told first: what is to be done, by which arms, and the spaces."""
    layout = env.layout
    return {
        "task": env.task_id,
        "instruction": instruction_of(env.task_class),
        "robots": {place: placed.robot.name for place, placed in layout.items()},
        "arms": list(layout.arms),
        "action_split": {name: [s.start, s.stop] for name, s in env.action_split.items()},
        "control_mode": plain_mode(env.control_mode),
        "control_frequency": env.scenario.control_frequency,
        "max_episode_steps": env.max_episode_steps,
        "obs_mode": env.obs_mode,
        "action_space": written_space(env.single_action_space),
        "observation_space": written_space(env.single_observation_space),
        "version": metadata.version("robot-layouts"),
    }


def written_space(space: Space[Any]) -> dict[str, Any]:
    """Return a space as what can be sent: its bounds, or those of its parts by name.

    Bounds that are the same for all numbers are single ones, so that pictures take no more.
    """
    if isinstance(space, Dict):
        return {"parts": {name: written_space(part) for name, part in space.spaces.items()}}
    assert isinstance(space, Box)  # all that tasks observe and take
    return {"low": _bound(space.low), "high": _bound(space.high), "shape": list(space.shape)}


def _bound(numbers: NDArray[Any]) -> NDArray[Any]:
    same = numbers.size > 0 and (numbers == numbers.flat[0]).all()
    return numbers.flat[:1].reshape(()) if same else numbers


def read_space(written: Any) -> Space[Any]:
    """Return the space that `written_space` wrote.

    Raises:
        ValueError: If it wrote none like that.
        TypeError: Likewise.
    """
    match written:
        case {"parts": dict(parts)}:
            return Dict({name: read_space(part) for name, part in parts.items()})
        case {"low": np.ndarray() as low, "high": np.ndarray() as high, "shape": list(shape)}:
            low, high = np.broadcast_to(low, shape), np.broadcast_to(high, shape)
            return Box(low, high, dtype=low.dtype.type)
        case _:
            raise ValueError(f"{shown(written)} is no space")

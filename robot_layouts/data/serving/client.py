"""An environment that another process serves, as Gymnasium's, and its spaces as they are sent."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces import Box, Dict, Space
from numpy.typing import NDArray

from robot_layouts.core.importing import optional
from robot_layouts.core.quoting import shown
from robot_layouts.data.playing.served.client import mapping_of, pack
from robots import RobotLayoutsError

SECONDS = 60.0  # for an answer: the first one takes as long as making the world
MOST_BYTES = 2**28  # of an observation
TOO_BIG = 1009  # of a websocket's codes
CALL, ERROR = "call", "error"
_SPACES = "action_space", "observation_space"


class RemoteTaskError(RobotLayoutsError, RuntimeError):
    """A served environment that refuses what it was asked, or cannot be reached."""


class RemoteEnv(gymnasium.Env[Any, Any]):
    """One environment of ``robot-layouts serve``; its world goes when it is closed.

    Attributes:
        about: What the server says of it: task, instruction, robots by place, arms, action split,
            control mode and frequency (Hz), most steps of an episode, observation mode, version.
        action_space: Action, (A,).
        observation_space: Observation.
    """

    def __init__(self, address: str, seconds: float = SECONDS) -> None:
        """Connect.

        Args:
            address: What the command printed: ``ws://HOST:PORT/?token=TOKEN``.
            seconds: Within which each answer has to arrive (s).

        Raises:
            RemoteTaskError: If nothing is served there, or the server takes no more clients.
            MissingPackageError: If websockets is not installed.
        """
        client = optional("websockets.sync.client", "a served task needs websockets", "served")
        self._errors = optional("websockets.exceptions", "a served task needs websockets", "served")
        self._name, self._seconds = address.partition("?")[0], seconds
        try:
            self._socket = client.connect(
                address, compression=None, max_size=MOST_BYTES, ping_interval=None
            )
        except self._errors.InvalidStatus as error:
            raise self._error(error.response.body.decode(errors="replace").strip()) from None
        except (OSError, self._errors.WebSocketException) as error:
            raise self._error(f"cannot be reached: {error}") from None
        try:
            self.about = self._receive("what it serves", *_SPACES)
            self.action_space, self.observation_space = map(self._space, _SPACES)
        except RemoteTaskError:
            self.close()
            raise

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin an episode in a world that is built anew, as every episode of its seed begins.

        Args:
            seed: Its seed; None lets the random streams run on.
            options: Not for this environment.

        Returns:
            Observation, whose arrays cannot be written to, and info.

        Raises:
            RemoteTaskError: If the seed is invalid; nothing has changed then.
        """
        own = int(seed) if isinstance(seed, np.integer) else seed
        answer = self._ask({CALL: "reset", "seed": own}, "observation", "info")
        return answer["observation"], answer["info"]

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Advance by one control step.

        Args:
            action: Shape (A,), or the numbers of each robot, (a,), by its place.

        Returns:
            Observation, reward, terminated, truncated and info.

        Raises:
            RemoteTaskError: If the action is invalid; the world is as it was then.
        """
        parts = isinstance(action, Mapping)
        sent = {n: np.asarray(p) for n, p in action.items()} if parts else np.asarray(action)
        names = "observation", "reward", "terminated", "truncated", "info"
        answer = self._ask({CALL: "step", "action": sent}, *names)
        return (answer["observation"], *(answer[name] for name in names[1:]))

    def close(self) -> None:
        """Close the connection; closing twice is allowed."""
        self._socket.close()

    def _ask(self, message: dict[str, Any], *names: str) -> dict[str, Any]:
        try:
            self._socket.send(pack(message))
        except self._errors.ConnectionClosed as error:
            raise self._closed(error) from None
        return self._receive("an answer", *names)

    def _space(self, name: str) -> Space[Any]:
        try:
            return read_space(self.about.pop(name))
        except (TypeError, ValueError) as error:
            raise self._error(f"sent no {name.replace('_', ' ')}: {error}") from None

    def _receive(self, what: str, *names: str) -> dict[str, Any]:
        """Return a mapping that has these names."""
        try:
            answer = mapping_of(self._socket.recv(timeout=self._seconds), what)
        except TimeoutError:
            self.close()  # its answer would come as that to another question
            raise self._error(f"sent no answer within {self._seconds:g} s") from None
        except self._errors.ConnectionClosed as error:
            raise self._closed(error) from None
        except ValueError as error:
            raise self._error(str(error)) from None
        if ERROR in answer:
            raise RemoteTaskError(str(answer[ERROR]))
        for name in names:
            if name not in answer:
                raise self._error(f"sent {what} without {name!r}")
        return answer

    def _closed(self, error: Any) -> RemoteTaskError:
        if error.rcvd_then_sent and error.rcvd.code == TOO_BIG:
            return self._error(f"reads no message as long as that: {error.rcvd.reason}")
        if error.sent is not None and error.sent.code == TOO_BIG:
            return self._error(f"sent a message of more than {MOST_BYTES / 1e6:.0f} MB")
        return self._error(f"closed the connection: {error}")

    def _error(self, what: str) -> RemoteTaskError:
        return RemoteTaskError(f"the environment at {self._name}: {what}")


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

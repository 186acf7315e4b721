"""The environments of a vector in this process, for debugging and for few of them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from tasks.fronts.batch import Batch, Part
from tasks.fronts.board import board_size, lay_out
from tasks.fronts.lost import Failure
from tasks.fronts.steps import Steps


class Step:
    """A step that is made when somebody waits for it.

    Attributes:
        done: Whether it was made.
    """

    def __init__(self, batch: Batch, env_ids: list[int] | None) -> None:
        """Take which environments of a batch it is of; None is all."""
        self._batch, self._env_ids, self.done = batch, env_ids, False

    def make(self) -> None:
        """Make it."""
        self.done = True  # also if it fails: once is enough
        self._batch.step(self._env_ids)


class InProcess:
    """What `Workers` does, without processes: each step is made when it is waited for.

    Attributes:
        parts: All parts, in the order of their environments.
        arrays: The board, with a row for every environment.
        failures: Nothing; what fails is raised as it is.
        steps: Steps that are to be made.
    """

    def __init__(self, parts: Sequence[Part]) -> None:
        """Make the batches.

        Raises:
            RobotLayoutsError: If the task cannot be made.
        """
        self.parts = list(parts)
        self.failures: dict[int, Failure] = {}
        self.steps: Steps[Step] = Steps()
        self._batches = [Batch(part) for part in parts]
        shapes, count = self._batches[0].shapes(), parts[-1].stop
        self.arrays = lay_out(bytearray(board_size(shapes, count)), shapes, count)
        for batch in self._batches:
            batch.attach(self.arrays)

    def env_ids(self, worker: int) -> range:
        """Return nothing: there are no workers."""
        return range(0)

    def start(self, numbers: Iterable[int]) -> None:
        """Do nothing: nothing is ever gone."""

    def expect_owner(self) -> None:
        """Do nothing: a fork has worlds of its own."""

    def call(self, method: str, arguments: Mapping[int, tuple[Any, ...]]) -> dict[int, Any]:
        """Call a method of some batches; see `Workers.call`."""
        self._make_steps(self.parts[-1].stop)
        return {i: getattr(self._batches[i], method)(*own) for i, own in arguments.items()}

    def send(self, number: int, env_ids: Sequence[int]) -> None:
        """Note a step; see `Workers.send`."""
        start, count = self.parts[number].start, len(self.parts[number].env_ids)
        some = None if len(env_ids) == count else [i - start for i in env_ids]
        self.steps.add(env_ids, lambda: Step(self._batches[number], some))

    def take(self, count: int) -> list[int]:
        """Make as many steps as are asked for; see `Workers.take`."""
        self._make_steps(count)
        return self.steps.take(count)

    def close(self) -> None:
        """Let the worlds go."""
        for batch in self._batches:
            batch.close()
        self.arrays = {}

    def _make_steps(self, count: int) -> None:
        for step in self.steps:
            if self.steps.ready >= count:
                break
            if not step.done:
                step.make()

"""``python -m measurements.processors.play``: short digests of all that episodes compute.

The episodes come on stdin as JSON; each yields a line. `measurements.processors.measure` runs this
in processes of its own, since libraries choose their functions as they are loaded.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterable, Iterator
from contextlib import closing
from hashlib import sha256
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray

from experts import find_expert
from robots import DescriptorError, TaskError
from tasks import MultiRobotTask, make
from tasks.episode import REBUILT
from tasks.varying.streams import Stream

EXPERT = "expert"
KINDS = ("actions", "states", "observations", "rewards")
REACH = 0.6  # m, rad; where an action number has no bound

Digests = dict[str, list[str]]


class Played(NamedTuple):
    """An episode to be played.

    Attributes:
        task: Id of the task.
        seed: Of its reset, and of its actions.
        control: `EXPERT`, or the control mode in which actions are random.
        steps: How many, if they are random.
    """

    task: str
    seed: int
    control: str
    steps: int

    def __str__(self) -> str:
        """Return it in words."""
        return f"{self.task}, seed {self.seed}, {self.control}"


def main() -> None:
    """Play what stdin lists."""
    torch.set_num_threads(int(os.environ.get("OMP_NUM_THREADS", "1")))
    for row in json.load(sys.stdin):
        print(json.dumps(digests(Played(*row))), flush=True)


def digests(played: Played) -> Digests | None:
    """Return the digests of an episode, one per moment; None if its robots lack the mode."""
    mode = None if played.control == EXPERT else played.control
    try:
        task = make(played.task, control_mode=mode)
    except (DescriptorError, TaskError):
        return None
    found: Digests = {kind: [] for kind in KINDS}
    with closing(task):
        for kind, value in _happening(task, played):
            found[kind].append(sha256(_bytes(value)).hexdigest()[:12])
    return found


def _happening(task: MultiRobotTask, played: Played) -> Iterator[tuple[str, Any]]:
    actions = _actions(task, played)
    observation, _ = task.reset(played.seed, REBUILT)
    yield from (("states", task.get_state_dict()), ("observations", observation))
    for action in actions:
        observation, reward, _, _, _ = task.step(action[None])
        yield from (("actions", action), ("states", task.get_state_dict()))
        yield from (("observations", observation), ("rewards", reward))


def _actions(task: MultiRobotTask, played: Played) -> Iterable[NDArray[np.float32]]:
    if played.control == EXPERT:
        return np.asarray(find_expert(played.task)(task, played.seed), np.float32)
    low, high = (
        np.where(np.isfinite(bound), bound, sign * REACH).astype(float)
        for bound, sign in zip(
            (task.single_action_space.low, task.single_action_space.high), (-1, 1), strict=True
        )
    )
    shares = (Stream(played.seed).numbers(len(low), "probe", step) for step in range(played.steps))
    return [(low + np.array(row) * (high - low)).astype(np.float32) for row in shares]


def _bytes(value: Any) -> bytes:
    if isinstance(value, dict):
        return b"".join(str(key).encode() + _bytes(value[key]) for key in sorted(value))
    return np.ascontiguousarray(value).tobytes()


if __name__ == "__main__":
    main()

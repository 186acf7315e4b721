"""How far an episode has come: the stages of a task, which are passed one after the other."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot_layouts.core.bounds import shown
from robots import TaskError, UnknownNameError

STAGE, STAGE_NAME, STAGE_SCORE = "stage", "stage_name", "stage_score"  # in info
SOLVED = "success"  # the last stage


class PassedStages:
    """Which stages the present episodes of N environments have passed.

    A stage is passed once its flag is true and all before it are passed; passed it stays. So the
    score never falls, and a policy that does the last thing first has come no farther. Success
    passes all of them.

    Attributes:
        passed: How many, (N,) int64.
    """

    passed: NDArray[np.int64]

    def __init__(self, stages: Mapping[str, float], num_envs: int) -> None:
        """Take a task's stages; see `tasks.engine.task.Task`."""
        self._flags = tuple(stages)
        self._names = np.array(["", *stages])
        self._scores = np.array([0.0, *stages.values()], np.float32)
        self.passed = np.zeros(num_envs, np.int64)

    def begin(self, env_ids: Iterable[int]) -> None:
        """Forget what was passed in environments whose episodes begin anew."""
        self.passed[list(env_ids)] = 0

    def told(self, info: Mapping[str, Any]) -> dict[str, NDArray[Any]]:
        """Return what info says of stages, after what `evaluate` returned.

        Returns:
            ``stage``, how many are passed, (N,) int64; ``stage_name``, the last of them, or an
            empty text, (N,) text; ``stage_score``, (N,) float32.

        Raises:
            UnknownNameError: If a stage is nothing that it returned.
            TaskError: If it is no flag.
        """
        passed, flags = self.passed, [_flag(info, name) for name in self._flags]
        for number, flag in enumerate(flags):
            passed += (passed == number) & flag
        passed[flags[-1]] = len(flags)
        return {
            STAGE: passed.copy(),
            STAGE_NAME: self._names[passed],
            STAGE_SCORE: self._scores[passed],
        }


def check_stages(task: str, stages: Any) -> None:
    """Refuse what are no stages.

    Args:
        task: The task's name.
        stages: What it declares.

    Raises:
        TaskError: If they are no scores by name that rise to 1, that of success.
    """
    names, scores = list[Any](), list[Any]()
    if isinstance(stages, Mapping):
        if not stages:
            return
        names, scores = [*stages], [*stages.values()]
    numbers = bool(scores) and all(isinstance(score, (int, float)) for score in scores)
    rising = numbers and all(low < high for low, high in pairwise([0.0, *scores]))
    if not rising or (names[-1], scores[-1]) != (SOLVED, 1.0):
        raise TaskError(
            f"{task}.stages is {shown(stages)}; scores by the names of flags that evaluate()"
            " returns are needed, each larger than the one before, the last {'success': 1.0}"
        )


def _flag(info: Mapping[str, Any], name: str) -> NDArray[np.bool_]:
    if name not in info:
        raise UnknownNameError("flag that evaluate() returns, for a stage,", name, [*info])
    if (flag := info[name]).dtype != bool or flag.ndim != 1:
        raise TaskError(f"the stage {name!r} must be a flag of each environment, (N,) bool")
    return flag

"""Who plays which case of a suite."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from experts import find_expert
from robots import TaskError, UnknownNameError
from rollouts.sources.policies import EXPERT, check_policy, find_policy
from rollouts.suite.files import OTHERS
from rollouts.suite.suite import Case, Suite
from tasks import get_task_class


class Player(NamedTuple):
    """Who plays.

    Attributes:
        policy: ``"expert"``, or what gives actions.
        name: Where it was imported from, ``module:name``; None if it was given as it is.
    """

    policy: Any
    name: str | None


def chosen_cases(suite: Suite, names: Sequence[str] = ()) -> tuple[Case, ...]:
    """Return the cases that some names mean, each that of a case or a task; all if there are none.

    Raises:
        UnknownNameError: If a name means none.
    """
    known = {case.name: {case.name} for case in suite.cases}
    for case in suite.cases:
        if case.task not in {other.name for other in suite.cases}:
            known.setdefault(case.task, set()).add(case.name)
    for name in names:
        if name not in known:
            raise UnknownNameError(f"case of the suite {suite.name}", name, known)
    wanted = {case for name in names for case in known[name]}
    return tuple(case for case in suite.cases if not names or case.name in wanted)


def chosen_policies(suite: Suite, cases: Sequence[Case], given: Any = None) -> dict[str, Player]:
    """Return who plays each case, by its name.

    Args:
        suite: Says who plays where nothing is given; if that says nothing, experts do.
        cases: Those that are played.
        given: One for all, or a mapping from tasks: a policy, or the name of one.

    Raises:
        UnknownNameError: If a task is unknown.
        TaskError: If a policy cannot be had, a task has no expert, or nobody plays a case.
    """
    by_task = named_policies(given if given is not None else suite.policies or EXPERT)
    found: dict[str, Player] = {}
    for case in cases:
        task = get_task_class(case.task).task_id
        player = by_task.get(task, by_task.get(OTHERS))
        if player is None:
            raise TaskError(f"nobody plays {task}; name its policy, or one for {OTHERS!r}")
        if player.policy == EXPERT:
            find_expert(task)  # refuses a task that has none
        found[case.name] = player
    return found


def named_policies(given: Any) -> dict[str, Player]:
    """Return who plays by the ids of tasks, and `OTHERS`; what is named is imported.

    Raises:
        UnknownNameError: If a task is unknown.
        TaskError: If a policy cannot be had, or is given twice.
    """
    several = given if isinstance(given, Mapping) else {OTHERS: given}
    found: dict[str, Player] = {}
    for task, policy in several.items():
        key = task if task == OTHERS else get_task_class(task).task_id
        if key in found:
            raise TaskError(f"the policy of {key} is given twice")
        found[key] = _player(policy)
    return found


def _player(policy: Any) -> Player:
    if isinstance(policy, str):
        return Player(find_policy(policy), None if policy == EXPERT else policy)
    return Player(check_policy(policy), None)

"""Plays the episodes of a receipt again, and tells what is not the same."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from typing import Any

from layouts.placement import RobotLike
from robots import RobotLayoutsError, UnknownNameError
from robots.common.bounds import checked_whole
from rollouts.playing.casting import Cast, cast_of
from rollouts.playing.evaluation_job import EvaluationJob, scores_of
from rollouts.playing.executor import Event, Executor, choose_executor
from rollouts.playing.together import grouped
from rollouts.receipts.comparison import Change, Difference, changes, episode_differences
from rollouts.receipts.evaluated import describe_job, receipt_of
from rollouts.receipts.making import make_again
from rollouts.receipts.receipt import Receipt, ReceiptError
from rollouts.receipts.sources import EXPERT, is_the_same_code
from tasks import MultiRobotTask, get_task_class
from tasks.episode import Policy
from tasks.registry import TASKS, make_scenario

_SHOWN = 10  # episodes that a text names


@dataclass(frozen=True)
class Verification:
    """What came of playing the episodes of a receipt again.

    Attributes:
        receipt: The receipt.
        here: The receipt of what was played here.
    """

    receipt: Receipt
    here: Receipt

    @property
    def equal(self) -> bool:
        """Whether all is the same but, perhaps, the environment: every bit, and every file."""
        return self.receipt.untouched and self.receipt.hash == self.here.hash

    @cached_property
    def differences(self) -> tuple[Difference, ...]:
        """The episodes that were not the same, in the receipt's order."""
        return tuple(episode_differences(self.receipt, self.here))

    @cached_property
    def changed(self) -> tuple[Change, ...]:
        """What they depend on and is not as in the receipt: versions, files, processor, …."""
        return tuple(changes(self.receipt, self.here))

    def __repr__(self) -> str:
        """Show it as a few lines."""
        receipt, total = self.receipt, len(self.receipt.episodes)
        lines = [
            f"{receipt.task['id']}, {receipt.policy['name']}: {total - len(self.differences)} of"
            f" {total} episodes equal to the last bit",
            *map(str, self.differences[:_SHOWN]),
        ]
        if more := len(self.differences[_SHOWN:]):
            lines.append(f"and {more} episodes more")
        if self.changed:
            lines += ["not as in the receipt:", *(f"  {change}" for change in self.changed)]
        return "\n".join(lines)


def verify(
    receipt: Receipt | str | PathLike[str],
    executor: Executor | None = None,
    on_event: Callable[[Event], None] = lambda event: None,
    *,
    workers: int | None = None,
    policy: Policy | str | None = None,
    task: str | None = None,
    robots: Mapping[str, RobotLike] | None = None,
    num_envs: int = 1,
) -> Verification:
    """Play the episodes of a receipt again, and compare everything.

    A receipt does not choose which code runs: a policy's or a task's module that no package lists
    is imported only if its file has the receipt's SHA-256. Otherwise it has to be named.

    Args:
        receipt: A receipt, or its file.
        executor: Who plays; None: as many processes as ``workers`` says.
        on_event: Called with each event of the executor, to show progress.
        workers: How many processes play; None: one for each core that this process may use; 0:
            none, but this one.
        policy: The policy, where the receipt cannot name it: as `rollouts.evaluate` takes it.
        task: The task, ``module:Id``, if it is in a module that no package lists.
        robots: Which robots these were, by place, where the receipt cannot say it.
        num_envs: How many episodes each process plays at once. Those of a batched policy are
            played as many at once as when the receipt was written.

    Raises:
        ReceiptError: If it cannot be read or is none; its task or policy cannot be had here, or
            would have to be named.
        TaskError: If a policy is given that is none, or both ``workers`` and an executor.
        AssetError: If robot files cannot be found.
        WorkerError: If the policy raised something, or workers die of it again and again.
    """
    recorded = receipt if isinstance(receipt, Receipt) else Receipt.read(receipt)
    checked_whole("num_envs", num_envs, 1, None, ReceiptError)
    cls = _task(recorded, task)
    cast, name = _cast(recorded, cls, policy)
    guessed = recorded.environment.get("guessed", {})
    making = make_again(recorded.making, guessed, cls, robots or {})
    seeds = [episode.seed for episode in recorded.episodes]
    at_once = recorded.making.get("num_envs", min(num_envs, len(seeds)))
    scenario = make_scenario(cls, at_once, **making)
    try:
        scenario.check(cls.reward_modes)
    except RobotLayoutsError as error:
        raise ReceiptError(f"the receipt's task cannot be made here: {error}") from error
    job = EvaluationJob(cls, scenario, cast, grouped(seeds, at_once), traced=True)
    described = describe_job(job, name)
    scores = scores_of(choose_executor(workers, executor), job, on_event)
    return Verification(
        recorded, receipt_of(described, job, {seed: scores[seed] for seed in seeds})
    )


def _task(receipt: Receipt, name: str | None) -> type[MultiRobotTask]:
    """Return the class of a receipt's task."""
    recorded, module = receipt.task["id"], receipt.task["class"].partition(":")[0]
    if name is not None:
        cls = get_task_class(name)
        if cls.task_id != recorded:
            raise ReceiptError(f"the receipt is of {recorded}, not of {cls.task_id}")
        return cls
    if recorded not in TASKS and not is_the_same_code(module, receipt.task["sha256"]):
        raise ReceiptError(_unlike("task", recorded, module) + f"--task {module}:{recorded}")
    try:
        return get_task_class(recorded if recorded in TASKS else f"{module}:{recorded}")
    except UnknownNameError as error:
        raise ReceiptError(f"the receipt's task cannot be made here: {error}") from error


def _cast(
    receipt: Receipt, cls: type[MultiRobotTask], policy: Policy | str | None
) -> tuple[Cast, str | None]:
    """Return who plays, and by which name that was imported."""
    if policy is None and receipt.policy["kind"] != EXPERT:
        policy = _recorded_policy(receipt)
    return cast_of(EXPERT if policy is None else policy, cls)


def _recorded_policy(receipt: Receipt) -> str:
    """Return the name of a receipt's policy, if it may be imported by that."""
    name, module = receipt.policy["name"], receipt.policy["name"].partition(":")[0]
    if receipt.policy.get("importable") is not True:
        raise ReceiptError(
            f"the receipt's policy {name} was no variable of a module, and cannot be imported"
            " again; pass it to rollouts.receipts.verify as policy=…"
        )
    if not is_the_same_code(module, receipt.policy["sha256"]):
        raise ReceiptError(_unlike("policy", name, module) + f"--policy {name}")
    return name


def _unlike(what: str, name: Any, module: str) -> str:
    return (
        f"the source of the {what} {name} is not that of the receipt: the module {module!r} cannot"
        " be found here or has changed since, and a receipt does not choose which code runs; to"
        " play what is here, name it: "
    )

"""Plays a suite: a receipt for each case, and nothing twice that has one."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any

from experts import find_expert
from robots import TaskError
from rollouts.evaluation import evaluate
from rollouts.playing.executor import Event, Executor, choose_executor
from rollouts.receipts.provenance import describe_expert, describe_policy
from rollouts.receipts.receipt import Receipt
from rollouts.sources.policies import EXPERT
from rollouts.suite.folder import SuiteRun, begin_run, read_run, receipt_path, sole_run
from rollouts.suite.policies import Player, chosen_cases, chosen_policies
from rollouts.suite.suite import Case, Suite, naming
from tasks.episode import Policy


def run_suite(
    suite: Suite,
    out: str | PathLike[str],
    policy: Policy | str | Mapping[str, Policy | str] | None = None,
    *,
    only: Sequence[str] = (),
    workers: int | None = None,
    executor: Executor | None = None,
    on_event: Callable[[Case, Event | None], None] = lambda case, event: None,
) -> SuiteRun:
    """Play the cases of a suite that have no receipt yet, and write one for each.

    If it is stopped, the same call goes on: cases that have a receipt are not played again.

    Args:
        suite: What is played; see `rollouts.suite.files.load_suite`.
        out: The folder of the run; it is made if need be. It keeps the suite with all that it
            includes as ``suite.yaml``, and the receipts as ``receipts/CASE.json``.
        policy: Who plays, ``"expert"``, ``"module:name"`` or what gives actions; or a mapping from
            tasks to these, in which ``"others"`` stands for all that are not named. None: as the
            suite says, else the experts.
        only: Names of cases, or of tasks, that are played; none for all.
        workers: See `rollouts.evaluate`.
        executor: See `rollouts.evaluate`.
        on_event: Called with each event of a case, to show progress; with None as the event if
            that has a receipt and is left alone.

    Returns:
        The run, with the receipts of all cases that have one.

    Raises:
        UnknownNameError: If a case or a task is unknown.
        TaskError: If nobody plays a task, or the folder holds the run of another suite, receipts
            of another policy, or a run that is playing; nothing was played then.
        ReceiptError: If a receipt in the folder is damaged, or was changed.
        WorkerError: If a policy raised something; finished receipts are kept.
    """
    executor, out = choose_executor(workers, executor), Path(out)
    cases = chosen_cases(suite, only)
    players = chosen_policies(suite, cases, policy)
    with sole_run(out):
        run = begin_run(out, suite)
        for case in cases:
            if case.name in run.receipts:
                _expect_same(run.receipts[case.name], players[case.name], receipt_path(out, case))
        for case in cases:
            if case.name in run.receipts:
                on_event(case, None)
            else:
                _play(case, players[case.name], receipt_path(out, case), executor, on_event)
        return read_run(out)


def _play(
    case: Case,
    player: Player,
    path: Path,
    executor: Executor,
    on_event: Callable[[Case, Event | None], None],
) -> None:
    with naming(case):
        evaluate(
            player.name or player.policy,
            case.task,
            case.seeds,
            executor=executor,
            receipt=path,
            on_event=lambda event: on_event(case, event),
            **case.making,
        )


def _expect_same(receipt: Receipt, player: Player, path: Path) -> None:
    """Refuse to go on with another policy than the one that a receipt is of.

    Raises:
        TaskError: If it is another.
    """
    if receipt.policy != (now := _described(receipt.task["id"], player)):
        before = receipt.policy
        changed = [key for key in {**before, **now} if before.get(key) != now.get(key)]
        raise TaskError(
            f"{path} is of the policy {before['name']}, and now {now['name']} is to play;"
            f" different: {', '.join(changed)}. Another policy needs a folder of its own"
        )


def _described(task_id: str, player: Player) -> Mapping[str, Any]:
    if player.policy == EXPERT:
        return describe_expert(find_expert(task_id))
    return describe_policy(player.policy, player.name)

"""Plays all that a run of a suite has receipts of again, and tells what is not the same."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from os import PathLike
from pathlib import Path
from shlex import quote

from rollouts.playing.executor import Event, Executor, choose_executor
from rollouts.receipts.provenance import EXPERT
from rollouts.receipts.receipt import Receipt, ReceiptError
from rollouts.receipts.verification import Verification, verify
from rollouts.suite.files import OTHERS
from rollouts.suite.folder import SuiteRun, read_run
from rollouts.suite.policies import named_policies
from rollouts.suite.suite import Case, naming
from tasks.episode import Policy


def verify_run(
    run: SuiteRun | str | PathLike[str],
    policy: Policy | str | Mapping[str, Policy | str] | None = None,
    *,
    workers: int | None = None,
    executor: Executor | None = None,
    on_event: Callable[[Case, Event], None] = lambda case, event: None,
) -> dict[str, Verification]:
    """Play the episodes of all receipts of a run again, and compare them to the last bit.

    Args:
        run: The run, or its folder.
        policy: Who plays where no expert does, as `rollouts.suite.run.run_suite` takes it.
        workers: See `rollouts.evaluate`.
        executor: See `rollouts.evaluate`.
        on_event: Called with each event of a case, to show progress.

    Returns:
        Case → what came of it, for all that have a receipt.

    Raises:
        TaskError: If there is no run in the folder.
        ReceiptError: If a receipt cannot be played again here, or nobody was named who plays it.
        WorkerError: If a policy raised something.
    """
    executor = choose_executor(workers, executor)
    run = run if isinstance(run, SuiteRun) else read_run(Path(run))
    given = {} if policy is None else named_policies(policy)
    players = {
        name: given.get(receipt.task["id"], given.get(OTHERS))
        for name, receipt in run.receipts.items()
    }
    _expect_named([run.receipts[name] for name, player in players.items() if player is None])
    found: dict[str, Verification] = {}
    for case in run.suite.cases:
        if case.name in run.receipts:
            player = players[case.name]
            with naming(case):
                found[case.name] = verify(
                    run.receipts[case.name],
                    executor,
                    lambda event, case=case: on_event(case, event),
                    policy=None if player is None else player.name or player.policy,
                )
    return found


def _expect_named(receipts: Sequence[Receipt]) -> None:
    """Refuse receipts of policies that can be imported, which nobody has named.

    Raises:
        ReceiptError: If there are some.
    """
    policies = {
        receipt.task["id"]: receipt.policy["name"]
        for receipt in receipts
        if receipt.policy["kind"] != EXPERT and receipt.policy.get("importable") is True
    }
    if policies:
        words = " ".join(quote(f"{task}={name}") for task, name in policies.items())
        raise ReceiptError(
            "a run does not choose which code runs; to play the policies of"
            f" {' and '.join(policies)} that are here, type: --policy {words}"
        )

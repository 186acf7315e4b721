"""Plays and verifies suites: a receipt for each case, and nothing twice that has one."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from os import PathLike
from pathlib import Path
from shlex import quote
from typing import Any

from robot_layouts.data.evaluation import evaluate
from robot_layouts.data.playing.executor import Event, Executor, choose_executor
from robot_layouts.data.receipts.provenance import describe_expert, describe_policy
from robot_layouts.data.receipts.receipt import Receipt, ReceiptError
from robot_layouts.data.receipts.verification import Verification, verify
from robot_layouts.data.sources.policies import EXPERT, check_policy, find_policy
from robot_layouts.data.suite.files import OTHERS
from robot_layouts.data.suite.folder import SuiteRun, begin_run, read_run, receipt_path, sole_run
from robot_layouts.data.suite.suite import Case, Suite, naming
from robot_layouts.experts import find_expert
from robots import TaskError, UnknownNameError
from tasks import get_task_class
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
        suite: What is played; see `robot_layouts.data.suite.files.load_suite`.
        out: The folder of the run; it is made if need be. It keeps the suite with all that it
            includes as ``suite.yaml``, and the receipts as ``receipts/CASE.json``.
        policy: Who plays, ``"expert"``, ``"module:name"`` or what gives actions; or a mapping from
            tasks to these, in which ``"others"`` stands for all that are not named. None: as the
            suite says, else the experts.
        only: Names of cases, or of tasks, that are played; none for all.
        workers: See `robot_layouts.data.evaluate`.
        executor: See `robot_layouts.data.evaluate`.
        on_event: Called with each event of a case, to show progress; with None as the event if
            that has a receipt and is left alone.

    Returns:
        The run, with the receipts of all cases that have one.

    Raises:
        UnknownNameError: If a case or a task is unknown.
        TaskError: If a task has no policy, or the folder holds the run of another suite, receipts
            of another policy, or a run that is playing; nothing was played then.
        ReceiptError: If a receipt in the folder is damaged, or was changed.
        WorkerError: If a policy raised something; finished receipts are kept.
    """
    executor, out = choose_executor(workers, executor), Path(out)
    cases = chosen_cases(suite, only)
    policies = chosen_policies(suite, cases, policy)
    with sole_run(out):
        run = begin_run(out, suite)
        for case in cases:
            if case.name in run.receipts:
                _expect_same(run.receipts[case.name], policies[case.name], receipt_path(out, case))
        for case in cases:
            if case.name in run.receipts:
                on_event(case, None)
                continue
            with naming(case):
                evaluate(
                    policies[case.name],
                    case.task,
                    case.seeds,
                    executor=executor,
                    receipt=receipt_path(out, case),
                    on_event=lambda event, case=case: on_event(case, event),
                    **case.making,
                )
        return read_run(out)


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
        policy: Who plays where no expert does, as `run_suite` takes it.
        workers: See `robot_layouts.data.evaluate`.
        executor: See `robot_layouts.data.evaluate`.
        on_event: Called with each event of a case, to show progress.

    Returns:
        Case → the result, for all that have a receipt.

    Raises:
        TaskError: If there is no run in the folder.
        ReceiptError: If a receipt cannot be played again here, or its policy was not named.
        WorkerError: If a policy raised something.
    """
    executor = choose_executor(workers, executor)
    run = run if isinstance(run, SuiteRun) else read_run(Path(run))
    given = {} if policy is None else _by_task(policy)
    policies = {
        name: given.get(receipt.task["id"], given.get(OTHERS))
        for name, receipt in run.receipts.items()
    }
    _expect_named([run.receipts[name] for name, own in policies.items() if own is None])
    found: dict[str, Verification] = {}
    for case in run.suite.cases:
        if case.name in run.receipts:
            with naming(case):
                found[case.name] = verify(
                    run.receipts[case.name],
                    executor,
                    lambda event, case=case: on_event(case, event),
                    policy=policies[case.name],
                )
    return found


def chosen_cases(suite: Suite, names: Sequence[str] = ()) -> tuple[Case, ...]:
    """Return the cases of some names, each of a case or a task; all if no name is given.

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


def chosen_policies(suite: Suite, cases: Sequence[Case], given: Any = None) -> dict[str, Any]:
    """Return who plays each case, by its name: a policy, or the name of one.

    Args:
        suite: Says who plays where nothing is given; if that says nothing, experts do.
        cases: Those that are played.
        given: One for all, or a mapping from tasks: a policy, or the name of one.

    Raises:
        UnknownNameError: If a task is unknown.
        TaskError: If a policy cannot be had or is given twice, a task has no expert, or a case has
            no policy.
    """
    by_task = _by_task(given if given is not None else suite.policies or EXPERT)
    found: dict[str, Any] = {}
    for case in cases:
        task = get_task_class(case.task).task_id
        policy = by_task.get(task, by_task.get(OTHERS))
        if policy is None:
            raise TaskError(f"nobody plays {task}; name its policy, or one for {OTHERS!r}")
        if policy == EXPERT:
            find_expert(task)  # refuses a task that has none
        found[case.name] = policy
    return found


def _by_task(given: Any) -> dict[str, Any]:
    """Return policies, or names of them, by the ids of tasks and `OTHERS`; all can be had."""
    several = given if isinstance(given, Mapping) else {OTHERS: given}
    found: dict[str, Any] = {}
    for task, policy in several.items():
        key = task if task == OTHERS else get_task_class(task).task_id
        if key in found:
            raise TaskError(f"the policy of {key} is given twice")
        (find_policy if isinstance(policy, str) else check_policy)(policy)
        found[key] = policy
    return found


def _expect_same(receipt: Receipt, policy: Any, path: Path) -> None:
    """Refuse to go on with another policy than the one that a receipt is of."""
    if policy == EXPERT:
        now = describe_expert(find_expert(receipt.task["id"]))
    elif isinstance(policy, str):
        now = describe_policy(find_policy(policy), policy)
    else:
        now = describe_policy(policy)
    if (before := receipt.policy) != now:
        changed = [key for key in {**before, **now} if before.get(key) != now.get(key)]
        raise TaskError(
            f"{path} is of the policy {before['name']}, and now {now['name']} is to play;"
            f" different: {', '.join(changed)}. Another policy needs a folder of its own"
        )


def _expect_named(receipts: Sequence[Receipt]) -> None:
    """Refuse receipts of policies that can be imported, and were not named."""
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

"""Plays and verifies suites; a run is a folder with a receipt for each case that was played."""

from __future__ import annotations

import os
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields
from os import PathLike
from pathlib import Path
from shlex import quote
from typing import Any

from robot_layouts.core.writing import claim, writing_errors
from robot_layouts.data.actors import EXPERT
from robot_layouts.data.evaluation import evaluate
from robot_layouts.data.playing.executor import Executor, choose_executor
from robot_layouts.data.playing.policies import check_policy, find_policy
from robot_layouts.data.playing.scheduler import Event
from robot_layouts.data.receipts.provenance import (
    describe_expert,
    describe_policy,
    make_again,
    same_layout,
)
from robot_layouts.data.receipts.receipt import Receipt, ReceiptError
from robot_layouts.data.receipts.verification import Verification, verify
from robot_layouts.data.suite.suite import OTHERS, Case, Suite, load_suite, naming, save_suite
from robot_layouts.experts import find_expert
from robots import TaskError, UnknownNameError
from robots.control_modes import plain_mode
from tasks import MultiRobotTask, Scenario, get_task_class
from tasks.episode import Policy
from tasks.registry import make_scenario

SUITE, RECEIPTS = "suite.yaml", "receipts"

_APART = ("layout", "num_envs", "check_layout")  # compared otherwise, or of no consequence


@dataclass(frozen=True)
class SuiteRun:
    """What has been played of a suite.

    Attributes:
        folder: Where it is kept.
        suite: The suite.
        receipts: By the names of the cases that were played, in the suite's order.
    """

    folder: Path
    suite: Suite
    receipts: Mapping[str, Receipt]

    @property
    def missing(self) -> tuple[str, ...]:
        """Names of the cases that have not been played."""
        return tuple(case.name for case in self.suite.cases if case.name not in self.receipts)


def receipt_path(folder: Path, case: Case) -> Path:
    """Return where the receipt of a case is, once it was played."""
    return folder / RECEIPTS / f"{case.name}.json"


@contextmanager
def sole_run(folder: Path) -> Generator[None]:
    """Let no other run play into a folder meanwhile; it is made if need be.

    Raises:
        TaskError: If another one does.
        UnwritableFileError: If it cannot be made.
    """
    with writing_errors(folder):
        folder.parent.mkdir(parents=True, exist_ok=True)
        right = claim(folder)
    if right is None:
        raise TaskError(f"another run is playing into {folder}; wait for its end")
    try:
        yield
    finally:
        os.close(right)


def begin_run(folder: Path, suite: Suite) -> SuiteRun:
    """Return the run of a suite in a folder, which is begun if need be.

    Raises:
        TaskError: If the folder holds the run of another suite, or something else.
        ReceiptError: If a receipt in it is damaged, or of something else.
        UnwritableFileError: If it cannot be written.
    """
    if (folder / SUITE).exists():
        run = expect_untouched(read_run(folder))
        if run.suite.hash != suite.hash:
            raise TaskError(
                f"{folder} holds a run of the suite {run.suite.name} {run.suite.id}; this is"
                f" {suite.name} {suite.id}, which needs a folder of its own"
            )
        return run
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise TaskError(f"{folder} holds something else; the run of a suite needs its own folder")
    run = SuiteRun(folder, suite, {})
    write_run(run)
    return run


def read_run(folder: Path) -> SuiteRun:
    """Return the run in a folder.

    Raises:
        TaskError: If there is none.
        ReceiptError: If a receipt in it is damaged, or of something else.
    """
    suite = read_suite(folder)
    found = {case.name: read_receipt(folder, case) for case in played_cases(folder, suite)}
    return SuiteRun(folder, suite, found)


def read_suite(folder: Path) -> Suite:
    """Return the suite of the run in a folder.

    Raises:
        TaskError: If there is none.
    """
    if not (folder / SUITE).is_file():
        raise TaskError(
            f"{folder} holds no run of a suite; `robot-layouts suite run SUITE --out {folder}`"
            " makes one"
        )
    return load_suite(folder / SUITE)


def played_cases(folder: Path, suite: Suite) -> list[Case]:
    """Return the cases of a suite that have a receipt in a folder, whatever it is."""
    return [case for case in suite.cases if receipt_path(folder, case).exists()]


def read_receipt(folder: Path, case: Case) -> Receipt:
    """Return the receipt of a case: of the same task, seeds, places and settings.

    Files of robots and sources of tasks are not compared: that is what verifying is for.

    Raises:
        ReceiptError: If it is damaged, of another task, of other seeds, or made otherwise.
    """
    path = receipt_path(folder, case)
    receipt = Receipt.read(path)
    cls = get_task_class(case.task)
    if receipt.task["id"] != cls.task_id:
        raise ReceiptError(f"{path} is of {receipt.task['id']}, not of {cls.task_id}")
    if {episode.seed for episode in receipt.episodes} != {*case.seeds}:
        raise ReceiptError(f"{path} has other seeds than the case {case.name} of its suite")
    try:
        guessed = receipt.environment.get("guessed", {})
        made = make_scenario(cls, **make_again(receipt.making, guessed, cls, {}))
    except ReceiptError as error:
        raise ReceiptError(f"{path}: {error}") from error
    others = list(_differing(cls, made, make_scenario(cls, **case.making)))
    if others:
        raise ReceiptError(
            f"{path} was not made as the case {case.name} of its suite: different are"
            f" {', '.join(others)}"
        )
    return receipt


def write_run(run: SuiteRun) -> None:
    """Write the suite and the receipts of a run to its folder, which is made if need be.

    Raises:
        UnwritableFileError: If they cannot be written.
    """
    with writing_errors(run.folder):
        run.folder.mkdir(parents=True, exist_ok=True)
    save_suite(run.suite, run.folder / SUITE)
    for case in run.suite.cases:
        if case.name in run.receipts:
            run.receipts[case.name].write(receipt_path(run.folder, case))


def expect_untouched(run: SuiteRun) -> SuiteRun:
    """Return a run of which every receipt is as it was written.

    Raises:
        ReceiptError: If one is not.
    """
    for case in run.suite.cases:
        if case.name in run.receipts:
            untouched(run.receipts[case.name], receipt_path(run.folder, case))
    return run


def untouched(receipt: Receipt, path: Path) -> Receipt:
    """Return a receipt that is as it was written.

    Raises:
        ReceiptError: If it is not.
    """
    if not receipt.untouched:
        raise ReceiptError(f"{path} was changed after it was written: its hash is another")
    return receipt


def _differing(cls: type[MultiRobotTask], made: Scenario, wanted: Scenario) -> Iterator[str]:
    if not same_layout(made.layout, wanted.layout):
        yield "layout"
    for field in fields(Scenario):
        name = field.name
        if name not in _APART and _plain(cls, made, name) != _plain(cls, wanted, name):
            yield name


def _plain(cls: type[MultiRobotTask], scenario: Scenario, name: str) -> Any:
    """Return a field of a scenario; what was left out as the task fills it in."""
    value: Any = getattr(scenario, name)
    if name == "control_mode" and value is not None:
        return plain_mode(value)
    defaults = {"reward_mode": cls.reward_modes[0], "max_episode_steps": cls.max_episode_steps}
    return defaults.get(name) if value is None else value


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
        suite: What is played; see `robot_layouts.data.suite.suite.load_suite`.
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
    episodes: int | None = None,
    workers: int | None = None,
    executor: Executor | None = None,
    on_event: Callable[[Case, Event], None] = lambda case, event: None,
) -> dict[str, Verification]:
    """Play the episodes of all receipts of a run again, and compare them to the last bit.

    Args:
        run: The run, or its folder.
        policy: Who plays where no expert does, as `run_suite` takes it.
        episodes: Play so many of each receipt alone; see `verify`.
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
                    episodes=episodes,
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
        TaskError: If a policy is unavailable or given twice, a task has no expert, or a case has no
            policy.
    """
    by_task = _by_task(given if given is not None else suite.policies or EXPERT)
    found: dict[str, Any] = {}
    for case in cases:
        task = get_task_class(case.task).task_id
        policy = by_task.get(task, by_task.get(OTHERS))
        if policy is None:
            raise TaskError(f"{task} has no policy; name one, or one for {OTHERS!r}")
        if policy == EXPERT:
            find_expert(task)  # refuses a task that has none
        found[case.name] = policy
    return found


def _by_task(given: Any) -> dict[str, Any]:
    """Return policies, or names of them, by the ids of tasks and `OTHERS`; all are available."""
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

"""The folder of a suite's run: the suite with all that it includes, and a receipt for each case."""

from __future__ import annotations

import os
from collections.abc import Generator, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from robot_layouts.core.writing import writing_errors
from robot_layouts.data.receipts.making import make_again, same_layout
from robot_layouts.data.receipts.receipt import Receipt, ReceiptError
from robot_layouts.data.recording.disk import claim
from robot_layouts.data.suite.files import load_suite, save_suite
from robot_layouts.data.suite.suite import Case, Suite
from robots import TaskError
from robots.control_modes import plain_mode
from tasks import MultiRobotTask, Scenario, get_task_class
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
    with writing_errors(folder):
        folder.mkdir(parents=True, exist_ok=True)
    save_suite(suite, folder / SUITE)
    return SuiteRun(folder, suite, {})


def read_run(folder: Path) -> SuiteRun:
    """Return the run in a folder.

    Raises:
        TaskError: If there is none.
        ReceiptError: If a receipt in it is damaged, or of something else.
    """
    if not (folder / SUITE).is_file():
        raise TaskError(
            f"{folder} holds no run of a suite; `robot-layouts suite run SUITE --out {folder}`"
            " makes one"
        )
    suite = load_suite(folder / SUITE)
    found = {
        case.name: expect_of_case(Receipt.read(path), case, path)
        for case in suite.cases
        if (path := receipt_path(folder, case)).exists()
    }
    return SuiteRun(folder, suite, found)


def expect_untouched(run: SuiteRun) -> SuiteRun:
    """Return a run of which every receipt is as it was written.

    Raises:
        ReceiptError: If one is not.
    """
    for case in run.suite.cases:
        receipt = run.receipts.get(case.name)
        if receipt is not None and not receipt.untouched:
            path = receipt_path(run.folder, case)
            raise ReceiptError(f"{path} was changed after it was written: its hash is another")
    return run


def expect_of_case(receipt: Receipt, case: Case, path: Path) -> Receipt:
    """Return a receipt that is of a case: the same task, seeds, places and settings.

    Files of robots and sources of tasks are not compared: that is what verifying is for.

    Args:
        receipt: The receipt.
        case: The case.
        path: Where the receipt is, for errors.

    Raises:
        ReceiptError: If it is of another task, of other seeds, or made otherwise.
    """
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

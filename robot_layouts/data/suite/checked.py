"""Which results of a run can be listed: those that were played again, and are equal."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from pathlib import Path

from robot_layouts.data.actors import EXPERT
from robot_layouts.data.playing.executor import Executor
from robot_layouts.data.playing.scheduler import Event
from robot_layouts.data.receipts.receipt import Receipt
from robot_layouts.data.receipts.verification import verify
from robot_layouts.data.suite.run import (
    SuiteRun,
    played_cases,
    read_receipt,
    read_suite,
    receipt_path,
    untouched,
)
from robot_layouts.data.suite.suite import Case, naming
from robots import RobotLayoutsError, TaskError

EPISODES = 3  # of each receipt that are played again, unless more are asked for


@dataclass(frozen=True)
class CheckedRun:
    """A run of which some episodes were played again.

    Attributes:
        run: The run, with those receipts alone of which every episode played was equal.
        played: How many episodes of each of them were played.
        unplayed: Receipts of policies that were not named, and of which nothing was played, by
            case.
        wrong: Why other receipts cannot be listed, in words, by case.
    """

    run: SuiteRun
    played: Mapping[str, int]
    unplayed: Mapping[str, Receipt]
    wrong: Mapping[str, str]


def check_run(
    folder: Path,
    episodes: int = EPISODES,
    policies: Collection[str] = (),
    *,
    executor: Executor,
    on_event: Callable[[Case, Event], None] = lambda case, event: None,
) -> CheckedRun:
    """Play some episodes of each receipt of a run again, as `robot_layouts.data.receipts.verify`.

    A run chooses no code: experts play, and policies that are named.

    Args:
        folder: The run's folder.
        episodes: How many of each receipt are played, drawn at random.
        policies: Policies that may be imported or asked, as receipts name them.
        executor: Who plays.
        on_event: Called with each event of a case, to show progress.

    Raises:
        TaskError: If there is no run in the folder, or nothing was played in it.
    """
    suite = read_suite(folder)
    cases = played_cases(folder, suite)
    if not cases:
        raise TaskError(f"nothing has been played in {folder}; there is nothing to report")
    equal, played = dict[str, Receipt](), dict[str, int]()
    unplayed, wrong = dict[str, Receipt](), dict[str, str]()
    for case in cases:
        try:
            receipt = untouched(read_receipt(folder, case), receipt_path(folder, case))
            name = receipt.policy["name"]
            expert = receipt.policy["kind"] == EXPERT
            if not expert and name not in policies:
                unplayed[case.name] = receipt
                continue
            with naming(case):
                found = verify(
                    receipt,
                    executor,
                    lambda event, case=case: on_event(case, event),
                    policy=None if expert else name,
                    episodes=episodes,
                )
        except RobotLayoutsError as error:
            wrong[case.name] = str(error).replace(f"{folder}{os.sep}", "")
            continue
        if found.equal:
            equal[case.name], played[case.name] = receipt, len(found.here.episodes)
        else:
            wrong[case.name] = repr(found)
    return CheckedRun(SuiteRun(folder, suite, equal), played, unplayed, wrong)

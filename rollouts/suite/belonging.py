"""Whether a receipt is of a case of a suite: the same task, seeds, places and settings."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path
from typing import Any

from robots.control_modes import plain_mode
from rollouts.reading.recorded_task import same_places
from rollouts.receipts.making import make_again
from rollouts.receipts.receipt import Receipt, ReceiptError
from rollouts.suite.suite import Case
from tasks import MultiRobotTask, Scenario, get_task_class
from tasks.registry import make_scenario

# Compared otherwise, or of no consequence.
_APART = ("layout", "num_envs", "check_layout")


def expect_of_case(receipt: Receipt, case: Case, path: Path) -> None:
    """Refuse a receipt of something else than a case.

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


def _differing(cls: type[MultiRobotTask], made: Scenario, wanted: Scenario) -> Iterator[str]:
    if not same_places(made.layout, wanted.layout) or _modes(made) != _modes(wanted):
        yield "layout"
    for field in fields(Scenario):
        name = field.name
        if name not in _APART and _plain(cls, made, name) != _plain(cls, wanted, name):
            yield name


def _modes(scenario: Scenario) -> list[str | None]:
    return [placement.control_mode for placement in scenario.layout.values()]


def _plain(cls: type[MultiRobotTask], scenario: Scenario, name: str) -> Any:
    """Return a field of a scenario; what was left out as the task fills it in."""
    value: Any = getattr(scenario, name)
    if name == "control_mode" and value is not None:
        return plain_mode(value)
    defaults = {"reward_mode": cls.reward_modes[0], "max_episode_steps": cls.max_episode_steps}
    return defaults.get(name) if value is None else value

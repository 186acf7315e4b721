"""What a report says is missing, kind by kind."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from experts import list_experts
from parity.compare.native_env import INSTALL
from parity.compare.task_summary import number_text
from parity.records.inventory import missing_tasks
from parity.report.figures import is_verified
from parity.report.tasks import no_clip, problems
from robots import MissingPackageError


@dataclass(frozen=True)
class Item:
    """What is missing for one and the same reason."""

    names: tuple[str, ...]
    why: str = ""


@dataclass(frozen=True)
class Group:
    """What is missing of one kind; ``nothing`` stands there if ``entries`` is empty."""

    title: str
    entries: tuple[Item, ...]
    nothing: str = "None."


def missing(swept: Mapping[str, Mapping[str, Any] | None]) -> Iterator[Group]:
    """Yield what is not there yet, kind by kind.

    Args:
        swept: Each task's entry in the sweep's summary, or None.
    """
    experts = list_experts()
    yield Group(
        "Tasks without a verified clip",
        grouped(
            (task, _why_not_verified(entry))
            for task, entry in swept.items()
            if not is_verified(entry)
        ),
        "None: in every task’s clip both sides succeed and every pixel is equal.",
    )
    yield Group(
        "Tasks without a scripted expert",
        grouped((task, "") for task in swept if task not in experts),
    )
    yield Group(
        "Failures and differences",
        grouped((task, problem) for task, entry in swept.items() for problem in problems(entry)),
        "None in this sweep.",
    )


def grouped(found: Iterable[tuple[str, str]]) -> tuple[Item, ...]:
    """Put what is missing for the same reason together; takes pairs of name and reason."""
    by_reason: dict[str, list[str]] = {}
    for name, why in found:
        by_reason.setdefault(why, []).append(name)
    return tuple(Item(tuple(names), why) for why, names in by_reason.items())


def _why_not_verified(entry: Mapping[str, Any] | None) -> str:
    if entry is None or not entry["clip"]:
        return no_clip(entry)
    clip = entry["clip"]
    remarks: list[str] = []
    if not clip["native_success"]:
        remarks.append("native does not succeed")
    if not clip["our_success"]:
        remarks.append("the clone does not succeed")
    if clip["differing_frames"]:
        remarks.append(f"{clip['differing_frames']} of {clip['frames']} frames differ")
    if clip["max_state_difference"]:
        remarks.append(f"the states differ by up to {number_text(clip['max_state_difference'])}")
    return "; ".join(remarks)


def not_cloned() -> tuple[tuple[Item, ...] | None, str]:
    """Return native's tasks that are not cloned, or None and how to have them known."""
    try:
        return grouped((task.task_id, task.reason) for task in missing_tasks()), ""
    except MissingPackageError:
        return None, f"They are known where mani_skill is installed: {INSTALL}"

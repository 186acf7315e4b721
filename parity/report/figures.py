"""The table of a report and its headline figures."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from parity.compare.snapshot import STATE
from parity.compare.task_summary import REWARD, number_text, success_text
from parity.show.clip import SideBySide

UNKNOWN = "–"

_RECORDED_REST = ("observation", "info")


@dataclass(frozen=True)
class Cell:
    """One figure of the table.

    Attributes:
        text: What is shown.
        number: Whether it is one, and stands on the right.
        bad: Whether it tells of a difference.
        sort: What the table is sorted by; the text if empty.
    """

    text: str
    number: bool = True
    bad: bool = False
    sort: str = ""

    @property
    def muted(self) -> bool:
        """Whether there is nothing to show."""
        return self.text == UNKNOWN


@dataclass(frozen=True)
class Column:
    """Heading of a column of the table, and how a task's cell in it is made."""

    name: str
    number: bool = True


COLUMNS = (  # the first six of the record, the others of the sweep; they break where \n is
    Column("episodes"),
    Column("steps"),
    Column("contact\nsteps"),
    Column("max |Δ|\nstate"),
    Column("max |Δ|\nrest"),
    Column("success\nnative / here"),
    Column("actions", number=False),
    Column("episodes\nequal"),
    Column("success\nnative / here"),
    Column("max |Δ|\nall"),
    Column("mean |Δ|\nof pixels"),
    Column("frames\nthat differ"),
)
RECORDED_COLUMNS = 6


@dataclass(frozen=True)
class Tile:
    """A headline figure."""

    value: str
    label: str
    note: str = ""
    bad: bool = False


def tiles(
    swept: Mapping[str, Mapping[str, Any] | None], recorded: Mapping[str, Mapping[str, Any]]
) -> Iterator[Tile]:
    """Yield the headline figures.

    Args:
        swept: Each task's entry in the sweep's summary, or None.
        recorded: The recorded comparison by task.
    """
    equal = sum(bool(result["equal"]) for result in recorded.values())
    counts = {key: sum(r[key] for r in recorded.values()) for key in ("episodes", "steps")}
    largest = max(
        (float(x) for result in recorded.values() for x in _differences(result)), default=0.0
    )
    yield Tile(
        f"{equal} of {len(swept)}", "tasks equal to native", "to the last bit", equal < len(swept)
    )
    yield Tile(
        number_text(largest),
        "largest difference",
        f"{counts['episodes']:,} recorded episodes, {counts['steps']:,} steps",
        largest > 0,
    )
    agreements = [entry["agreement"] for entry in swept.values() if entry and entry["agreement"]]
    same, played = (sum(found[key] for found in agreements) for key in ("equal", "episodes"))
    yield Tile(f"{same} of {played}", "replayed episodes equal", "in this sweep", same < played)
    verified = sum(is_verified(entry) for entry in swept.values())
    yield Tile(
        f"{verified} of {len(swept)}",
        "verified clips",
        "both sides succeed, every pixel equal",
    )


def is_verified(entry: Mapping[str, Any] | None) -> bool:
    """Tell whether a clip shows both sides succeed without any difference."""
    return entry is not None and bool(entry["clip"]) and SideBySide(**entry["clip"]).verified


def cells(entry: Mapping[str, Any] | None, result: Mapping[str, Any] | None) -> list[Cell]:
    """Return a task's figures, one for each of `COLUMNS`.

    Args:
        entry: The task's entry in the sweep's summary, or None.
        result: Its recorded comparison, or None.
    """
    return [*_recorded_cells(result), *_swept_cells(entry or {})]


def _recorded_cells(result: Mapping[str, Any] | None) -> list[Cell]:
    if result is None:
        return [Cell(UNKNOWN)] * 6
    largest = result["max_difference"]
    state = max(float(largest[quantity]) for quantity in STATE)
    rest = max(*(float(largest[q]) for q in _RECORDED_REST), *map(float, result[REWARD].values()))
    success = result["success"]
    return [
        *(_count(result[key]) for key in ("episodes", "steps", "contact_steps")),
        _difference(state),
        _difference(rest),
        _success(success_text(result), success["native"], success["ours"]),
    ]


def _swept_cells(entry: Mapping[str, Any]) -> list[Cell]:
    agreement, rollout, clip = (entry.get(key) for key in ("agreement", "rollout", "clip"))
    found = [Cell(entry.get("source") or UNKNOWN, number=False)]
    if agreement:
        equal, played = agreement["equal"], agreement["episodes"]
        native, ours = agreement["native_success"], agreement["our_success"]
        found.append(Cell(f"{equal} / {played}", bad=equal < played, sort=str(equal / played)))
        found.append(_success(f"{native} / {ours}", native, ours))
    else:
        found.extend([Cell(UNKNOWN)] * 2)
    both = [part["max_difference"] for part in (agreement, rollout) if part]
    found.append(_difference(max(map(float, both))) if both else Cell(UNKNOWN))
    if clip:
        differing, frames = clip["differing_frames"], clip["frames"]
        found.append(_difference(clip["mean_pixel_difference"]))
        found.append(Cell(f"{differing} of {frames}", bad=differing > 0, sort=str(differing)))
    else:
        found.extend([Cell(UNKNOWN)] * 2)
    return found


def _count(value: int) -> Cell:
    return Cell(f"{value:,}", sort=str(value))


def _difference(value: float) -> Cell:
    return Cell(number_text(value), bad=value != 0, sort=str(value))


def _success(text: str, native: int, ours: int) -> Cell:
    return Cell(text, bad=native != ours, sort=str(native))


def _differences(result: Mapping[str, Any]) -> list[float | str]:
    return [*result["max_difference"].values(), *result[REWARD].values()]

"""How two receipts differ: in episodes, by seed and step, and in what these depend on."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from robot_layouts.data.playing.comparison import first_row
from robot_layouts.data.receipts.receipt import EpisodeReceipt, Receipt

_SHOWN = 60  # characters of a value
_DIGITS = 12  # of a SHA-256
_Path = tuple[str, ...]  # keys of a receipt's json


@dataclass(frozen=True)
class EpisodeDifference:
    """An episode that was not the same.

    Attributes:
        seed: Its seed.
        step: The first control step after which the states differ, 0 being the reset; None if the
            states are the same and only other fields are not.
        recorded: The episode in the receipt.
        here: The episode that was played here.
    """

    seed: int
    step: int | None
    recorded: EpisodeReceipt
    here: EpisodeReceipt

    def __str__(self) -> str:
        """Name the step, and all that differs besides."""
        where = "states differ after the reset already" if self.step == 0 else "states are the same"
        if self.step:
            where = f"states differ from step {self.step} on"
        fields = {"steps": "steps", "success": "success", "return": "total", "reason": "reason"}
        pairs = {n: (getattr(self.recorded, f), getattr(self.here, f)) for n, f in fields.items()}
        others = [
            f"{name} {_or_none(before)} in the receipt, {_or_none(now)} here"
            for name, (before, now) in pairs.items()
            if before != now
        ]
        return "; ".join([f"seed {self.seed}: {where}", *others])


@dataclass(frozen=True)
class Change:
    """Something that episodes depend on, and that is not what the receipt says.

    Attributes:
        about: ``"version"``, ``"processor"``, ``"file"`` (of a robot), ``"policy"``, ``"task"``,
            ``"making"``, ``"variable"`` (of the environment) or ``"receipt"``.
        name: Which.
        recorded: What the receipt says; None if nothing.
        here: What it is here; None if it does not exist.
    """

    about: str
    name: str
    recorded: Any
    here: Any

    def __str__(self) -> str:
        """Name it, with both values."""
        return f"{self.name}: {_shown(self.recorded)} in the receipt, {_shown(self.here)} here"


def episode_differences(recorded: Receipt, here: Receipt) -> Iterator[EpisodeDifference]:
    """Yield the episodes that are not the same, in the order of the receipt; both have all."""
    played = {episode.seed: episode for episode in here.episodes}
    for before in recorded.episodes:
        now = played[before.seed]
        if before != now:
            yield EpisodeDifference(before.seed, first_step(before, now), before, now)


def first_step(before: EpisodeReceipt, now: EpisodeReceipt) -> int | None:
    """Return the first step that differs; the last one if the short digests are equal."""
    if before.states == now.states:
        return None
    row = first_row(before.digests(), now.digests())
    return min(before.steps, now.steps) if row is None else row


def changes(recorded: Receipt, here: Receipt) -> Iterator[Change]:
    """Yield whatever else is not the same, each named."""
    if not recorded.untouched:
        name = "the receipt was changed after it was written: its SHA-256"
        yield Change("receipt", name, recorded.claimed, recorded.hash)
    for part in ("task", "policy", "making", "environment"):
        before, now = (dict(_leaves(getattr(each, part), (part,))) for each in (recorded, here))
        for path in dict.fromkeys([*before, *now]):
            if before.get(path) != now.get(path) and (what := _named(path, recorded)):
                yield Change(*what, before.get(path), now.get(path))


def _named(path: _Path, receipt: Receipt) -> tuple[str, str] | None:
    """Return what a leaf of a receipt is about, and its name; None if it is of no consequence."""
    match path:
        case ("task", *rest):
            module = receipt.task["class"].partition(":")[0]
            return "task", f"task {receipt.task['id']}, {_source(rest, module)}"
        case ("policy", *rest):
            kind, name = receipt.policy["kind"], receipt.policy["name"]
            return "policy", f"{kind} {name}, {_source(rest, name.partition(':')[0])}"
        case ("making", "layout", place, "files", *file):
            robot = receipt.making["layout"].get(place, {}).get("robot", "another")
            return "file", f"file {'/'.join(file)} of the robot {place} ({robot})"
        case ("making", "layout", place, "descriptor"):
            return "making", f"descriptor of the robot {place}"
        case ("making", *rest):
            return "making", ".".join(rest)
        case ("environment", "variables"):
            return "variable", "environment variables that the policy reads"
        case ("environment", "versions", package):
            return "version", f"version of {package}"
        case ("environment", "processor", name):
            return "processor", f"processor, {name}"
        case _:
            return None


def _source(path: list[str], module: str) -> str:
    if path == ["sha256"]:
        return f"source of the module {module}"
    words = {"also": "source of the module", "files": "file", "weights": "weights of"}
    return " ".join([words.get(path[0], path[0]), *path[1:]])


def _leaves(
    about: Mapping[str, Any], path: tuple[str, ...]
) -> Iterator[tuple[tuple[str, ...], Any]]:
    for name, value in about.items():
        if isinstance(value, dict) and value:
            yield from _leaves(value, (*path, name))
        else:
            yield (*path, name), value


def _or_none(value: Any) -> Any:
    return "none" if value == "" else value


def _shown(value: Any) -> str:
    if value is None:
        return "nothing"
    text = str(value)
    if len(text) == 64 and " " not in text:
        return f"{text[:_DIGITS]}…"
    return text if len(text) <= _SHOWN else f"{text[: _SHOWN - 1]}…"

"""How two receipts differ: in episodes, by seed and step, and in what these depend on."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import zip_longest
from typing import Any

from rollouts.receipts.receipt import EpisodeReceipt, Receipt

_SHOWN = 60  # characters of a value
_DIGITS = 12  # of a SHA-256


@dataclass(frozen=True)
class Difference:
    """An episode that was not the same.

    Attributes:
        seed: Its seed.
        step: The first control step after which the states differ, 0 being the reset; None if the
            states are the same and only what is said of them is not.
        recorded: What the receipt says.
        here: How it went here.
    """

    seed: int
    step: int | None
    recorded: EpisodeReceipt
    here: EpisodeReceipt

    def __str__(self) -> str:
        """Say it in words."""
        where = "states differ after the reset already" if self.step == 0 else "states are the same"
        if self.step:
            where = f"states differ from step {self.step} on"
        before, now = self.recorded, self.here
        told = [
            f"{name} {was} in the receipt, {found} here"
            for name, was, found in (
                ("steps", before.steps, now.steps),
                ("success", before.success, now.success),
                ("return", before.total, now.total),
                ("reason", before.reason or "none", now.reason or "none"),
            )
            if was != found
        ]
        return "; ".join([f"seed {self.seed}: {where}", *told])


@dataclass(frozen=True)
class Change:
    """Something that episodes depend on, and that is not what the receipt says.

    Attributes:
        about: ``"version"``, ``"processor"``, ``"file"`` (of a robot), ``"policy"``, ``"task"``,
            ``"making"``, ``"variable"`` (of the environment) or ``"receipt"``.
        name: Which.
        recorded: What the receipt says; None if nothing.
        here: What it is here; None if there is none.
    """

    about: str
    name: str
    recorded: Any
    here: Any

    def __str__(self) -> str:
        """Say it in words."""
        return f"{self.name}: {_shown(self.recorded)} in the receipt, {_shown(self.here)} here"


def episode_differences(recorded: Receipt, here: Receipt) -> Iterator[Difference]:
    """Yield the episodes that are not the same, in the order of the receipt; both have all."""
    played = {episode.seed: episode for episode in here.episodes}
    for before in recorded.episodes:
        now = played[before.seed]
        if before != now:
            yield Difference(before.seed, first_step(before, now), before, now)


def changes(recorded: Receipt, here: Receipt) -> Iterator[Change]:
    """Yield whatever else is not the same, each named."""
    if not recorded.untouched:
        name = "the receipt was changed after it was written: its SHA-256"
        yield Change("receipt", name, recorded.claimed, recorded.hash)
    for part, named in _PARTS.items():
        before, now = (dict(_leaves(getattr(each, part))) for each in (recorded, here))
        for path in dict.fromkeys([*before, *now]):
            if before.get(path) != now.get(path) and (what := named(path, recorded, here)):
                yield Change(*what, before.get(path), now.get(path))


def first_step(before: EpisodeReceipt, now: EpisodeReceipt) -> int | None:
    """Return the first moment that differs; the last one if the short digests do not tell."""
    if before.states == now.states:
        return None
    pairs = enumerate(zip_longest(before.moments(), now.moments()))
    last = min(before.steps, now.steps)
    return next((step for step, (was, found) in pairs if was != found), last)


Path = tuple[str, ...]
Named = tuple[str, str] | None


def _of_task(path: Path, recorded: Receipt, here: Receipt) -> Named:
    module = recorded.task["class"].partition(":")[0]
    return "task", f"task {recorded.task['id']}, {_source(path, module)}"


def _of_policy(path: Path, recorded: Receipt, here: Receipt) -> Named:
    kind, name = recorded.policy["kind"], recorded.policy["name"]
    return "policy", f"{kind} {name}, {_source(path, name.partition(':')[0])}"


def _source(path: Path, module: str) -> str:
    if path == ("sha256",):
        return f"source of the module {module}"
    words = {"also": "source of the module", "files": "file", "weights": "weights of"}
    return " ".join([words.get(path[0], path[0]), *path[1:]])


def _of_making(path: Path, recorded: Receipt, here: Receipt) -> Named:
    if path[0] == "layout" and path[2:3] == ("files",):
        robot = recorded.making["layout"].get(path[1], {}).get("robot", "another")
        return "file", f"file {'/'.join(path[3:])} of the robot {path[1]} ({robot})"
    if path[0] == "layout" and path[2:3] == ("descriptor",):
        return "making", f"descriptor of the robot {path[1]}"
    return "making", ".".join(path)


def _of_environment(path: Path, recorded: Receipt, here: Receipt) -> Named:
    if path[0] == "variables":
        return "variable", "environment variables that the policy reads"
    if path[0] == "versions":
        return "version", f"version of {path[1]}"
    return ("processor", f"processor, {path[1]}") if path[0] == "processor" else None


_PARTS = {
    "task": _of_task,
    "policy": _of_policy,
    "making": _of_making,
    "environment": _of_environment,
}


def _leaves(about: Mapping[str, Any], path: Path = ()) -> Iterator[tuple[Path, Any]]:
    for name, value in about.items():
        if isinstance(value, dict) and value:
            yield from _leaves(value, (*path, name))
        else:
            yield (*path, name), value


def _shown(value: Any) -> str:
    if value is None:
        return "nothing"
    text = str(value)
    if len(text) == 64 and " " not in text:
        return f"{text[:_DIGITS]}…"
    return text if len(text) <= _SHOWN else f"{text[: _SHOWN - 1]}…"

"""Plays episodes on two sides in lock-step and finds every difference, to the last bit."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice
from typing import Literal

import numpy as np

from parity.compare.both_sides import Side
from parity.compare.snapshot import QUANTITIES, Key, Snapshot, differing, largest_difference
from robots import TaskError
from tasks.episode import Episode

History = Literal["fresh", "reused"]
HISTORIES: tuple[History, ...] = ("fresh", "reused")


@dataclass(frozen=True)
class FirstDifference:
    """Where two sides part.

    Attributes:
        step: Control step; 0 is the reset.
        quantity: One of `parity.compare.snapshot.QUANTITIES`.
        entry: Object, robot or key that differs.
    """

    step: int
    quantity: str
    entry: str

    def __str__(self) -> str:
        """Say it in words."""
        where = "at the reset" if self.step == 0 else f"from step {self.step}"
        what = self.quantity if self.entry == self.quantity else f"{self.quantity} of {self.entry}"
        return f"{where} in {what}"


@dataclass(frozen=True)
class EpisodeResult:
    """What the comparison of one episode found.

    Attributes:
        seed: Reset seed.
        steps: Control steps played.
        contact_steps: Steps after which a robot was touching a movable object, in native.
        native_success: Whether native reported success at any step.
        our_success: Whether the other side did.
        max_difference: Largest |Δ| by quantity, the reset included; 0.0 means equal bits.
        first_difference: Where the sides part, or None.
    """

    seed: int
    steps: int
    contact_steps: int
    native_success: bool
    our_success: bool
    max_difference: Mapping[str, float]
    first_difference: FirstDifference | None

    @property
    def equal(self) -> bool:
        """Whether nothing differs."""
        return self.first_difference is None


@dataclass
class _Record:
    """What is known so far about an episode that is being played."""

    episode: Episode
    contact_steps: int = 0
    native_success: bool = False
    our_success: bool = False
    max_difference: dict[str, float] = field(default_factory=lambda: dict.fromkeys(QUANTITIES, 0.0))
    first_difference: FirstDifference | None = None

    def note(self, step: int, key: Key, delta: float) -> None:
        quantity, entry = key
        self.max_difference[quantity] = max(self.max_difference[quantity], delta)
        if self.first_difference is None:
            self.first_difference = FirstDifference(step, quantity, entry)

    def result(self) -> EpisodeResult:
        return EpisodeResult(
            self.episode.seed,
            len(self.episode.actions),
            self.contact_steps,
            self.native_success,
            self.our_success,
            self.max_difference,
            self.first_difference,
        )


def compare(
    native: Side,
    ours: Side,
    episodes: Iterable[Episode],
    *,
    history: History = "fresh",
    on_step: Callable[[int], None] = lambda count: None,
) -> Generator[EpisodeResult]:
    """Play episodes on both sides and yield what each comparison found.

    Episodes are played as many at a time as there are environments. Both sides must have had the
    same past when this begins, unless ``history`` is ``"fresh"``.

    Args:
        native: The reference.
        ours: The side under test, with as many environments.
        episodes: What to play.
        history: ``"fresh"`` rebuilds the scenes before every episode, ``"reused"`` only resets
            them, so that PhysX remembers the episode before.
        on_step: Called after every step with the number of episodes that it advanced.

    Raises:
        TaskError: If the sides differ in size or an action does not fit.
    """
    if (native.num_envs, native.action_dim) != (ours.num_envs, ours.action_dim):
        raise TaskError(
            f"native has {native.num_envs} environment(s) with {native.action_dim} action numbers,"
            f" the other side {ours.num_envs} with {ours.action_dim}: they cannot be compared"
        )
    waiting = iter(episodes)
    while batch := list(islice(waiting, native.num_envs)):
        yield from _compare_batch(native, ours, batch, history == "fresh", on_step)


def _compare_batch(
    native: Side,
    ours: Side,
    batch: Sequence[Episode],
    rebuild: bool,
    on_step: Callable[[int], None],
) -> list[EpisodeResult]:
    records = [_Record(episode) for episode in batch]
    seeds, env_ids = [episode.seed for episode in batch], range(len(batch))
    first, second = (side.reset(seeds, env_ids, rebuild=rebuild) for side in (native, ours))
    _note_differences(0, dict(enumerate(records)), first, second)
    for step in range(1, max(len(episode.actions) for episode in batch) + 1):
        playing = {i: r for i, r in enumerate(records) if step <= len(r.episode.actions)}
        actions = np.zeros((native.num_envs, native.action_dim), np.float32)
        for i, record in playing.items():
            actions[i] = record.episode.actions[step - 1]
        first, second = native.step(actions), ours.step(actions)
        _note_differences(step, playing, first, second)
        _note_events(playing, first, second, native)
        on_step(len(playing))
    return [record.result() for record in records]


def _note_differences(
    step: int, playing: Mapping[int, _Record], first: Snapshot, second: Snapshot
) -> None:
    for key in differing(first, second):
        a, b = first.get(key), second.get(key)
        for i, record in playing.items():
            if a is None or b is None or i >= len(a) or i >= len(b):
                delta = np.inf
            else:
                delta = largest_difference(a[i], b[i])
            if delta > 0:
                record.note(step, key, delta)


def _note_events(
    playing: Mapping[int, _Record], first: Snapshot, second: Snapshot, native: Side
) -> None:
    touching = native.touching()
    for i, record in playing.items():
        record.contact_steps += bool(touching[i])
        record.native_success |= _succeeded(first, i)
        record.our_success |= _succeeded(second, i)


def _succeeded(snapshot: Snapshot, row: int) -> bool:
    flags = snapshot.get(("info", "success"))
    return flags is not None and bool(np.all(flags[row]))

"""Plays an episode on both sides, keeps every state, and measures how their pictures differ."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from parity.compare.both_sides import Side
from parity.compare.lockstep import EpisodeResult, compare
from parity.compare.snapshot import STATE, Snapshot
from parity.show.native_pictures import NativeScene, Picture, PictureError, difference
from tasks.episode import Episode

# Of 255: mean difference between a state drawn and the same state seen live. Rounding of poses
# takes single pixels over an edge, which came to 0.002 at most; a goal left out, to 0.024 or more.
HONEST = 0.02


@dataclass(frozen=True)
class Playback:
    """An episode of T steps as both sides went through it.

    Attributes:
        episode: What was played.
        result: What the comparison of the two sides found.
        native: Native after the reset and after every step, T + 1 snapshots.
        ours: The same of the other side.
    """

    episode: Episode
    result: EpisodeResult
    native: Sequence[Snapshot]
    ours: Sequence[Snapshot]

    @property
    def success_steps(self) -> tuple[int | None, int | None]:
        """First step at which native and the other side reported success, or None."""
        return _first_success(self.native), _first_success(self.ours)

    @property
    def both_succeed(self) -> bool:
        """Whether both sides reported success at some step."""
        return None not in self.success_steps

    @property
    def max_state_difference(self) -> float:
        """Largest |Δ| of any pose, velocity or joint over all T steps and the reset."""
        return max(self.result.max_difference[quantity] for quantity in STATE)

    def frames(self, buffer: int | None) -> int:
        """Return how many frames to show, the reset's included.

        Args:
            buffer: Frames to show after both sides have succeeded; None shows every step. An
                episode that does not succeed on both sides is shown to its end.
        """
        native, ours = self.success_steps
        if native is None or ours is None or buffer is None:
            return len(self.native)
        return min(max(native, ours) + 1 + buffer, len(self.native))


@dataclass(frozen=True)
class Frame:
    """One moment of both sides.

    Attributes:
        step: Control step; 0 is the reset.
        native: Native's state, drawn.
        ours: Our state, drawn.
        rewards: Reward of native and ours, or None at the reset.
        success: Whether native and ours report success.
    """

    step: int
    native: Picture
    ours: Picture
    rewards: tuple[float, float] | None
    success: tuple[bool, bool]

    @property
    def difference(self) -> Picture:
        """|native - ours|, not amplified."""
        return difference(self.native, self.ours)


class _Tape:
    """A side that keeps what it returns."""

    def __init__(self, side: Side) -> None:
        self._side = side
        self.num_envs, self.action_dim = side.num_envs, side.action_dim
        self.snapshots: list[Snapshot] = []

    def reset(self, seeds: Sequence[int], env_ids: Sequence[int], *, rebuild: bool) -> Snapshot:
        self.snapshots = [self._side.reset(seeds, env_ids, rebuild=rebuild)]
        return self.snapshots[0]

    def step(self, actions: NDArray[np.float32]) -> Snapshot:
        self.snapshots.append(self._side.step(actions))
        return self.snapshots[-1]

    def touching(self) -> NDArray[np.bool_]:
        return self._side.touching()


def play(
    native: Side,
    ours: Side,
    episode: Episode,
    on_step: Callable[[int], None] = lambda step: None,
) -> Playback:
    """Play an episode in freshly built worlds, in lock-step.

    Args:
        native: The reference, with one environment.
        ours: The side beside it, with one environment.
        episode: What to play.
        on_step: Called after every step with its number, from 1.

    Raises:
        TaskError: If the sides do not fit each other or the actions.
    """
    tapes = _Tape(native), _Tape(ours)
    (result,) = compare(*tapes, [episode], on_step=lambda _: on_step(len(tapes[0].snapshots) - 1))
    return Playback(episode, result, tapes[0].snapshots, tapes[1].snapshots)


def play_and_look(
    native: Side, ours: Side, episode: Episode, scene: NativeScene
) -> tuple[Playback, float]:
    """Play an episode and check that drawing native's states shows what native itself shows.

    Native's own picture is taken after the first step, halfway and at the end while it plays, and
    afterwards the states of those steps are drawn as all others will be.

    Returns:
        The playback, and the largest mean difference between such two pictures (of 255). Only
        rounding remains there: native computes the links' poses from the joints when a state is
        put in, and physics integrates them.

    Raises:
        PictureError: If the pictures differ by more than rounding.
    """
    steps = len(episode.actions)
    live: dict[int, Picture] = {}

    def look(step: int) -> None:
        if step in (1, (steps + 1) // 2, steps):
            live[step] = scene.live()

    playback = play(native, ours, episode, look)
    apart = {
        step: float(difference(scene.draw(playback.native[step]), picture).mean())
        for step, picture in live.items()
    }
    worst = max(apart, key=lambda step: apart[step])
    if apart[worst] > HONEST:
        raise PictureError(
            f"native's state of step {worst} looks otherwise drawn than live, by {apart[worst]:.3f}"
            f" of 255 on average (at most {HONEST} is rounding): a part of the picture that is not"
            " in the state dict"
        )
    return playback, apart[worst]


def most_alike(playbacks: Iterable[Playback], buffer: int | None) -> Playback:
    """Return the playback in which both sides succeed and differ least, the shortest of these.

    Args:
        playbacks: At least one; taken one by one.
        buffer: Frames shown after the success.
    """
    return min(
        playbacks, key=lambda p: (not p.both_succeed, p.max_state_difference, p.frames(buffer))
    )


def frames(playback: Playback, scene: NativeScene, count: int) -> Generator[Frame]:
    """Draw the first moments of both sides, native's scene built as it was when they played.

    Args:
        playback: The episode that the scene was last reset to.
        scene: Where to draw.
        count: How many frames.
    """
    for step in range(count):
        native, ours = playback.native[step], playback.ours[step]
        yield Frame(
            step,
            scene.draw(native),
            scene.draw(ours),
            (_reward(native), _reward(ours)) if step else None,
            (_succeeds(native), _succeeds(ours)),
        )


class PixelCount:
    """Adds up how far the pictures of frames are apart."""

    def __init__(self) -> None:
        """Begin with no frame."""
        self.frames = self.differing_frames = self.largest = 0
        self._sum = self._size = 0

    @property
    def mean(self) -> float:
        """Mean |difference| over all pixels and colours of all frames (of 255)."""
        return self._sum / self._size if self._size else 0.0

    def add(self, delta: Picture) -> None:
        """Count a frame's difference."""
        self.frames += 1
        self.differing_frames += bool(delta.any())
        self.largest = max(self.largest, int(delta.max()))
        self._sum += int(delta.sum(dtype=np.int64))
        self._size += delta.size


def _first_success(snapshots: Sequence[Snapshot]) -> int | None:
    return next((step for step, found in enumerate(snapshots) if _succeeds(found)), None)


def _succeeds(snapshot: Snapshot) -> bool:
    flags = snapshot.get(("info", "success"))
    return flags is not None and bool(np.all(flags[0]))


def _reward(snapshot: Snapshot) -> float:
    return float(snapshot["reward", "reward"][0])

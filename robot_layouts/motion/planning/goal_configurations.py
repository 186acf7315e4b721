"""Where all places are at the end of a motion: postures that bring each to its goal, together."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations, islice

import numpy as np
from numpy.typing import NDArray

from robot_layouts.core.errors import NoPlanError
from robot_layouts.kinematics.rotations import Floats
from robot_layouts.motion.collision.clearances import Clearances
from robot_layouts.motion.planning.goals import CANDIDATES, Target, different

COMBINATIONS = 512  # of postures of all places that are tried at first
MORE = 4 * CANDIDATES  # postures per place, before it is said that goals exclude each other
LOOKS = 20_000  # at partial combinations of these
ENDS = 4  # combinations that a search may choose from

Choice = tuple[int, ...]  # a number of a posture for each place


def find_goal_configurations(
    targets: Sequence[Target], clearances: Clearances, base: Floats, time: float
) -> Floats:
    """Return all coordinates at some combinations of goals, best first, (n, D).

    Those that keep the clearance come first.

    Args:
        targets: What each place is to do.
        clearances: Who keeps how far from what.
        base: All coordinates at the end, but for the targets', (D,) (rad, m).
        time: When that is (s).

    Raises:
        NoPlanError: If something overlaps in all of them.
    """
    return _Search(targets, clearances, base, time).found()


class _Search:
    def __init__(
        self, targets: Sequence[Target], clearances: Clearances, base: Floats, time: float
    ) -> None:
        self._targets, self._clearances, self._base, self._time = targets, clearances, base, time

    def found(self) -> Floats:
        known = [self._alone(target) for target in self._targets]
        first = list(islice(choices([len(postures) for postures in known]), COMBINATIONS))
        states = self._states(known, first)
        free = self._free(states)
        if not free.any():
            contact = self._clearances.overlaps().contact(states[0], self._time)
            states = self._searched(known)
            free = self._free(states)
            if not free.any():
                who = " and ".join(target.place for target in self._targets)
                raise NoPlanError(
                    f"the goals of {who} exclude each other: there {contact}", "goal in collision"
                )
        wide = self._clearances.checker(self._robots()).free(states[free], self._time)
        return states[free][np.argsort(~wide, kind="stable")][:ENDS]

    def _alone(self, target: Target) -> Floats:
        """Return postures in which a robot touches nothing but what moves, too, (n, d).

        Raises:
            NoPlanError: If it does so in all that are known, and in all that a longer search finds.
        """
        if sum(other.robot == target.robot for other in self._targets) > 1:
            return target.candidates[:CANDIDATES]
        free = self._clear(target, target.candidates)
        if not len(free):
            free = self._clear(target, target.others())
        if not len(free):
            state = self._with(target, target.candidates[:1])[0]
            contact = self._clearances.overlaps(self._besides(target)).contact(state, self._time)
            raise NoPlanError(
                f"at the goal of {target.place}, {target.goal}, {contact}", "goal in collision"
            )
        return free[:CANDIDATES]

    def _clear(self, target: Target, postures: Floats) -> Floats:
        """Return those of a robot's postures that are free; first what keeps the clearance."""
        besides, states = self._besides(target), self._with(target, postures)
        free = self._clearances.overlaps(besides).free(states, self._time)
        checker = self._clearances.checker([target.robot], besides)
        return postures[free][np.argsort(~checker.free(states[free], self._time), kind="stable")]

    def _searched(self, known: Sequence[Floats]) -> Floats:
        """Return one combination of many more postures in which no two are in conflict, (1, D).

        There may be none, (0, D).
        """
        postures = [
            different(np.concatenate([own, self._more(target)]))[:MORE]
            for own, target in zip(known, self._targets, strict=True)
        ]
        agree = {
            pair: self._agreeing(pair, postures) for pair in combinations(range(len(postures)), 2)
        }
        looks = [LOOKS]

        def extended(choice: Choice) -> Choice | None:
            place = len(choice)
            if place == len(postures):
                return choice
            for i in range(len(postures[place])):
                looks[0] -= 1
                if looks[0] >= 0 and all(agree[j, place][c, i] for j, c in enumerate(choice)):
                    whole = extended((*choice, i))
                    if whole is not None:
                        return whole
            return None

        choice = extended(())
        return self._states(postures, [] if choice is None else [choice])

    def _more(self, target: Target) -> Floats:
        others = target.others()
        if sum(other.robot == target.robot for other in self._targets) > 1:
            return others
        return self._clear(target, others)

    def _agreeing(self, pair: tuple[int, int], postures: Sequence[Floats]) -> NDArray[np.bool_]:
        """Tell which postures of two places go together, (n, m)."""
        one, other = (self._targets[i] for i in pair)
        counts = [len(postures[i]) for i in pair]
        states = np.tile(self._base, (*counts, 1))
        states[..., one.moving] = postures[pair[0]][:, None]
        states[..., other.moving] = postures[pair[1]][None]
        ignored = [name for name in self._robots() if name not in (one.robot, other.robot)]
        free = self._clearances.overlaps(ignored).free(
            states.reshape(-1, len(self._base)), self._time
        )
        return free.reshape(counts)

    def _states(self, postures: Sequence[Floats], chosen: Sequence[Choice]) -> Floats:
        states = np.tile(self._base, (len(chosen), 1))
        for i, target in enumerate(self._targets):
            states[:, target.moving] = postures[i][[choice[i] for choice in chosen]]
        return states

    def _with(self, target: Target, postures: Floats) -> Floats:
        states = np.tile(self._base, (len(postures), 1))
        states[:, target.moving] = postures
        return states

    def _free(self, states: Floats) -> NDArray[np.bool_]:
        return self._clearances.overlaps().free(states, self._time)

    def _robots(self) -> tuple[str, ...]:
        """Return the robots that move, in the layout's order."""
        moving = {target.robot for target in self._targets}
        return tuple(name for name in self._clearances.cell.robots if name in moving)

    def _besides(self, target: Target) -> list[str]:
        """Return the robots that move besides a target's."""
        return [other.robot for other in self._targets if other.robot != target.robot]


def choices(counts: Sequence[int]) -> Iterator[Choice]:
    """Yield a number below each of some counts, those first whose sum is least."""
    for total in range(sum(counts) - len(counts) + 1):
        yield from _choices(counts, total)


def _choices(counts: Sequence[int], total: int) -> Iterator[Choice]:
    if not counts:
        yield ()
        return
    left = sum(counts[1:]) - len(counts[1:])
    for first in range(max(0, total - left), min(counts[0] - 1, total) + 1):
        for rest in _choices(counts[1:], total - first):
            yield first, *rest

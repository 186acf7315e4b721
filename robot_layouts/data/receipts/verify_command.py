"""``robot-layouts verify``: what a receipt is of is played again, to the last bit."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from robot_layouts.core.cli import Count, Word
from robot_layouts.core.commands import printable
from robot_layouts.data.playing.command_options import Players, Policy, stoppable
from robots import RobotDescriptor
from tasks.cell_options import PlacedRobot, chosen_robots

if TYPE_CHECKING:
    from robot_layouts.core.progress import Progress
    from robot_layouts.data.playing.executor import Event
    from robot_layouts.data.receipts.receipt import Receipt


def verify(
    receipt: Annotated[Path, Word("RECEIPT")],
    *,
    policy: Policy | None = None,
    task: Annotated[str, Word("MODULE:ID")] | None = None,
    robots: Sequence[PlacedRobot] = (),
    num_envs: Count = 1,
    players: Players,
) -> int:
    """Play the episodes of a receipt again, and compare every bit.

    Tells the first seed and step whose states differ, and which robot files, sources, versions and
    parts of the processor are not those of the receipt. Exit code: 0 if every bit and file is the
    same, whatever the versions; 1 if not; 2 for bad usage, 130 if interrupted.

    Args:
        receipt: What `evaluate --receipt` wrote.
        policy: The policy, unless it is an expert.
        task: The task, if no installed package lists it.
        robots: Which robots these were, where the receipt cannot say it.
        num_envs: Episodes that play at once.
        players: Who plays.

    Raises:
        RobotLayoutsError: If it cannot be played again.
    """
    from robot_layouts.core.progress import Progress
    from robot_layouts.data.receipts import verification
    from robot_layouts.data.receipts.receipt import Receipt

    read = Receipt.read(receipt)
    known = chosen_robots(robots) if robots else {}
    if isinstance(known, RobotDescriptor):
        known = dict.fromkeys(read.making["layout"], known)
    executor, line = players.executor(), Progress(len(read.episodes), "episodes")
    with stoppable(), line:
        found = verification.verify(
            read,
            executor,
            _Status(line, read).show,
            policy=policy,
            task=task,
            robots=known,
            num_envs=num_envs,
        )
    print(printable(repr(found)))
    print(_VERDICT[found.equal])
    return 0 if found.equal else 1


_VERDICT = {
    True: "equal: this is what the receipt says",
    False: "not equal: this is not what the receipt says",
}


class _Status:
    """How far it is."""

    def __init__(self, line: Progress, receipt: Receipt) -> None:
        self._line = line
        self._states = {episode.seed: episode.states for episode in receipt.episodes}
        self._played = self._equal = 0

    def show(self, event: Event) -> None:
        """Tell how many of the episodes so far are the same."""
        if event.news is not None:
            self._line.say(event.news)
        if event.seed is not None and event.result is not None:
            self._played += 1
            self._equal += event.result.trace.states == self._states[event.seed]
        self._line.update(self._played, f"verifying, {self._equal} of {self._played} equal")

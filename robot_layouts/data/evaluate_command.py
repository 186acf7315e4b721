"""``robot-layouts evaluate``: how well a policy or an expert does."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from robot_layouts.core.cli import Count, Seed, Word
from robot_layouts.data.playing.command_options import Acting, Players, stoppable
from tasks.cell_options import Cell

if TYPE_CHECKING:
    from robot_layouts.core.progress import Progress
    from robot_layouts.data.playing.executor import Event


def evaluate(
    *,
    task: str,
    episodes: Count = 100,
    players: Players,
    seed: Seed = 0,
    receipt: Annotated[Path, Word("JSON")] | None = None,
    acting: Acting,
    cell: Cell,
) -> None:
    """Let a policy or an expert play episodes, and print how well it does.

    A policy maps an observation to an action; see robot_layouts.evaluate. Exit code: 0 if all was
    played, 1 if not, 2 for bad usage, 130 if interrupted.

    Args:
        task: Task id; MODULE:ID for one of your own.
        episodes: Number of episodes.
        players: Who plays.
        seed: Seeds S … S + N - 1.
        receipt: Write a receipt, which `verify` plays again.
        acting: Who acts, and how.
        cell: The task's robots, and what varies.

    Raises:
        RobotLayoutsError: If it makes no sense, or the policy fails.
    """
    from robot_layouts.core.progress import Progress
    from robot_layouts.data import evaluation

    executor, line = players.executor(), Progress(episodes, "episodes")
    with stoppable(), line:
        found = evaluation.evaluate(
            task=task,
            seeds=range(seed, seed + episodes),
            executor=executor,
            receipt=receipt,
            on_event=_Status(line).show,
            **vars(acting),
            **cell.making(),
        )
    print(found)
    if found.receipt is not None:
        print(f"{receipt}: receipt {found.receipt.hash}")


class _Status:
    """How far the evaluation is."""

    def __init__(self, line: Progress) -> None:
        self._line = line
        self._solved = self._played = 0

    def show(self, event: Event) -> None:
        """Tell what has come of the episodes so far."""
        if event.news is not None:
            self._line.say(event.news)
        if event.result is not None:
            self._played += 1
            self._solved += event.result.success
        self._line.update(self._played, f"evaluating (succeeded so far: {self._solved})")

"""``python -m parity compare``: play tasks beside native ManiSkill and compare every bit."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from json import dumps
from pathlib import Path
from typing import Literal

import torch
from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text
from tqdm import tqdm

import tasks
from parity.episodes import (
    Source,
    find_demonstrations,
    over_range_episodes,
    random_episodes,
    recorded_source,
)
from parity.lockstep import HISTORIES, QUANTITIES, History, Run, RunResult, play
from parity.results import (
    COUNTS,
    RESULTS,
    REWARD,
    REWARD_MODES,
    WITHOUT_REWARD,
    Summary,
    document,
    number_text,
    read_results,
    record_text,
    reward_text,
    success_text,
    summarise,
)
from robot_layouts.core.writing import write_whole
from robots import CONTROL_MODES, TaskError, closest_match
from tasks import MultiRobotTask

TABLE_WIDTH = 180  # columns that a table may take; a narrower terminal wraps it
SHOWN_DIFFERENCES = 3  # of each run


@dataclass(frozen=True, kw_only=True)
class Wanted:
    """What to compare.

    Attributes:
        task: Task ids, or other names of tasks.
        all: Every clone, or all of what --task names: random and over-range actions and --demos,
            fresh and reused, and reused in each further reward mode.
        seeds: Reset seeds 0 … N-1.
        steps: Control steps of a random episode.
        actions: Play this recording (.h5) instead.
        demos: Play the demonstrations below this folder as well.
        history: fresh rebuilds both scenes before every episode, reused only resets them (fresh).
        reward_mode: Reward modes, or 'all' (the task's default one).
        control_mode: Of random actions (pd_joint_delta_pos); a file says itself in which it was
            recorded.
        num_envs: Environments that play at once.
    """

    task: tuple[str, ...] = ()
    all: bool = False
    seeds: int = 10
    steps: int = 100
    actions: Path | None = None
    demos: Path | None = None
    history: tuple[Literal["fresh", "reused"], ...] = ()
    reward_mode: tuple[str, ...] = ()
    control_mode: str | None = None
    num_envs: int = 1

    def __post_init__(self) -> None:
        """Refuse what is invalid.

        Raises:
            TaskError: If something does not.
        """
        for name in ("seeds", "steps", "num_envs"):
            if getattr(self, name) < 1:
                option = name.replace("_", "-")
                raise TaskError(f"--{option} is {getattr(self, name)}; it must be 1 or more")
        if not self.task and not self.all:
            raise TaskError("give --task, --all, or both")
        if self.actions and (self.all or len(self.task) > 1 or self.demos):
            raise TaskError("--actions holds the episodes of one task: give one --task, no --demos")
        if self.control_mode not in (None, *CONTROL_MODES):
            raise TaskError(
                f"--control-mode is {self.control_mode}; choices: {', '.join(CONTROL_MODES)}"
            )

    def runs(self) -> list[Run]:
        """Return the runs to play, with every file read and every name checked."""
        classes = [tasks.get_task_class(name) for name in self.task or tasks.list_clones()]
        demonstrations = find_demonstrations(self.demos) if self.demos else {}
        return [
            Run(
                cls.task_id,
                source.name,
                source.episodes,
                history,
                mode,
                self.num_envs,
                source.control_mode,
            )
            for cls in classes
            for source in self._sources(cls, demonstrations.get(cls.task_id, []))
            for history, mode in self._ways(cls)
        ]

    def _ways(self, cls: type[MultiRobotTask]) -> list[tuple[History, str]]:
        """Return each history and reward mode to play in.

        Physics knows nothing of the reward mode, so ``--all`` plays both histories in the default
        one, and does not rebuild the scenes in the others.
        """
        if self.all and not (self.history or self.reward_mode):
            default, *others = cls.reward_modes
            ways: list[tuple[History, str]] = [(history, default) for history in HISTORIES]
            return ways + [("reused", mode) for mode in others]
        return list(product(self.history or ("fresh",), self._reward_modes(cls)))

    def _reward_modes(self, cls: type[MultiRobotTask]) -> tuple[str, ...]:
        if "all" in self.reward_mode:
            return cls.reward_modes
        for mode in self.reward_mode:
            if mode not in cls.reward_modes:
                match = closest_match(mode, cls.reward_modes)
                raise TaskError(
                    f"{cls.task_id} has no reward mode {mode!r}."
                    + (f" Did you mean {match!r}?" if match else "")
                    + f" Choices: {', '.join(cls.reward_modes)}, all."
                )
        return tuple(dict.fromkeys(self.reward_mode)) or cls.reward_modes[:1]

    def _sources(
        self, cls: type[MultiRobotTask], demonstrations: Sequence[Path]
    ) -> Iterator[Source]:
        if self.actions:
            yield recorded_source(self.actions, cls, self.control_mode)
            return
        mode = self.control_mode or CONTROL_MODES[0]
        layout = cls.layout.in_control_mode(mode)
        sizes = range(self.seeds), self.steps, layout.action_dim, layout.action_bounds
        yield Source("random", tuple(random_episodes(*sizes)), mode)
        if self.all:
            yield Source("over-range", tuple(over_range_episodes(*sizes)), mode)
        for path in demonstrations:
            yield recorded_source(path, cls)


def compare(
    wanted: Wanted,
    *,
    json: Path | None = None,
    record: bool = False,
) -> int:
    """Step tasks beside native, and compare observations, states, rewards and info exactly.

    Exit code: 0 if every difference is exactly zero, 1 if not.

    Args:
        wanted: What to compare.
        json: Write the results to this file.
        record: Keep the results of --all in the record, for the documentation; with --task, beside
            what was recorded before of the others.

    Raises:
        RobotLayoutsError: If it could not be compared.
    """
    if record and (not wanted.all or wanted.history or wanted.reward_mode or wanted.control_mode):
        raise TaskError(
            "--record keeps all of --all: give --all, no --history, --reward-mode, --control-mode"
        )
    if json and not json.absolute().parent.is_dir():
        raise TaskError(f"--json {json}: there is no folder {json.absolute().parent}")
    torch.set_num_threads(1)  # the tensors are small
    runs = wanted.runs()
    with tqdm(total=sum(run.steps for run in runs), unit="steps", disable=None) as bar:

        def advance(run: Run, count: int) -> None:
            bar.set_description(f"{run.task} {run.source} {run.history}", refresh=False)
            bar.update(count)

        results = play(runs, advance)
    found = document(results)
    summaries = summarise(found["runs"])
    console = Console()
    console.width = max(console.width, TABLE_WIDTH)
    console.print(summary_table(summaries) if wanted.all else run_table(results))
    for sentence in sentences(results):
        console.print(sentence, markup=False, highlight=False, soft_wrap=True)
    if json:
        write_whole(json, dumps(found | {"tasks": summaries}, indent=1) + "\n")
    if record:
        others = read_results(RESULTS)["tasks"] if wanted.task else {}
        write_whole(RESULTS, record_text(found, summaries, others))
    return 0 if all(result.equal for result in results) else 1


def run_table(results: Sequence[RunResult]) -> Table:
    """Return max |Δ| by quantity, one row per run; what all runs share stands in the title."""
    shown = [_columns(result.run) for result in results]
    values = {name: {columns[name] for columns in shown} for name in shown[0]}
    shared = ", ".join(f"{name}: {min(v)}" for name, v in values.items() if len(v) == 1)
    varying = [name for name, found in values.items() if len(found) > 1]
    title = "max |Δ| against native ManiSkill"
    rows = _table(f"{title} ({shared})" if shared else title)
    for name in varying:
        rows.add_column(name, overflow="fold", no_wrap=name != "actions")
    for name in (*COUNTS, *QUANTITIES):
        rows.add_column(_narrow(name), justify="right", no_wrap=True)
    for result, columns in zip(results, shown, strict=True):
        numbers = len(result.episodes), result.run.steps, result.contact_steps
        rows.add_row(
            result.run.task,
            *(columns[name] for name in varying),
            *map(str, numbers),
            *(_cell(largest) for largest in result.max_difference.values()),
        )
    return rows


def summary_table(summaries: Mapping[str, Summary]) -> Table:
    """Return one row per task: how much was played, max |Δ| of everything, and successes."""
    rows = _table(
        "max |Δ| against native ManiSkill, all actions, histories and reward modes together"
    )
    modes = [f"{REWARD}_{mode}" for mode in REWARD_MODES]
    for name in (*COUNTS, *WITHOUT_REWARD, *modes, "success native_/ here"):
        rows.add_column(_narrow(name), justify="right", no_wrap=True)
    for task, found in summaries.items():
        rows.add_row(
            task,
            *(str(found[count]) for count in COUNTS),
            *(number_text(found["max_difference"][q]) for q in WITHOUT_REWARD),
            *(reward_text(found, mode) for mode in REWARD_MODES),
            success_text(found),
        )
    return rows


def sentences(results: Sequence[RunResult]) -> Iterator[str]:
    """Yield where runs differ, then the verdict."""
    for result in results:
        run = result.run
        together = f", {run.num_envs} environments" if run.num_envs > 1 else ""
        name = f"{run.task}, {run.source} actions, {run.history}, {run.reward_mode}{together}"
        differing = [episode for episode in result.episodes if not episode.equal]
        for episode in differing[:SHOWN_DIFFERENCES]:
            largest = max(episode.max_difference.values())
            where = episode.first_difference
            yield f"{name}: seed {episode.seed} differs {where}; max |Δ| {largest:.3g}"
        if more := len(differing[SHOWN_DIFFERENCES:]):
            yield f"{name}: {more} more episode(s) differ"
    episodes = [episode for result in results for episode in result.episodes]
    native, ours, both = (sum(n) for n in zip(*(r.successes for r in results), strict=True))
    success = f"success in native {native}, here {ours}, both {both}"
    if all(result.equal for result in results):
        steps = sum(result.run.steps for result in results)
        yield f"Bitwise equal: {len(episodes)} episodes, {steps} steps; {success}."
    else:
        differ = sum(not episode.equal for episode in episodes)
        yield f"NOT equal: {differ} of {len(episodes)} episodes differ; {success}."


def _columns(run: Run) -> dict[str, str]:
    return {
        "actions": run.source,
        "history": run.history,
        "reward mode": run.reward_mode,
        "control mode": run.control_mode,
        "environments": str(run.num_envs),
    }


def _table(title: str) -> Table:
    rows = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, collapse_padding=True)
    rows.add_column("task", no_wrap=True)
    return rows


def _narrow(name: str) -> str:
    return name.replace("_", "\n").replace(" ", "\n")


def _cell(largest: float) -> Text:
    return Text("0", style="green") if largest == 0 else Text(f"{largest:.1e}", style="bold red")

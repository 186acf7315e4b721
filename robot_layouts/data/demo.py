"""The demo: finds the robot files, lets an expert play a task, and leaves a recording of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import fsum
from pathlib import Path
from statistics import mean

import torch
from rich.console import Console
from rich.markup import escape
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

import tasks
from layouts import Layout
from robot_layouts.core.cli import Count, Folder
from robot_layouts.core.pages import plural
from robot_layouts.data.recording.recorder import Recorder
from robot_layouts.data.video import film, video_problem
from robot_layouts.experts import find_expert
from robot_layouts.experts.rehearsal import rehearsed
from robots import AssetError, MissingPackageError, RecordingError, TaskError
from tasks import TaskEnv
from tasks.cell_options import CellOptions
from tasks.episode import PlayedEpisode, Score, play
from tasks.registry import make_scenario

ENOUGH = 0.9  # share of episodes that must succeed
FILMED_EPISODES, FILMING_SECONDS = 2, 60.0


@dataclass(frozen=True, kw_only=True)
class DemoOptions:
    """What the demo plays and where it leaves its files.

    Attributes:
        task: Id of the task.
        seeds: Play seeds 0 to N - 1.
        out: Folder of the results.
        no_video: Make no video.
        cell: The task's robots, and what varies.
    """

    task: str = "TwoRobotPickCube-v1"
    seeds: Count = 10
    out: Folder = Path("runs/demo")
    no_video: bool = False
    cell: CellOptions = CellOptions()


def run_demo(options: DemoOptions, console: Console) -> bool:
    """Run the demo.

    Args:
        options: What to play.
        console: Where to print.

    Returns:
        Whether at least nine of ten episodes succeeded.

    Raises:
        UnknownNameError: If there is no such task.
        TaskError: If the task has no expert.
        AssetError: If the robot files that physics needs cannot be found.
        RecordingError: If ``out`` cannot be written.
    """
    torch.set_num_threads(1)  # the tensors are small: threads would only wait for each other
    expert = find_expert(options.task)
    cls = tasks.get_task_class(options.task)
    making = options.cell.making()
    scenario = make_scenario(cls, **making)
    layout = scenario.layout
    console.print(f"[bold]{options.task}[/], {plural(options.seeds, 'seed')}", highlight=False)
    film_why_not = (
        "not asked for" if options.no_video else _pictures_problem(layout, scenario.simulator)
    )
    _find_files(layout, console)
    task = tasks.make(options.task, obs_mode="state", **making)
    _show_layout(layout, options.out, console)

    episodes: list[PlayedEpisode] = []
    scores: dict[int, Score] = {}
    recording = options.out / "trajectory.h5"
    with Recorder(recording, task, overwrite=True) as recorder, _live(console) as live:
        line = live.add_task("")
        for seed in range(options.seeds):
            live.update(line, description=f"seed {seed}")
            try:
                actions = expert(task, seed)
            except TaskError as error:  # it finds no plan
                scores[seed] = Score(False, 0.0, 0, str(error))
            else:
                episode = rehearsed(task, seed, actions) or play(task, seed, actions)
                reason = "" if episode.solved else getattr(actions, "reason", "")
                episodes.append(replace(episode, reason=reason))
                recorder.add(episodes[-1])
                scores[seed] = episodes[-1].score
            live.console.print(_episode_line(seed, scores[seed]), highlight=False, soft_wrap=True)
    _report(scores, episodes, console)
    console.print(
        f"episodes  {escape(str(recording))}, {escape(recorder.json_path.name)}", highlight=False
    )
    if film_why_not is None and episodes:
        filmed = tasks.make(options.task, render_mode="rgb_array", **making)
        _film(filmed, options.out / "video.mp4", episodes, console)
    elif film_why_not is not None:
        console.print(f"no video: {film_why_not}", highlight=False, soft_wrap=True)
    return sum(score.success for score in scores.values()) >= ENOUGH * len(scores)


def _find_files(layout: Layout, console: Console) -> None:
    for robot in {placement.robot.name: placement.robot for placement in layout.values()}.values():
        console.print(
            f"robot files of {robot.name}: {escape(str(robot.urdf.locate()))}", soft_wrap=True
        )


def _pictures_problem(layout: Layout, simulator: str) -> str | None:
    """Say why no video can be made, or fetch what the robots look like and return None."""
    problem = video_problem(simulator)
    if problem is not None:
        return problem
    try:
        for placement in layout.values():
            placement.robot.urdf.locate(pictures=True)
    except AssetError as error:
        return f"the robots' visual meshes are missing: {str(error).splitlines()[0]}"
    return None


def _show_layout(layout: Layout, out: Path, console: Console) -> None:
    console.print(str(layout), highlight=False, markup=False, soft_wrap=True)
    split = ", ".join(f"{n} = [{p.start}:{p.stop}]" for n, p in layout.action_split.items())
    console.print(f"action split: {split}", highlight=False, markup=False)
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RecordingError(f"cannot write to {out}: {error.strerror}") from error
    try:
        console.print(
            f"seen from above  {escape(str(layout.preview(out / 'layout.png')))}", highlight=False
        )
    except MissingPackageError as error:
        console.print(f"no picture of the layout: {error}", highlight=False, soft_wrap=True)


def _live(console: Console) -> Progress:
    columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    return Progress(*columns, console=console, transient=True)


def _episode_line(seed: int, score: Score) -> str:
    outcome = "[green]success[/]" if score.success else "[red]failure[/]"
    reason = f"  {escape(score.reason)}" if score.reason else ""
    return f"seed {seed:>3}  {outcome}  {score.steps:>3} steps{reason}"


def _report(
    scores: Mapping[int, Score], episodes: Sequence[PlayedEpisode], console: Console
) -> None:
    solved = [score.steps for score in scores.values() if score.success]
    line = f"[bold]{len(solved)} of {len(scores)} succeeded[/]"
    if solved:
        line += f" in {mean(solved):.1f} steps on average"
    console.print(line, highlight=False)
    if not episodes:
        return
    rate = fsum(len(e.actions) for e in episodes) / fsum(e.seconds for e in episodes)
    console.print(
        f"{rate:.0f} steps per second while playing (one environment's step with reward and"
        " success; planning, recording and resets not counted)",
        highlight=False,
        soft_wrap=True,
    )


def _film(task: TaskEnv, path: Path, episodes: Sequence[PlayedEpisode], console: Console) -> None:
    with _live(console) as live:
        line = live.add_task("video")
        shown = film(
            task,
            episodes[:FILMED_EPISODES],
            path,
            seconds=FILMING_SECONDS,
            progress=lambda frame, total: live.update(line, description=f"video {frame}/{total}"),
        )
    which = "the first episode" if shown == 1 else f"the first {shown} episodes"
    console.print(f"video     {escape(str(path))}, {which}", highlight=False)


def demo(*, options: DemoOptions) -> int:
    """Let an expert play a task, and keep a recording, a picture and a video.

    Exit code: 0 if every seed was solved, 1 if not, 2 for bad usage.

    Args:
        options: What is played.

    Raises:
        RobotLayoutsError: If the task cannot be made, or has no expert.
    """
    return 0 if run_demo(options, Console()) else 1

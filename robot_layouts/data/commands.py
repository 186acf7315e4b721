"""Commands that play and show what is recorded, and record by hand."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from layouts.commands import Page, Server
from robot_layouts.core.cli import Folder, Seed, Word
from robot_layouts.core.commands import printable
from robot_layouts.core.pages import plural
from robot_layouts.data.playing.command_options import (
    ControlMode,
    PictureSize,
    Policy,
    RecordingOption,
    RecordingPath,
    stop_signals,
)
from robots import TaskError
from tasks.cell_options import CellOptions

if TYPE_CHECKING:
    from rich.table import Table

    from robot_layouts.data.playing.replay import Replayed

TELEOP_FOLDER = Path("runs/teleop")


def teleop(
    task: str,
    *,
    seed: Seed = 0,
    out: Folder | None = None,
    policy: Policy | None = None,
    cell: CellOptions,
    control_mode: ControlMode | None = None,
    server: Server,
) -> None:
    """Steer the arms of a task in a browser, and record the episodes that you keep.

    Prints the address of the page, and serves it until Ctrl-C. Every episode that is kept is on the
    disk at once; the same command goes on with the next seed. Exit code: 0 if the page was served,
    1 if not, 2 for bad usage.

    Args:
        task: Task id; MODULE:ID for one of your own.
        seed: Seed of the first episode.
        out: Folder of trajectory.h5 and .json (runs/teleop/TASK).
        policy: Policy that acts until the user takes over an arm, as for `robot-layouts evaluate`.
        cell: The task's robots, and what varies.
        control_mode: What actions ask for (as the layout says, else pd_joint_delta_pos).
        server: Where the page is served.

    Raises:
        RobotLayoutsError: If the task cannot be made or steered, or the page cannot be served.
    """
    from layouts.viewer.server import import_viser

    import_viser()

    import tasks
    from robot_layouts.data.actors import find_policy
    from robot_layouts.data.reading.recording import FILE
    from robot_layouts.data.recording.recorder import Recorder
    from robot_layouts.data.teleop.page import serve
    from robot_layouts.data.teleop.session import Session

    acting = None if policy is None else find_policy(policy)
    if isinstance(acting, str):
        raise TaskError("an expert's plan is made for what it does itself; --policy needs a policy")
    env = tasks.make(task, control_mode=control_mode, **cell.making())
    folder = out or TELEOP_FOLDER / env.task_id
    recorder = Recorder(folder / FILE, env, resume=True, source="human", source_desc="browser")
    with closing(env), recorder, stop_signals():
        for what in recorder.damaged:
            print(f"{what} is damaged and does not count as recorded", flush=True)
        session = Session(env, recorder, seed, policy=acting, policy_name=policy)
        try:
            serve(session, server.host, server.port, lambda line: print(line, flush=True))
        except KeyboardInterrupt:
            pass
        kept, total = len(session.kept), len(recorder)
        print(f"{folder / FILE}: {plural(total, 'episode')}, {kept} of them new")


def view(recording: RecordingOption, *, episode: int = 0, page: Page) -> None:
    """Look at an episode of a recording in a browser.

    Shows the recorded states; where a file holds none, the actions are played again. Exit code: 0
    if the page was served or saved, 1 if not.

    Args:
        recording: The recording.
        episode: The Nth in the file, from 0.
        page: Where it is served or saved.

    Raises:
        RobotLayoutsError: If the recording cannot be shown.
    """
    from robot_layouts.data.view import episode_cell

    with recording.open() as file:
        cell = recording.cell.making()
        page.show(lambda: episode_cell(file, episode, **cell))


def view_task(
    task: str,
    *,
    seed: int = 0,
    demo: RecordingPath | None = None,
    episode: int = 0,
    cell: CellOptions,
    page: Page,
) -> None:
    """Look at a task, or at a demonstration of it, in a browser.

    With --demo, it is the same as `robot-layouts view`.

    Args:
        task: Task id or another of its names; MODULE:ID for one of your own.
        seed: Seed of the reset.
        demo: Show this recording (.h5) instead.
        episode: Which episode of the recording, from 0.
        cell: The task's robots, and what varies.
        page: Where it is served or saved.

    Raises:
        RobotLayoutsError: If the task cannot be made or the recording cannot be shown.
    """
    from tasks import commands

    if demo is None:
        commands.view(task, seed=seed, cell=cell, page=page)
    elif making := cell.making():
        raise TaskError(
            f"--demo takes no --{' and no --'.join(making)}: the recording says who stands where"
        )
    else:
        view(RecordingOption(demo, task=task, cell=cell), episode=episode, page=page)


def replay(
    recording: RecordingOption,
    *,
    episodes: int | None = None,
    from_: Literal["seed", "state"] = "seed",
    obs_mode: Annotated[str, Word("MODE")] | None = None,
    camera_size: PictureSize | None = None,
    out: Folder | None = None,
) -> int:
    """Play the actions of a recording again, and compare what happens.

    With --obs-mode and --out, episodes that end as recorded are recorded again, with what is
    observed in them; the same command goes on where it was stopped.

    Exit code: 0 if every episode ends as recorded, 1 if not, or if a file cannot be played.
    Episodes whose reset rebuilt the world must also have the recorded states to the last bit; those
    of reused worlds, and all that begin from a state, need not.

    Args:
        recording: The recording.
        episodes: Play the first N episodes (all).
        from_: Begin by a reset with the recorded seed, or, not exactly, from the recorded state.
        obs_mode: What to observe: state, state_dict, rgb and others.
        camera_size: Width and height in pixels of the pictures observed (each camera's own).
        out: Folder of the trajectory.h5 and .json that hold what was observed.

    Raises:
        RobotLayoutsError: If the recording cannot be played, or the other not be written.
    """
    import torch
    from rich.console import Console

    from robot_layouts.core.progress import Progress
    from robot_layouts.data.playing.replay import replay
    from robot_layouts.data.reading.recorded_task import task_for
    from robot_layouts.data.recording.recorder import again

    if (obs_mode is None) != (out is None) or (out is not None and from_ == "state"):
        raise TaskError("--obs-mode and --out go together, and not with --from state")
    torch.set_num_threads(1)
    with recording.open() as file:
        cell = recording.cell.making()
        task = task_for(file, **cell, obs_mode=obs_mode or "none", camera_size=camera_size)
        count = recording.count(file, episodes)
        found: list[Replayed] = []
        with (
            nullcontext() if out is None else again(file, task, out) as recorder,
            Progress(count, "episodes") as line,
        ):
            for number in range(count):
                keep = None if recorder is None else recorder.add_new
                found.append(replay(task, file[number], from_, keep=keep))
                line.advance(1, "replaying")
        console = Console(markup=False, highlight=False)
        console.print(
            printable(f"{file.path}: {file.task_id}, {file.control_mode}"), soft_wrap=True
        )
    console.print(_table(found))
    for sentence in _sentences(found, from_):
        console.print(sentence, soft_wrap=True)
    return 0 if found and all(episode.agrees for episode in found) else 1


def _table(found: Sequence[Replayed]) -> Table:
    from rich import box
    from rich.table import Table

    rows = Table(box=box.SIMPLE_HEAD)
    for name in ("episode", "seed", "steps"):
        rows.add_column(name, justify="right")
    for name in ("recorded", "here", "states"):
        rows.add_column(name)
    for episode in found:
        rows.add_row(
            str(episode.episode_id),
            "–" if episode.seed is None else str(episode.seed),
            str(episode.steps),
            _word(episode.recorded),
            _word(episode.success),
            _states(episode),
        )
    return rows


def _sentences(found: Sequence[Replayed], start: str) -> list[str]:
    same = sum(episode.recorded == episode.success for episode in found)
    equal = sum(episode.compared and episode.difference is None for episode in found)
    lines = [
        f"{same} of {len(found)} episodes end as recorded; in {equal} all states are equal to the"
        " last bit."
    ]
    if other := [str(episode.episode_id) for episode in found if not episode.varied_alike]:
        lines.append(f"Their worlds do not vary here as recorded: episodes {', '.join(other)}.")
    if start == "state":
        lines.append("From a state no replay is exact: PhysX's memory is not part of a state.")
    elif any(episode.difference and not episode.exact for episode in found):
        lines.append(
            "Worlds that were reused when an episode was recorded make its states depend on the"
            " episodes before; here every episode has a new world."
        )
    return lines


def _states(episode: Replayed) -> str:
    if not episode.compared:
        return "not recorded"
    return "equal" if episode.difference is None else f"differ {printable(str(episode.difference))}"


def _word(success: bool | None) -> str:
    return {True: "success", False: "failure", None: "–"}[success]

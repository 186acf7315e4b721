"""Commands that show what is recorded, and record by hand."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path

from layouts.commands import Page, Server
from robot_layouts.core.cli import Folder, Seed
from robot_layouts.core.pages import plural
from robot_layouts.data.playing.command_options import (
    ControlMode,
    Policy,
    RecordingOption,
    RecordingPath,
    stop_signals,
)
from robots import TaskError
from tasks.cell_options import CellOptions

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
    from robot_layouts.data.playing.policies import find_policy
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
    from robot_layouts.data.viewing import episode_cell

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

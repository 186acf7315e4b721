"""``rl.view``: a layout, an environment or a recording in a browser."""

from __future__ import annotations

from os import PathLike, fspath
from pathlib import Path
from typing import Any

from layouts import Layout
from layouts.commands import Page
from layouts.viewer import ShownCell, ShownMotion
from robot_layouts.core.commands import LOOPBACK
from robot_layouts.data.playing.replay import open_recording
from robot_layouts.data.reading.json_files import TrajectoryError
from robot_layouts.data.reading.recorded_task import task_for
from robot_layouts.data.reading.recording import Recording, Trajectory
from tasks import TaskEnv
from tasks.episode import REBUILT, play
from tasks.view import recorded_motion, task_cell


def view(
    shown: Layout | TaskEnv | Recording | str | PathLike[str],
    *,
    episode: int = 0,
    html: str | PathLike[str] | None = None,
    host: str = LOOPBACK,
    port: int = 8080,
) -> None:
    """Show a layout, an environment or a recording as a page in the browser.

    Prints the page's address, and serves it until Ctrl-C. Needs the extra ``view``.

    Args:
        shown: A layout; an environment, which is shown as it stands now; or a recording: what
            `record` returned, its folder, one of its files, or one that is open.
        episode: Which episode of a recording, from 0.
        html: Save the page as this file instead, without sliders for joints.
        host: Where to listen; 127.0.0.1 is this machine alone, 0.0.0.0 the network, too.
        port: Port; 0 takes any free one.

    Raises:
        MissingPackageError: If viser is not installed.
        TrajectoryError: If there is no such recording or episode, or it cannot be played.
        ViewerError: If the page cannot be served or saved.
    """
    page = Page(host=host, port=port, html=None if html is None else fspath(html))
    if isinstance(shown, Layout):
        robots = ", ".join(f"{name} {placed.robot.name}" for name, placed in shown.items())
        page.show(lambda: ShownCell(robots, shown))
    elif isinstance(shown, TaskEnv):
        page.show(lambda: task_cell(shown, shown.task_id))
    elif isinstance(shown, Recording):
        page.show(lambda: episode_cell(shown, episode))
    else:
        with open_recording(Path(shown), None) as recording:
            page.show(lambda: episode_cell(recording, episode))


def episode_cell(file: Recording, number: int, **cell: Any) -> ShownCell:
    """Return what a page shows of an episode.

    Args:
        file: The recording.
        number: Its place in the file.
        **cell: Which robots stood where, where the file cannot say it; see
            `robot_layouts.data.reading.recorded_task.task_for`.

    Raises:
        TrajectoryError: If there is no such episode, or it cannot be shown.
    """
    if not len(file):
        raise TrajectoryError(f"{file.path} holds no episodes")
    if not 0 <= number < len(file):
        raise TrajectoryError(
            f"{file.path} has no episode {number}; it has {len(file)}, from 0 to {len(file) - 1}"
        )
    task, trajectory = task_for(file, **cell), file[number]
    try:
        motion = _motion(task, trajectory)
        title = f"{task.task_id}, episode {trajectory.episode_id} of {file.path.name}"
        return task_cell(task, title, motion)
    finally:
        task.close()


def _motion(task: TaskEnv, trajectory: Trajectory) -> ShownMotion:
    """Reset the task as the episode began, and return what happens in it."""
    states = trajectory.states
    if states is None:
        if trajectory.seed is None:
            raise TrajectoryError(
                f"traj_{trajectory.episode_id} holds neither states nor the seed of its reset"
            )
        states = play(task, trajectory.seed, trajectory.actions).states
    task.reset(trajectory.seed or 0, options=REBUILT)
    return recorded_motion(task, states)

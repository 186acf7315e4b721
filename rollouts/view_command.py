"""``robot-layouts view``: an episode of a recording on a page, with a timeline."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from layouts.view_command import add_page_options, show
from layouts.viewer import Cell, Motion
from rollouts.playing.replay_command import add_recording
from tasks.cell_options import chosen_cell

if TYPE_CHECKING:
    from rollouts.reading.recording import Recording, Trajectory
    from tasks import MultiRobotTask

EPILOG = (
    "Shows the recorded states; where a file holds none, the actions are played again. Exit code: 0"
    " if the page was served or saved, 1 if not."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.epilog = EPILOG
    add = parser.add_argument
    add_recording(parser)
    add("--episode", type=int, default=0, metavar="N", help="the Nth in the file, from 0 (0)")
    add_page_options(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command; returns its exit code.

    Raises:
        RobotLayoutsError: If the recording cannot be shown.
    """
    from rollouts.playing.replay import open_recording

    with open_recording(options.file, options.task) as file:
        cell = chosen_cell(options)
        return show(lambda: episode_cell(file, options.episode, **cell), options)


def episode_cell(file: Recording, number: int, **cell: Any) -> Cell:
    """Return what a page shows of an episode.

    Args:
        file: The recording.
        number: Its place in the file.
        **cell: Which robots stood where, where the file cannot say it; see
            `rollouts.reading.recorded_task.task_for`.

    Raises:
        TrajectoryError: If there is no such episode, or it cannot be shown.
    """
    from rollouts.playing.replay import task_for
    from rollouts.reading.recording import TrajectoryError
    from tasks.view import task_cell

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


def _motion(task: MultiRobotTask, trajectory: Trajectory) -> Motion:
    """Reset the task as the episode began, and return what happens in it."""
    from rollouts.reading.recording import TrajectoryError
    from tasks.episode import REBUILT, play
    from tasks.view import recorded_motion

    states = trajectory.states
    if states is None:
        if trajectory.seed is None:
            raise TrajectoryError(
                f"traj_{trajectory.episode_id} holds neither states nor the seed of its reset"
            )
        states = play(task, trajectory.seed, trajectory.actions).states
    task.reset(trajectory.seed or 0, options=REBUILT)
    return recorded_motion(task, states)

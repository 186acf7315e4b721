"""``robot-layouts teleop``: steer a task's arms in a browser, and record that."""

from __future__ import annotations

import argparse
from contextlib import closing
from pathlib import Path

from layouts.view_command import add_server_options
from robots import TaskError
from robots.common.pages import plural
from rollouts.playing import command_options as workers
from rollouts.playing.command_options import stop_signals, zero_or_more
from tasks.cell_options import add_cell_options, chosen_cell

EPILOG = (
    "Prints the address of the page, and serves it until Ctrl-C. Every episode that is kept is on"
    " the disk at once; the same command goes on with the next seed. Exit code: 0 if the page was"
    " served, 1 if not, 2 for bad usage."
)
FOLDER = Path("runs/teleop")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.epilog = EPILOG
    add = parser.add_argument
    add("task", metavar="TASK", help="task id; MODULE:ID for one of your own")
    add("--seed", type=zero_or_more, default=0, metavar="S", help="seed of the first episode (0)")
    add(
        "--out",
        type=Path,
        metavar="DIR",
        help=f"folder of trajectory.h5 and .json ({FOLDER}/TASK)",
    )
    add(
        "--policy",
        metavar="MODULE:NAME",
        help="policy that acts until somebody takes an arm, as for `robot-layouts evaluate`",
    )
    add_cell_options(parser)
    workers.add_control_mode(parser)
    add_server_options(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command; returns its exit code.

    Raises:
        RobotLayoutsError: If the task cannot be made or steered, or the page cannot be served.
    """
    from layouts.viewer.server import import_viser

    import_viser()

    import tasks
    from rollouts.recording.record import FILE
    from rollouts.recording.recorder import Recorder
    from rollouts.sources.policies import find_policy
    from rollouts.teleop.page import serve
    from rollouts.teleop.session import Session

    policy = None if options.policy is None else find_policy(options.policy)
    if isinstance(policy, str):
        raise TaskError("an expert's plan is made for what it does itself; --policy needs a policy")
    task = tasks.make(options.task, control_mode=options.control_mode, **chosen_cell(options))
    folder = options.out or FOLDER / task.task_id
    recorder = Recorder(folder / FILE, task, resume=True, source="human", source_desc="browser")
    with closing(task), recorder, stop_signals():
        for what in recorder.damaged:
            print(f"{what} is damaged and does not count as recorded", flush=True)
        session = Session(task, recorder, options.seed, policy=policy, policy_name=options.policy)
        try:
            serve(session, options.host, options.port, lambda line: print(line, flush=True))
        except KeyboardInterrupt:
            pass
        kept, total = len(session.kept), len(recorder)
        print(f"{folder / FILE}: {plural(total, 'episode')}, {kept} of them new")
    return 0

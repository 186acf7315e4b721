"""``python -m measurements.datasets``: what data sets cost, and a large one made from end to end.

``bench`` records and certifies episodes of a task and says what 10,000 and 100,000 would take.
``memory`` records copies of a few episodes, up to 100,000, and looks at this process's memory.
``large`` records, certifies and reports episodes of several tasks in other layouts, in worlds that
vary in five axes; the same command goes on where it was stopped.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from pathlib import Path

import torch

from measurements.datasets import costs, memory
from measurements.datasets.large import FIVE, make_large
from robots.common.cli import at_least
from robots.common.commands import exit_code, start
from robots.common.writing import write_whole
from rollouts.playing.command_options import megabytes, stop_signals
from rollouts.playing.executor import ProcessExecutor
from rollouts.progress import LiveLine
from rollouts.reading.manifest import FILE_SIZE
from tasks import Randomization

TASK = "TwoRobotPickCube-v1"
LARGE = (TASK, "FourRobotStack-v1")


def main(arguments: list[str] | None = None) -> int:
    """Run the command; returns its exit code."""
    parser = argparse.ArgumentParser(prog="python -m measurements.datasets", description=__doc__)
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    bench = commands.add_parser("bench", help="record and certify; what more would take")
    bench.add_argument("--varied", action="store_true", help="in worlds that vary in five axes")
    words = "processes that play (0: this one, whose processor time is known)"
    bench.add_argument("--workers", type=at_least(0), default=0, metavar="W", help=words)
    bench.set_defaults(run=_bench)
    copies = commands.add_parser("memory", help="memory and time of many copies")
    copies.set_defaults(run=_memory)
    for command, count in ((bench, 300), (copies, 100_000)):
        add = command.add_argument
        add("--task", default=TASK, help="(%(default)s)")
        add("--episodes", type=at_least(1), default=count, metavar="N", help="(%(default)s)")
        add("--record", type=Path, metavar="FILE", help="add the figures to a JSON file")
        add("--folder", type=Path, metavar="DIR", help="where recordings go and stay (temporary)")
        add("--file-size", type=megabytes, default=FILE_SIZE, metavar="MB", help="(%(default)g)")

    large = commands.add_parser("large", help="a large data set, certified and reported")
    add = large.add_argument
    add("--tasks", nargs="+", default=LARGE, metavar="TASK", help=f"({' '.join(LARGE)})")
    add("--episodes", type=at_least(1), default=10_000, metavar="N", help="of each (%(default)s)")
    words = "numbers of the layouts of each task (0 to 9)"
    add("--layouts", nargs="+", type=at_least(0), default=range(10), metavar="K", help=words)
    add("--workers", type=at_least(1), default=2, metavar="W", help="(%(default)s)")
    add("--clips", type=at_least(0), default=4, metavar="N", help="of each layout (%(default)s)")
    add("--out", type=Path, required=True, metavar="DIR", help="folder of all")
    large.set_defaults(run=_large)
    options = parser.parse_args(arguments)
    torch.set_num_threads(1)
    with stop_signals():
        return exit_code(lambda: options.run(options))


def _bench(options: argparse.Namespace) -> int:
    varied = Randomization.from_json(FIVE) if options.varied else None
    with tempfile.TemporaryDirectory() as temporary, LiveLine(2 * options.episodes) as line:
        found = costs.measure(
            options.task,
            options.episodes,
            options.folder or Path(temporary),
            options.workers,
            options.file_size,
            varied,
            lambda what: line.advance(1, what),
        )
    print(found)
    name = f"{options.task}{', varied' if options.varied else ''}"
    _note(options.record, f"bench {name}", found.to_json())
    return 0 if found.equal == found.episodes else 1


def _memory(options: argparse.Namespace) -> int:
    with tempfile.TemporaryDirectory() as temporary, LiveLine(options.episodes) as line:
        found = memory.measure(
            options.task,
            options.episodes,
            options.folder or Path(temporary),
            options.file_size,
            lambda what: line.advance(1, what),
        )
    print(found)
    about = {"text": str(found).splitlines(), "bytes_per_episode": found.slope}
    _note(options.record, f"memory {options.task}", about)
    return 0


def _large(options: argparse.Namespace) -> int:
    total = 2 * len(options.tasks) * options.episodes
    with LiveLine(total, "episodes") as line:
        found = make_large(
            options.out,
            options.tasks,
            options.episodes,
            options.layouts,
            lambda: ProcessExecutor(options.workers),
            clips=options.clips,
            say=line.say,
            progress=lambda what: line.advance(1, what),
        )
    good = [seen["equal"] == seen["episodes"] for seen in found.values()]
    return 0 if good and all(good) else 1


def _note(path: Path | None, name: str, about: object) -> None:
    if path is not None:
        record = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
        write_whole(path, json.dumps({**record, name: about}, indent=1) + "\n")


if __name__ == "__main__":
    start(main)

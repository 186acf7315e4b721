"""``python -m measurements.gallery``: a page for every task and every robot, from the code.

Pages hold what descriptors, task classes and records say, and show the pictures that there are.
Nothing is simulated or drawn for them: what takes robot files is measured by `--measure`, and
pictures are drawn by `--pictures`, of all tasks and robots or of those that are named.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path

from measurements.gallery.pages import complaints, write_pages
from measurements.gallery.record import Record
from robots import AssetError, UnknownNameError
from robots.common.commands import FAILED, exit_code, notice, start
from robots.registry import CATALOGUE as ROBOTS
from rollouts.progress import LiveLine
from tasks.registry import CATALOGUE as TASKS

FOLDER = Path(__file__).parents[2] / "docs" / "gallery"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command.

    Returns:
        0; 1 if a check finds that pages are not what would be written, or something cannot be read,
        written or drawn; 2 if there is no such task or robot.
    """
    parser = argparse.ArgumentParser(prog="python -m measurements.gallery", description=__doc__)
    add = parser.add_argument
    add("names", nargs="*", metavar="NAME", help="tasks and robots to measure or draw (all)")
    what = parser.add_mutually_exclusive_group()
    add = what.add_argument
    add("--check", action="store_true", help="write nothing; tell which pages are stale")
    add("--measure", action="store_true", help="read robot files, let experts play (minutes)")
    add("--pictures", action="store_true", help="draw robots and film experts (minutes)")
    options = parser.parse_args(arguments)
    if options.names and not (options.measure or options.pictures):
        parser.error("names are taken by --measure and --pictures; pages are all written")
    return exit_code(lambda: _run(options))


def _run(options: argparse.Namespace) -> int:
    names = _chosen(options.names)
    if options.check:
        found = list(complaints(Record.read(), FOLDER))
        for complaint in found:
            notice(complaint)
        return FAILED if found else 0
    complete = True
    if options.measure:
        complete = _measure(names)
    if options.pictures:
        complete = _draw(names)
    count = write_pages(Record.read(), FOLDER)
    print(f"{FOLDER}: {count} pages")
    return 0 if complete else FAILED


def _chosen(names: Sequence[str]) -> list[str]:
    """Return tasks and robots by name, or all.

    Raises:
        UnknownNameError: If there is none of that name.
    """
    choices = [*ROBOTS, *TASKS]
    for name in names:
        if name not in choices:
            raise UnknownNameError("task or robot of the gallery", name, choices)
    return list(names) or choices


def _measure(names: Sequence[str]) -> bool:
    from measurements.gallery.measure import EPISODES, measure_task, read_robot
    from measurements.gallery.record import RECORD

    record = Record.read() if RECORD.exists() else Record()

    def measure(name: str, advance: Callable[[], None]) -> None:
        if name in ROBOTS:
            record.robots[name] = read_robot(name)
            advance()
        else:
            record.tasks[name] = measure_task(name, advance)
        record.write()

    sizes = [EPISODES if name in TASKS else 1 for name in names]
    return _each(names, LiveLine(sum(sizes), "episodes and robots"), measure)


def _draw(names: Sequence[str]) -> bool:
    from measurements.gallery.pictures import Artist

    artist = Artist(Record.read(), FOLDER)

    def draw(name: str, advance: Callable[[], None]) -> None:
        if name in ROBOTS:
            artist.draw_robot(name)
        else:
            artist.film_task(name)
        advance()

    return _each(names, LiveLine(len(names), "pictures"), draw)


def _each(
    names: Sequence[str], line: LiveLine, do: Callable[[str, Callable[[], None]], None]
) -> bool:
    """Do something for each name; those whose files cannot be had are left out, and said.

    Returns:
        Whether none was left out.
    """
    left_out = 0
    with line:
        for name in names:
            try:
                do(name, lambda name=name: line.advance(1, name))
            except AssetError as error:
                left_out += 1
                line.say(f"{name} is left out: {str(error).splitlines()[0]}")
    return not left_out


if __name__ == "__main__":
    start(main)

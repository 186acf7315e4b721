"""``python -m measurements.robots``: tries URDFs of other packages, and writes what it saw.

Sources are packages that are installed (all that it knows, if nothing else is named) and folders.
The record is JSON; the table, beside it as markdown, compares it with what is expected of robots
that are known.
"""

from __future__ import annotations

import argparse
import fnmatch
from collections.abc import Sequence
from pathlib import Path

from measurements.robots.expectations import EXPECTED, read_expectations
from measurements.robots.record import Record, SurveyError, versions_of
from measurements.robots.sources import PACKAGES, Robot, find_robots, named_folder, package_folder
from measurements.robots.survey import survey_into
from measurements.robots.table import markdown
from robots import MissingPackageError
from robots.common.commands import exit_code, notice, program, start
from robots.common.writing import write_whole

RECORD = Path("docs/robots.json")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command.

    Returns:
        0 if every robot was tried, 1 if something cannot be read or written, 2 if a source does
        not exist.
    """
    parser = argparse.ArgumentParser(prog=program("measurements.robots"), description=__doc__)
    add = parser.add_argument
    add("folders", nargs="*", metavar="[NAME=]FOLDER", help="folders with URDFs")
    add(
        "--sources", nargs="+", metavar="PACKAGE", help=f"installed packages: {', '.join(PACKAGES)}"
    )
    add("--only", nargs="+", metavar="PATTERN", help="robots whose SOURCE/PATH matches, as a shell")
    add("--expected", type=Path, default=EXPECTED, metavar="FILE", help="what is expected of them")
    add("--out", type=Path, default=RECORD, metavar="FILE", help="the record (default %(default)s)")
    add("--workers", type=int, default=1, metavar="N", help="processes at a time (%(default)s)")
    add("--seconds", type=float, default=180.0, metavar="S", help="for a robot (%(default)g)")
    add("--resume", action="store_true", help="keep what the record holds, and try the others")
    add("--table", action="store_true", help="try nothing; write the table of the record anew")
    options = parser.parse_args(arguments)
    return exit_code(lambda: _run(options))


def _run(options: argparse.Namespace) -> int:
    expected = read_expectations(options.expected)
    keeps = options.resume and options.out.exists()
    record = Record.read(options.out) if keeps or options.table else Record()
    if not options.table:
        if options.workers < 1:
            raise SurveyError(f"--workers is {options.workers}; it must be 1 or more")
        robots = [robot for robot in _robots(options) if robot.key not in record.robots]
        record.versions |= versions_of("robot-layouts", "sapien", *PACKAGES)
        limits = {"workers": options.workers, "seconds": options.seconds}
        survey_into(record, options.out, robots, "robots", **limits)
    table = options.out.with_suffix(".md")
    write_whole(table, "\n".join(markdown(record, expected)) + "\n")
    print(f"{options.out}, {table}: {len(record.robots)} robots")
    return 0


def _robots(options: argparse.Namespace) -> list[Robot]:
    folders = [named_folder(text) for text in options.folders]
    folders += [(name, package_folder(name)) for name in options.sources or ()]
    if not folders:
        folders = list(_installed())
    patterns = options.only or ["*"]
    robots = find_robots(folders)
    return [r for r in robots if any(fnmatch.fnmatch(r.key, pattern) for pattern in patterns)]


def _installed() -> list[tuple[str, Path]]:
    folders: list[tuple[str, Path]] = []
    for name in PACKAGES:
        try:
            folders.append((name, package_folder(name)))
        except MissingPackageError as error:
            notice(f"{name} is left out: {error}")
    return folders


if __name__ == "__main__":
    start(main)

"""``robot-layouts robots survey``: tries URDFs of other packages, and writes what it saw."""

from __future__ import annotations

import argparse
import fnmatch
from pathlib import Path

from measurements.robots.expectations import EXPECTED, read_expectations
from measurements.robots.record import Record, SurveyError, versions_of
from measurements.robots.sources import PACKAGES, Robot, find_robots, named_folder, package_folder
from measurements.robots.survey import survey_into
from measurements.robots.table import markdown
from robot_layouts.__main__ import main_of
from robots import MissingPackageError
from robots.common.commands import notice, start
from robots.common.writing import write_whole

RECORD = Path("docs/robots.json")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.epilog = (
        "The record is JSON; the table beside it, in Markdown, compares it with what is expected of"
        " robots that are known. Without a source, all installed packages that it knows are tried."
    )
    add = parser.add_argument
    add("folders", nargs="*", metavar="[NAME=]FOLDER", help="folders with URDFs")
    add(
        "--sources", nargs="+", metavar="PACKAGE", help=f"installed packages: {', '.join(PACKAGES)}"
    )
    add("--only", nargs="+", metavar="PATTERN", help="robots whose SOURCE/PATH matches, as a shell")
    add("--expected", type=Path, default=EXPECTED, metavar="FILE", help="what is expected of them")
    add("--out", type=Path, default=RECORD, metavar="FILE", help="the record (default %(default)s)")
    add("--workers", type=int, default=1, metavar="N", help="processes at a time (%(default)s)")
    add(
        "--seconds",
        type=float,
        default=180.0,
        metavar="S",
        help="time limit for a robot (%(default)g)",
    )
    add("--resume", action="store_true", help="keep what the record holds, and try the others")
    add("--table", action="store_true", help="try nothing; write the table of the record anew")


def run(options: argparse.Namespace) -> int:
    """Run the command; returns 0 if every robot was tried.

    Raises:
        RobotLayoutsError: If a source does not exist, or something cannot be read or written.
    """
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


main = main_of("robots survey")

if __name__ == "__main__":
    start(main)

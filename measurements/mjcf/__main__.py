"""``python -m measurements.mjcf NAME=FOLDER …``: tries MJCFs of packages, and writes what it saw.

A package is a folder into which its wheel was unpacked. Tried are the MJCFs of
``measurements/mjcf/expected.yaml``, each in a process of its own. The record is JSON; the table,
beside it as markdown, compares it with what is expected. MuJoCo is needed.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from measurements.mjcf.table import markdown
from measurements.robots.expectations import read_expectations
from measurements.robots.record import Record, versions_of
from measurements.robots.sources import Robot, named_folder
from measurements.robots.survey import survey_into
from robots.common.commands import exit_code, start
from robots.common.writing import write_whole

EXPECTED = Path(__file__).with_name("expected.yaml")
RECORD = Path("docs/mjcf.json")
PROBE = "measurements.mjcf.probe"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command.

    Returns:
        0 if every MJCF was tried, 1 if something cannot be read or written.
    """
    parser = argparse.ArgumentParser(prog="python -m measurements.mjcf", description=__doc__)
    add = parser.add_argument
    add("folders", nargs="*", metavar="NAME=FOLDER", help="packages, unpacked")
    add("--out", type=Path, default=RECORD, metavar="FILE", help="the record (default %(default)s)")
    add("--seconds", type=float, default=240.0, metavar="S", help="for a robot (%(default)g)")
    add("--resume", action="store_true", help="keep what the record holds, and try the others")
    add("--table", action="store_true", help="try nothing; write the table of the record anew")
    options = parser.parse_args(arguments)
    return exit_code(lambda: _run(options))


def _run(options: argparse.Namespace) -> None:
    expected = read_expectations(EXPECTED)
    keeps = options.resume and options.out.exists()
    record = Record.read(options.out) if keeps or options.table else Record()
    if not options.table:
        folders = dict(map(named_folder, options.folders))
        robots = [robot for robot in _robots(folders) if robot.key not in record.robots]
        record.versions |= versions_of("robot-layouts", "sapien", "mujoco") | _versions(folders)
        survey_into(record, options.out, robots, "MJCFs", seconds=options.seconds, module=PROBE)
    table = options.out.with_suffix(".md")
    write_whole(table, "\n".join(markdown(record, expected)) + "\n")
    print(f"{options.out}, {table}: {len(record.robots)} MJCFs")


def _robots(folders: dict[str, Path]) -> list[Robot]:
    """Return the MJCFs that are expected and there."""
    found: list[Robot] = []
    for key in read_expectations(EXPECTED).keys:
        source, _, path = key.partition("/")
        if source in folders and (folders[source] / path).is_file():
            found.append(Robot(source, path, folders[source]))
    return found


def _versions(folders: dict[str, Path]) -> dict[str, str]:
    """Return the versions that unpacked packages give, by their folders of metadata."""
    versions: dict[str, str] = {}
    for name, folder in folders.items():
        for about in (*folder.glob("*.dist-info"), *folder.glob("*-*/PKG-INFO")):
            part = about.parent.name if about.name == "PKG-INFO" else about.stem
            versions[name] = part.rpartition("-")[2]
    return versions


if __name__ == "__main__":
    start(main)

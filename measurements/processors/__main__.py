"""``python -m measurements.processors``: what of results depends on the processor.

The same episodes are played in one process after the other, each under variables that make one
library compute as on another processor, or on a whole processor that QEMU emulates. The record is
JSON, and keeps other settings that were measured before; the table is beside it as markdown.
"""

from __future__ import annotations

import argparse
import json
import platform
from pathlib import Path

from measurements.processors.measure import (
    EMULATOR,
    Record,
    differences,
    physics,
    play_under,
    processor,
)
from measurements.processors.play import EXPERT, Digests, Played
from measurements.processors.settings import PORTABLE, Setting, settings
from measurements.processors.table import markdown
from measurements.robots.record import versions_of
from robots import RecordingError
from robots.common.commands import exit_code, start
from robots.common.writing import write_whole
from rollouts.progress import LiveLine
from tasks import list_tasks

PACKAGES = ("numpy", "torch", "sapien")
RECORD = Path("docs/processors.json")

# The first seed of each, and the number of steps where actions are random.
CONTROLS = {
    EXPERT: (0, 0),
    "pd_joint_delta_pos": (3, 12),
    "pd_ee_delta_pose": (4, 12),
    "pd_ee_pose": (5, 8),
}


def main(arguments: list[str] | None = None) -> int:
    """Run the command.

    Returns:
        0 if everything was played, 1 if something cannot be played, read or written.
    """
    parser = argparse.ArgumentParser(prog="python -m measurements.processors", description=__doc__)
    add = parser.add_argument
    add("--tasks", nargs="+", default=list_tasks(), metavar="TASK", help="(all)")
    add("--seeds", type=int, default=1, metavar="N", help="of each expert and mode (%(default)s)")
    add("--settings", nargs="+", choices=settings(), metavar="NAME", help="(all that need no QEMU)")
    add("--emulator", default=EMULATOR, metavar="PROGRAM", help="QEMU's (%(default)s)")
    add("--out", type=Path, default=RECORD, metavar="FILE", help="the record (%(default)s)")
    add("--table", action="store_true", help="play nothing; write the table of the record anew")
    return exit_code(lambda: _run(parser.parse_args(arguments)))


def _run(options: argparse.Namespace) -> int:
    record = _read(options.out) if options.out.exists() else _empty()
    if not options.table:
        record["processor"] = processor()
        record["versions"] |= {**versions_of(*PACKAGES), "glibc": platform.libc_ver()[1]}
        _measure(record, options)
    table = options.out.with_suffix(".md")
    write_whole(table, "\n".join(markdown(record)) + "\n")
    print(f"{options.out}, {table}: {len(record['settings'])} settings")
    return 0


def _empty() -> Record:
    return {"processor": "", "versions": {}, "settings": {}, "portable": {}}


def _read(path: Path) -> Record:
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
        return {key: type(value)(record[key]) for key, value in _empty().items()}
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise RecordingError(f"{path} holds no record of processors: {error!r}") from error


def _episodes(options: argparse.Namespace) -> list[Played]:
    return [
        Played(task, first + i, control, steps)
        for task in options.tasks
        for control, (first, steps) in CONTROLS.items()
        for i in range(options.seeds)
    ]


def _measure(record: Record, options: argparse.Namespace) -> None:
    """Play under all settings that were asked for; the record is written after each."""
    known, episodes = settings(), _episodes(options)
    asked = options.settings or [name for name, one in known.items() if not one.emulated]
    needed = [name for name in known if any(name in (one, known[one].against) for one in asked)]
    played: dict[str, list[Digests | None]] = {}
    with LiveLine(len(needed) * len(episodes), "episodes") as line:
        for name in needed:
            one = known[name]
            played[name] = play_under(
                one,
                episodes,
                emulator=options.emulator,
                on_episode=lambda played, name=name: line.advance(1, f"{name}: {played.task}"),
            )
            if name != one.against:
                record["settings"][name] = _compared(one, episodes, played, name)
            if name == PORTABLE:
                record["portable"] |= physics(episodes, played[name])
            write_whole(options.out, json.dumps(record, indent=1) + "\n")


def _compared(
    one: Setting, episodes: list[Played], played: dict[str, list[Digests | None]], name: str
) -> Record:
    different = differences(episodes, played[one.against], played[name])
    count = sum(digests is not None for digests in played[name])
    return {"about": one.about, "against": one.against, "episodes": count, "different": different}


if __name__ == "__main__":
    start(main)

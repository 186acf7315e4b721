"""``python -m measurements.conversions``: how many recordings succeed in other control modes.

Experts of ManiSkill's tasks record episodes that succeed; each is converted to the other control
modes, and what was kept is played in native ManiSkill, if asked for. The record is JSON, and goes
on where it stopped; the table is beside it as markdown.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from shutil import rmtree
from typing import Any

import numpy as np
import torch

from measurements.robots.record import versions_of
from robots import CONTROL_MODES, RecordingError, TaskError
from robots.common.commands import exit_code, start
from robots.common.writing import write_whole
from rollouts.playing.mode_conversion import followed, turned
from rollouts.playing.replay import open_recording, task_for
from rollouts.progress import LiveLine
from rollouts.recording.convert import convert
from rollouts.recording.record import FILE, record
from tasks import get_task_class, list_clones

RECORD = Path("docs/conversions.json")
PLACES = "pd_ee_delta_pos", "pd_ee_target_delta_pos"  # they move the TCP's place alone
MODES = tuple(mode for mode in CONTROL_MODES[1:] if mode not in PLACES)
SPARE = 5  # episodes more than are wanted, as experts may fail
ALL = *MODES, *PLACES
FEW = 5  # episodes in which the TCP's turn is measured, and which `PLACES` are tried with

Seen = dict[str, Any]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command.

    Returns:
        0 if everything was tried, 1 if something cannot be read or written.
    """
    parser = argparse.ArgumentParser(prog="python -m measurements.conversions", description=__doc__)
    add = parser.add_argument
    add("--tasks", nargs="+", metavar="TASK", help="(all of ManiSkill's that there are)")
    add("--modes", nargs="+", metavar="MODE", default=ALL, choices=ALL, help="(all)")
    add("--episodes", type=int, default=25, metavar="N", help="of each task (%(default)s)")
    add("--native", action="store_true", help="play what was kept in native ManiSkill, too")
    add("--work", type=Path, default=Path("runs/conversions"), metavar="DIR", help="(%(default)s)")
    add("--out", type=Path, default=RECORD, metavar="FILE", help="the record (%(default)s)")
    options = parser.parse_args(arguments)
    return exit_code(lambda: _run(options))


def _run(options: argparse.Namespace) -> int:
    torch.set_num_threads(1)
    found: dict[str, Any] = {"versions": versions_of("sapien", "mani_skill"), "tasks": {}}
    if options.out.exists():
        found = _read(options.out)
    names = [get_task_class(name).task_id for name in options.tasks or list_clones()]
    with LiveLine(len(names) * len(options.modes), "conversions") as line:
        for task_id in names:
            seen = found["tasks"].setdefault(task_id, {"modes": {}})
            for mode in options.modes:
                _try(seen, task_id, mode, options)
                found["tasks"] = dict(sorted(found["tasks"].items()))
                write_whole(options.out, json.dumps(found, indent=1) + "\n")
                line.advance(1, f"{task_id} {mode}")
    table = options.out.with_suffix(".md")
    write_whole(table, "\n".join(markdown(found)) + "\n")
    print(f"{options.out}, {table}: {len(found['tasks'])} tasks")
    return 0


def _read(path: Path) -> dict[str, Any]:
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        return {"versions": dict(found["versions"]), "tasks": dict(found["tasks"])}
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise RecordingError(f"{path} holds no record of conversions: {error!r}") from error


def _try(seen: Seen, task_id: str, mode: str, options: argparse.Namespace) -> None:
    """Convert the recordings of a task to a mode, unless that was done."""
    folder = options.work / task_id
    if "turn" not in seen:
        record(task_id, range(options.episodes + SPARE), folder / "recorded", workers=0)
        seen["turn"] = _turn(folder / "recorded")
    one = seen["modes"].setdefault(mode, {})
    if "kept" not in one:
        rmtree(folder / mode, ignore_errors=True)
        few = min(options.episodes, FEW) if mode in PLACES else options.episodes
        one |= _converted(folder, mode, few)
    if options.native and "native" not in one and one["kept"]:
        one |= _in_native(task_id, folder / mode / FILE)


def _converted(folder: Path, mode: str, wanted: int) -> Seen:
    with open_recording(folder / "recorded", None) as file:
        solved = [number for number in range(len(file)) if file[number].solved]
        if len(solved) < wanted:
            raise RecordingError(f"{file.path} has {len(solved)} successes; {wanted} are needed")
        result = convert(file, mode, folder / mode, solved[wanted - 1] + 1)
        before = {file[n].seed: len(file[n].actions) for n in solved}
    seen: Seen = {"tried": wanted, "kept": len(result.kept), "lost": sorted(result.lost)}
    if result.kept:
        with open_recording(folder / mode, None) as file:
            lengths = [len(e.actions) / before[e.seed] for e in file]
        seen["length"] = round(float(np.mean(lengths)), 3)
    return seen


def _in_native(task_id: str, path: Path) -> Seen:
    from parity.compare.episodes import recorded_episodes
    from parity.compare.runs import Run, play

    cls = get_task_class(task_id)
    episodes, mode = recorded_episodes(path, cls)
    run = Run(task_id, path.name, tuple(episodes), "fresh", cls.reward_modes[0], control_mode=mode)
    try:
        (result,) = play([run], lambda _, count: None)
    except TaskError:  # native's robot has no such mode
        return {"native": None}
    native, _, _ = result.successes
    return {"native": native, "equal": sum(episode.equal for episode in result.episodes)}


def _turn(folder: Path) -> float:
    """Return how far a recording turns a TCP from how it starts, on the average (degrees)."""
    with open_recording(folder, None) as file, closing(task_for(file)) as task:
        turns: list[float] = []
        for number in range(min(FEW, len(file))):
            states = followed(task, file[number].seed or 0, file[number].actions).states
            turns.extend(turned(states, arm) for arm in task.layout.arms)
    return round(float(np.mean(turns)), 1)


def markdown(found: Mapping[str, Any]) -> Iterator[str]:
    """Yield the lines of the page."""
    tasks: Mapping[str, Seen] = found["tasks"]
    versions = ", ".join(f"{name} {version}" for name, version in found["versions"].items())
    yield "# Recordings in other control modes"
    yield ""
    yield "Episodes in which experts solve ManiSkill's tasks in `pd_joint_delta_pos`, converted"
    yield "as `robot-layouts convert` does; `python -m measurements.conversions` writes this page."
    yield "In each cell: how many were kept of how many, as they succeed in the other mode, too;"
    yield "then in how many of those native ManiSkill succeeds. *turn* is how far the TCP turns, on"
    yield "the average (°). A dash is where native's robot has no such mode."
    yield f"Made with {versions}."
    yield ""
    yield from _table(tasks, MODES)
    yield ""
    yield "## Modes that move the TCP's place alone"
    yield ""
    yield "They cannot turn the TCP, so that a recording is kept only where the task can do without"
    yield f"the turn; {FEW} of each task were tried. `robot-layouts convert` says of each that is"
    yield "not kept how far it turns the TCP."
    yield ""
    yield from _table(tasks, PLACES)


def _table(tasks: Mapping[str, Seen], modes: Sequence[str]) -> Iterator[str]:
    yield _row("task", "turn", *(f"`{mode.removeprefix('pd_')}`" for mode in modes))
    yield _row("---", "---:", *["---:"] * len(modes))
    for task_id, seen in tasks.items():
        cells = (_cell(seen["modes"].get(mode, {})) for mode in modes)
        yield _row(f"`{task_id}`", f"{seen['turn']:.0f}", *cells)
    yield _row("all", "", *(_total([s["modes"].get(m, {}) for s in tasks.values()]) for m in modes))


def _cell(one: Seen) -> str:
    if "kept" not in one:
        return "–"
    kept = f"{one['kept']} / {one['tried']}"
    kept = kept if one["kept"] == one["tried"] else f"**{kept}**"
    if "native" not in one:
        return kept
    return f"{kept}, {'–' if one['native'] is None else one['native']}"


def _total(ones: Sequence[Seen]) -> str:
    tried, kept = (sum(one.get(key, 0) for one in ones) for key in ("tried", "kept"))
    return f"{kept / tried:.1%}" if tried else "–"


def _row(*cells: str) -> str:
    return f"| {' | '.join(cells)} |"


if __name__ == "__main__":
    start(main)

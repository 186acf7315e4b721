"""``python -m benchmarks conversions``: how many recordings succeed in other control modes.

Experts of ManiSkill's tasks record episodes that succeed; each is converted to the other control
modes, and what was kept is played in native ManiSkill, if asked for.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import closing
from pathlib import Path
from shutil import rmtree
from typing import Any

import numpy as np
import torch
from tqdm import tqdm

from benchmarks.records import (
    DOCS,
    Record,
    RecordError,
    read_record,
    table,
    versions_of,
    write_page,
    write_record,
)
from parity.episodes import recorded_source
from parity.lockstep import Run, play
from robot_layouts.data.playing.mode_conversion import followed, turned
from robot_layouts.data.playing.replay import open_recording
from robot_layouts.data.reading.recorded_task import task_for
from robot_layouts.data.reading.recording import FILE
from robot_layouts.data.recording.convert import convert
from robot_layouts.data.recording.record import record
from robots import CONTROL_MODES, TaskError
from tasks import get_task_class, list_clones

PLACES = "pd_ee_delta_pos", "pd_ee_target_delta_pos"  # they move the TCP's place alone
MODES = tuple(mode for mode in CONTROL_MODES[1:] if mode not in PLACES)
SPARE = 5  # episodes more than are wanted, as experts may fail
FEW = 5  # episodes in which the TCP's turn is measured, and which `PLACES` are tried with


def conversions(
    *,
    tasks: tuple[str, ...] = (),
    modes: tuple[str, ...] = (*MODES, *PLACES),
    episodes: int = 25,
    native: bool = False,
    work: Path = Path("runs/conversions"),
    out: Path = DOCS / "conversions.json",
) -> int:
    """Convert recordings of experts to other control modes, and count those that still succeed.

    Args:
        tasks: Task ids (all clones).
        modes: Control modes; those in the record are not tried again.
        episodes: Of each task.
        native: Play what was kept in native ManiSkill, too.
        work: Folder of the recordings.
        out: The record; the page is beside it.

    Raises:
        RobotLayoutsError: If something cannot be played, read or written.
    """
    torch.set_num_threads(1)
    found = read_record(out, versions={}, tasks={})
    names = [get_task_class(name).task_id for name in tasks or list_clones()]
    for task_id in tqdm(names, disable=None):
        seen = found["tasks"].setdefault(task_id, {"modes": {}})
        folder = work / task_id
        if "turn" not in seen:
            record(task_id, range(episodes + SPARE), folder / "recorded", workers=0)
            seen["turn"] = _turn(folder / "recorded")
        for mode in modes:
            one = seen["modes"].setdefault(mode, {})
            if "kept" not in one:
                rmtree(folder / mode, ignore_errors=True)
                one |= _converted(folder, mode, min(episodes, FEW) if mode in PLACES else episodes)
            if native and "native" not in one and one["kept"]:
                one |= _in_native(task_id, folder / mode / FILE)
            found["versions"] = found["versions"] or versions_of("sapien", "mani_skill")
            write_record(out, {**found, "tasks": dict(sorted(found["tasks"].items()))})
    tables = {name: _table(found["tasks"], m) for name, m in (("all", MODES), ("places", PLACES))}
    write_page(out, "conversions", versions=found["versions"], few=FEW, **tables)
    return 0


def _converted(folder: Path, mode: str, wanted: int) -> Record:
    with open_recording(folder / "recorded", None) as file:
        solved = [number for number in range(len(file)) if file[number].solved]
        if len(solved) < wanted:
            raise RecordError(f"{file.path} has {len(solved)} successes; {wanted} are needed")
        result = convert(file, mode, folder / mode, solved[wanted - 1] + 1)
        before = {file[n].seed: len(file[n].actions) for n in solved}
    seen: Record = {"tried": wanted, "kept": len(result.kept), "lost": sorted(result.lost)}
    if result.kept:
        with open_recording(folder / mode, None) as file:
            lengths = [len(e.actions) / before[e.seed] for e in file]
        seen["length"] = round(float(np.mean(lengths)), 3)
    return seen


def _in_native(task_id: str, path: Path) -> Record:
    cls = get_task_class(task_id)
    source = recorded_source(path, cls)
    mode = cls.reward_modes[0]
    run = Run(task_id, path.name, source.episodes, "fresh", mode, control_mode=source.control_mode)
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


def _table(tasks: Mapping[str, Record], modes: Sequence[str]) -> str:
    rows = [
        [f"`{id}`", f"{seen['turn']:.0f}", *(_cell(seen["modes"].get(mode, {})) for mode in modes)]
        for id, seen in tasks.items()
    ]
    totals = [_total([seen["modes"].get(m, {}) for seen in tasks.values()]) for m in modes]
    headings = ("task", "turn", *(f"`{mode.removeprefix('pd_')}`" for mode in modes))
    return table(headings, [*rows, ["all", "", *totals]])


def _cell(one: Mapping[str, Any]) -> str:
    if "kept" not in one:
        return "–"
    kept = f"{one['kept']} / {one['tried']}"
    kept = kept if one["kept"] == one["tried"] else f"**{kept}**"
    if "native" not in one:
        return kept
    return f"{kept}, {'–' if one['native'] is None else one['native']}"


def _total(ones: Sequence[Mapping[str, Any]]) -> str:
    tried, kept = (sum(one.get(key, 0) for one in ones) for key in ("tried", "kept"))
    return f"{kept / tried:.1%}" if tried else "–"

"""``python -m benchmarks datasets``: certified recordings of the cells' experts, and their recipes.

A recording is not kept; its recipe makes it again, byte for byte.
"""

from __future__ import annotations

import time
from pathlib import Path
from shutil import rmtree

import torch
from tqdm import tqdm

from benchmarks.cells import cells_of_the_library
from benchmarks.records import (
    DOCS,
    Record,
    read_record,
    table,
    versions_of,
    write_page,
    write_record,
)
from robot_layouts.core.writing import write_whole
from robot_layouts.data.dataset.certificate import certify
from robot_layouts.data.playing.executor import ProcessExecutor
from robot_layouts.data.reading.recording import Recording
from robot_layouts.data.recipe import recipe_text
from robot_layouts.data.recording.record import record

MB = 1e6


def datasets(
    *,
    tasks: tuple[str, ...] | None = None,
    episodes: int = 100,
    work: Path = Path("runs/datasets"),
    out: Path = DOCS / "datasets.json",
) -> int:
    """Record episodes of the cells' experts, certify them, and write their recipes.

    Args:
        tasks: Task ids; all cells if not given. Those in the record are not recorded again.
        episodes: Of each task.
        work: Folder of the recordings; each is begun anew, and removed once it is certified.
        out: The record; the page is beside it, and a folder of recipes.

    Raises:
        RobotLayoutsError: If something cannot be played, read or written.
    """
    torch.set_num_threads(1)
    found = read_record(out, versions={}, tasks={})
    names = cells_of_the_library() if tasks is None else tasks
    for task in tqdm([name for name in names if name not in found["tasks"]], disable=None):
        recipe = out.with_suffix("") / f"{task.removesuffix('-v1')}.yaml"
        found["tasks"][task] = _certified(task, episodes, work / task, recipe)
        found["versions"] |= versions_of("sapien", "ompl", "python-fcl")
        write_record(out, {**found, "tasks": dict(sorted(found["tasks"].items()))})
    rows = [_row(out.stem, task, seen) for task, seen in sorted(found["tasks"].items())]
    headings = ("cell", "solved", "equal again", "arms touch", "steps", "s each", "MB")
    write_page(out, "datasets", versions=found["versions"], sets=table(headings, rows))
    return 0


def _certified(task: str, episodes: int, folder: Path, recipe: Path) -> Record:
    """Record a cell, certify that, and return what is known of it; its recipe is written."""
    rmtree(folder, ignore_errors=True)  # to go on would count the seconds of some episodes alone
    begun = time.process_time()
    record(task, range(episodes), folder, workers=0)
    spent = time.process_time() - begun
    with Recording(folder) as file:
        steps = sum(len(episode.actions) for episode in file)
    size = sum(path.stat().st_size for path in folder.iterdir())
    recipe.parent.mkdir(parents=True, exist_ok=True)
    write_whole(recipe, recipe_text(folder, task, recipe.parent))
    seen = certify(folder, ProcessExecutor(1))
    rmtree(folder)
    return {
        "episodes": episodes,
        "recorded": seen.episodes,
        "solved": seen.successes,
        "equal": seen.equal,
        "touching": seen.arm_contacts.episodes,
        "steps": round(steps / seen.episodes),
        "seconds": round(spent / episodes, 1),
        "MB": round(size / MB, 1),
    }


def _row(folder: str, task: str, seen: Record) -> tuple[str, ...]:
    name = task.removesuffix("-v1")
    shares = (f"{seen['solved']} of {seen['episodes']}", f"{seen['equal']} of {seen['recorded']}")
    rest = (str(seen[key]) for key in ("touching", "steps", "seconds", "MB"))
    return (f"[{name}]({folder}/{name}.yaml)", *shares, *rest)

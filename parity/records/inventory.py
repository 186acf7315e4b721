"""``python -m parity inventory``: every task, what proves it, and what native has besides."""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table

from experts import list_experts
from parity.compare.native_env import native_tasks
from parity.compare.results import RESULTS, read
from robots import MissingPackageError, RobotRegistry
from rollouts.reading.recording import TrajectoryError
from rollouts.reading.summary import recorded_task
from tasks import get_task_class, list_clones, list_tasks
from tasks.description import UNKNOWN, TaskFacts, facts, short_modes
from tasks.registry import other_names

TABLE_WIDTH = 180  # columns that a table may take; a narrower terminal wraps it
NO_REASON = "not cloned yet"

# What native's registry does not tell: read in mani_skill 3.0.1, envs/.
_SCENES = "needs a dataset of indoor scenes"
_NO_ROBOT = "no descriptor here of its robot: "
_SPECIAL_REASONS = {
    "DrawSVG-v1": "needs the packages svgpathtools and svgwrite",
    "Empty-v1": "nothing to achieve",
    "PickCubeWidowXAI-v1": "needs robot files that native downloads: widowxai",
    "TableTopFreeDraw-v1": "nothing to achieve: free drawing",
    "ArchitecTHOR_SceneManipulation-v1": _SCENES,
    "SceneManipulation-v1": _SCENES,
}
_SPECIAL_PREFIXES = {
    "MS-": "a control-suite task on an MJCF model; descriptors here read URDFs",
    "ReplicaCAD": _SCENES,
    "RotateSingleObjectInHand": f"{_NO_ROBOT}allegro_hand_right_touch",
    "RotateValve": f"{_NO_ROBOT}dclaw",
}


@dataclass(frozen=True)
class Demonstration:
    """A file of recorded episodes.

    Attributes:
        path: Where it is.
        problem: Why it cannot be read, or None.
    """

    path: Path
    problem: str | None = None


@dataclass(frozen=True)
class Entry:
    """What the inventory says about one task.

    Attributes:
        facts: Its sizes, robots and reward modes.
        other_names: What it is known as besides its id.
        native_id: Id of the ManiSkill task that it clones, or None.
        expert: Whether a scripted expert plays it.
        episodes: Episodes in the last recorded comparison with native; None if there was none.
        equal: Whether that comparison found no difference; None if there was none.
        demonstrations: Files of recorded episodes.
    """

    facts: TaskFacts
    other_names: tuple[str, ...]
    native_id: str | None
    expert: bool
    episodes: int | None
    equal: bool | None
    demonstrations: tuple[Path, ...]


@dataclass(frozen=True)
class Missing:
    """A task of native's that has no clone here.

    Attributes:
        task_id: Native's id.
        reason: Why not, as far as that is known.
    """

    task_id: str
    reason: str


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.epilog = (
        "Prints sizes, expert, the recorded comparison with native and demonstrations; and the"
        " tasks of native ManiSkill that have no clone here."
    )
    add = parser.add_argument
    add("--demos", type=Path, metavar="DIR", help="look for demonstrations below DIR")
    add("--results", type=Path, default=RESULTS, help="the record (this project's)")
    add("--json", action="store_true", help="print json instead of tables")


def run(args: argparse.Namespace) -> int:
    """Run the command; returns 0.

    Raises:
        RobotLayoutsError: If something that it needs cannot be read.
    """
    demonstrations, unreadable = find_files(args.demos) if args.demos else ({}, [])
    entries = list(take_inventory(read(args.results)["tasks"], demonstrations))
    try:
        missing, note = missing_tasks(), None
    except MissingPackageError as error:
        missing, note = None, f"native's other tasks are not known here: {error}"
    if args.json:
        print(json.dumps(document(entries, missing, note, unreadable), indent=1))
        return 0
    console = Console(markup=False, highlight=False)
    console.width = max(console.width, TABLE_WIDTH)
    console.print(entries_table(entries, with_demonstrations=args.demos is not None))
    for file in unreadable:
        console.print(f"{file.path} is not counted: {file.problem}", soft_wrap=True)
    console.print(note or missing_table(missing or []), soft_wrap=True)
    return 0


def find_files(folder: Path) -> tuple[dict[str, list[Path]], list[Demonstration]]:
    """Return the demonstration files below a folder by task id, and those that cannot be read.

    Raises:
        TrajectoryError: If there is no such folder.
    """
    if not folder.is_dir():
        raise TrajectoryError(f"there is no folder {folder}")
    found: dict[str, list[Path]] = {}
    unreadable: list[Demonstration] = []
    for path in sorted(folder.rglob("*.h5")):
        try:
            found.setdefault(recorded_task(path), []).append(path)
        except TrajectoryError as error:
            unreadable.append(Demonstration(path, str(error)))
    return found, unreadable


def take_inventory(
    recorded: Mapping[str, Any], demonstrations: Mapping[str, Sequence[Path]]
) -> Iterator[Entry]:
    """Yield what is known about every task; makes each once, which takes seconds.

    Args:
        recorded: ``"tasks"`` of the record of comparisons.
        demonstrations: Files by task id.
    """
    experts, task_ids = list_experts(), list_tasks()
    with Console(stderr=True).status("") as status:
        for number, task_id in enumerate(task_ids, start=1):
            status.update(f"making {task_id} to count its numbers ({number} of {len(task_ids)})")
            result, cls = recorded.get(task_id, {}), get_task_class(task_id)
            yield Entry(
                facts(task_id),
                other_names(cls),
                cls.native_id,
                task_id in experts,
                result.get("episodes"),
                result.get("equal"),
                tuple(demonstrations.get(task_id, ())),
            )


def missing_tasks() -> list[Missing]:
    """Return native's tasks that have no clone here, sorted, each with the reason.

    Raises:
        MissingPackageError: If mani_skill is not installed.
    """
    ours = set(list_clones())
    return [
        Missing(task_id, reason(task_id, spec))
        for task_id, spec in native_tasks().items()
        if task_id not in ours
    ]


def reason(task_id: str, spec: Any) -> str:
    """Say why a task of native's is not cloned, as far as its registry entry tells.

    Args:
        task_id: Native's id.
        spec: Its specification in native's registry.
    """
    special = _SPECIAL_REASONS.get(task_id) or next(
        (remark for prefix, remark in _SPECIAL_PREFIXES.items() if task_id.startswith(prefix)), None
    )
    if special:
        return special
    if spec.asset_download_ids:
        return f"needs files that native downloads: {', '.join(spec.asset_download_ids)}"
    unknown = unknown_robots(getattr(spec.cls, "SUPPORTED_ROBOTS", None) or ())
    if unknown:
        return f"{_NO_ROBOT}{', '.join(unknown)}"
    return NO_REASON


def unknown_robots(supported: Sequence[str | Sequence[str]]) -> list[str]:
    """Return the robots that a task takes if none of them is in the catalogue, else nothing."""
    names = [name for entry in supported for name in ([entry] if isinstance(entry, str) else entry)]
    known = set(RobotRegistry.names())
    return [] if known.intersection(names) else sorted(set(names) - {"none"})


def document(
    entries: Sequence[Entry],
    missing: Sequence[Missing] | None,
    note: str | None,
    unreadable: Sequence[Demonstration],
) -> dict[str, Any]:
    """Return the inventory as plain data for json.

    Args:
        entries: The tasks.
        missing: Native's other tasks; None if they are not known.
        note: Why they are not known.
        unreadable: Files that look like demonstrations and are none.
    """
    return {
        "tasks": [
            {
                **asdict(entry.facts),
                "other_names": entry.other_names,
                "native_id": entry.native_id,
                "expert": entry.expert,
                "parity": {"episodes": entry.episodes, "equal": entry.equal},
                "demonstrations": [str(path) for path in entry.demonstrations],
            }
            for entry in entries
        ],
        "missing": None if missing is None else [asdict(task) for task in missing],
        "missing_note": note,
        "unreadable": {str(file.path): file.problem for file in unreadable},
    }


def entries_table(entries: Sequence[Entry], *, with_demonstrations: bool) -> Table:
    """Return one row per task."""
    rows = _table(f"{len(entries)} tasks")
    for name in ("task", "other name", "robots"):
        rows.add_column(name, no_wrap=True)
    for name in ("obs", "action", "steps"):
        rows.add_column(name, justify="right", no_wrap=True)
    for name in ("rewards", "expert", "parity"):
        rows.add_column(name, no_wrap=True)
    if with_demonstrations:
        rows.add_column("demos", justify="right", no_wrap=True)
    for entry in entries:
        about = entry.facts
        sizes = (about.observation_size, about.action_size, about.max_episode_steps)
        rows.add_row(
            about.task_id,
            ", ".join(entry.other_names) or UNKNOWN,
            about.robots,
            *map(str, sizes),
            short_modes(about.reward_modes),
            "yes" if entry.expert else UNKNOWN,
            parity_text(entry),
            *([str(len(entry.demonstrations))] if with_demonstrations else []),
        )
    return rows


def parity_text(entry: Entry) -> str:
    """Return the recorded comparison in few words: ``equal, 55 episodes``."""
    if entry.native_id is None:
        return "no clone"
    if entry.episodes is None:
        return "never compared"
    return f"{'equal' if entry.equal else 'DIFFERS'}, {entry.episodes} episodes"


def missing_table(missing: Sequence[Missing]) -> Table:
    """Return one row per task of native's that has no clone here."""
    rows = _table(f"{len(missing)} tasks of native ManiSkill have no clone here")
    rows.add_column("task", no_wrap=True)
    rows.add_column("reason")
    for task in missing:
        rows.add_row(task.task_id, task.reason)
    return rows


def _table(title: str) -> Table:
    return Table(
        title=title, title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False
    )

"""``python -m parity inventory``: every task, what proves it, and what native has besides."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table

from parity.episodes import find_demonstrations
from parity.native import native_tasks
from parity.results import RESULTS, read_results
from robot_layouts.experts import list_experts
from robots import MissingPackageError, RobotRegistry
from tasks import get_task_class, list_clones, list_tasks

TABLE_WIDTH = 180  # columns that a table may take; a narrower terminal wraps it
UNKNOWN, NO_REASON = "–", "not cloned yet"

# What native's registry does not say: read in mani_skill 3.0.1, envs/.
_SCENES = "needs a dataset of indoor scenes"
_NO_ROBOT = "no descriptor here of its robot: "
REASONS = {  # by the beginning of a task's id
    "ArchitecTHOR_SceneManipulation-v1": _SCENES,
    "DrawSVG-v1": "needs the packages svgpathtools and svgwrite",
    "Empty-v1": "nothing to achieve",
    "MS-": "a control-suite task on an MJCF model; descriptors here read URDFs",
    "PickCubeWidowXAI-v1": "needs robot files that native downloads: widowxai",
    "ReplicaCAD": _SCENES,
    "RotateSingleObjectInHand": f"{_NO_ROBOT}allegro_hand_right_touch",
    "SceneManipulation-v1": _SCENES,
    "TableTopFreeDraw-v1": "nothing to achieve: free drawing",
}


def inventory(*, demos: Path | None = None, results: Path = RESULTS) -> int:
    """List every task, how it was compared with native, and native's tasks without a clone.

    Args:
        demos: Count the demonstrations below this folder.
        results: The record of comparisons.

    Raises:
        RobotLayoutsError: If something that it needs cannot be read.
    """
    recorded, experts = read_results(results)["tasks"], list_experts()
    files = find_demonstrations(demos) if demos else {}
    rows = _table(f"{len(list_tasks())} tasks", "task", "expert", "parity", "demonstrations")
    for task_id in list_tasks():
        found = recorded.get(task_id)
        if get_task_class(task_id).native_id is None:
            compared = "no clone"
        elif found is None:
            compared = "never compared"
        else:
            compared = f"{'equal' if found['equal'] else 'DIFFERS'}, {found['episodes']} episodes"
        expert = "yes" if task_id in experts else UNKNOWN
        rows.add_row(task_id, expert, compared, str(len(files.get(task_id, ()))))
    console = Console(markup=False, highlight=False)
    console.width = max(console.width, TABLE_WIDTH)
    console.print(rows)
    try:
        missing = missing_tasks()
    except MissingPackageError as error:
        console.print(f"native's other tasks are not known here: {error}", soft_wrap=True)
        return 0
    rows = _table(f"{len(missing)} tasks of native ManiSkill have no clone here", "task", "reason")
    for row in missing.items():
        rows.add_row(*row)
    console.print(rows)
    return 0


def missing_tasks() -> dict[str, str]:
    """Return native's tasks that have no clone here, sorted, each with the reason.

    Raises:
        MissingPackageError: If mani_skill is not installed.
    """
    ours = set(list_clones())
    return {
        task_id: reason(task_id, spec)
        for task_id, spec in native_tasks().items()
        if task_id not in ours
    }


def reason(task_id: str, spec: Any) -> str:
    """Say why a task of native's is not cloned, as far as its registry entry tells.

    Args:
        task_id: Native's id.
        spec: Its specification in native's registry.
    """
    for beginning, why in REASONS.items():
        if task_id.startswith(beginning):
            return why
    if spec.asset_download_ids:
        return f"needs files that native downloads: {', '.join(spec.asset_download_ids)}"
    supported: Sequence[Any] = getattr(spec.cls, "SUPPORTED_ROBOTS", None) or ()
    names = {name for each in supported for name in ([each] if isinstance(each, str) else each)}
    if names.isdisjoint(RobotRegistry.names()) and (unknown := sorted(names - {"none"})):
        return f"{_NO_ROBOT}{', '.join(unknown)}"
    return NO_REASON


def _table(title: str, *columns: str) -> Table:
    rows = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, show_edge=False)
    for column in columns:
        rows.add_column(column)
    return rows

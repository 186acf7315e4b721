"""``python -m parity report``: what a sweep found, as one HTML page that needs nothing else."""

from __future__ import annotations

import argparse
import base64
import hashlib
import os
import shlex
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timezone
from importlib.resources import files
from pathlib import Path
from typing import Any

from parity import embedding
from parity.clip import SideBySide
from parity.inventory import missing_tasks
from parity.native import INSTALL
from parity.results import RESULTS, ResultsError, read
from parity.snapshot import STATE
from parity.summary import REWARD, number_text, success_text
from parity.sweep import SUMMARY, read_summary
from robots import MissingPackageError, RecordingError, RobotLayoutsError, TaskError
from rollouts.experts import list_experts
from tasks import MultiRobotTask, get_task_class, list_clones
from tasks.description import read_docstring, robots_text

LIMIT = 25.0  # MB
MARGIN = 20_000  # bytes kept free when clips are made to fit
UNKNOWN = "–"

_RECORDED_STATE = STATE
_RECORDED_REST = ("observation", "info")


@dataclass(frozen=True)
class Cell:
    """One figure of the table.

    Attributes:
        text: What is shown.
        number: Whether it is one, and stands on the right.
        bad: Whether it tells of a difference.
        sort: What the table is sorted by; the text if empty.
    """

    text: str
    number: bool = True
    bad: bool = False
    sort: str = ""

    @property
    def muted(self) -> bool:
        """Whether there is nothing to show."""
        return self.text == UNKNOWN


@dataclass(frozen=True)
class Column:
    """Heading of a column of the table, and how a task's cell in it is made."""

    name: str
    number: bool = True


COLUMNS = (  # the first six of the record, the others of the sweep; they break where \n is
    Column("episodes"),
    Column("steps"),
    Column("contact\nsteps"),
    Column("max |Δ|\nstate"),
    Column("max |Δ|\nrest"),
    Column("success\nnative / here"),
    Column("actions", number=False),
    Column("episodes\nequal"),
    Column("success\nnative / here"),
    Column("max |Δ|\nall"),
    Column("mean |Δ|\nof pixels"),
    Column("frames\nthat differ"),
)
RECORDED_COLUMNS = 6


@dataclass(frozen=True)
class Tile:
    """A headline figure."""

    value: str
    label: str
    note: str = ""
    bad: bool = False


@dataclass(frozen=True)
class Item:
    """What is missing for one and the same reason."""

    names: tuple[str, ...]
    why: str = ""


@dataclass(frozen=True)
class Group:
    """What is missing of one kind; ``nothing`` is said if ``entries`` is empty."""

    title: str
    entries: tuple[Item, ...]
    nothing: str = "None."


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command.

    Returns:
        0 if the page was written, 2 if not.
    """
    parser = argparse.ArgumentParser(
        prog="python -m parity report",
        description="Make one self-contained HTML page of what `python -m parity sweep` and the"
        " recorded comparison found, clips included.",
    )
    add = parser.add_argument
    add("--runs", type=Path, default=Path("runs"), metavar="DIR", help="the sweep's (%(default)s)")
    add("--out", type=Path, default=Path("report.html"), metavar="FILE", help="%(default)s")
    add("--results", type=Path, default=RESULTS, help="the record (this project's)")
    add("--limit", type=float, default=LIMIT, metavar="MB", help="largest page (%(default)g MB)")
    args = parser.parse_args(argv)
    try:
        page = make(args.runs, args.results, args.limit)
        _write(args.out, page)
    except RobotLayoutsError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    print(f"{args.out}: {len(page.encode()) / 1e6:.1f} MB")
    return 0


def make(runs: Path, results: Path = RESULTS, limit: float = LIMIT) -> str:
    """Return the page.

    Args:
        runs: Folder of a sweep.
        results: The recorded comparison.
        limit: Largest size (MB); clips are encoded anew where they have to be.

    Raises:
        ResultsError: If there is no sweep or no record, or one cannot be read.
        TaskError: If the page cannot be made as small as that.
    """
    if not (runs / SUMMARY).is_file():
        raise ResultsError(f"there is no {runs / SUMMARY}; `python -m parity sweep` writes it")
    swept, recorded = read_summary(runs / SUMMARY), read(results)
    paths = {
        task_id: runs / task_id / entry["clip"]["clip"]
        for task_id, entry in swept["tasks"].items()
        if entry["clip"]
    }
    if lost := [str(path) for path in paths.values() if not path.is_file()]:
        raise ResultsError(f"{', '.join(lost)} is gone; `python -m parity sweep --again` makes it")
    posters = {path: embedding.poster(path) for path in paths.values()}
    context = _context(runs, swept, recorded)
    bare = len(_render(context, {}).encode()) + sum(_encoded(len(p)) for p in posters.values())
    room = int((limit * 1e6 - bare - MARGIN) * 3 / 4)
    try:
        fitted = embedding.take(list(paths.values()), room, posters) if paths else {}
    except embedding.ClipError as error:
        raise TaskError(_too_large(limit, str(error))) from error
    page = _render(context, {task_id: fitted[path] for task_id, path in paths.items()})
    if len(page.encode()) > limit * 1e6:
        raise TaskError(_too_large(limit, f"it takes {len(page.encode()) / 1e6:.2f} MB"))
    return page


def _too_large(limit: float, why: str) -> str:
    return f"the page does not fit into {limit:g} MB ({why}); give a larger --limit, or fewer tasks"


def _encoded(count: int) -> int:
    return -(-count // 3) * 4 + 100  # base64, and the words around it


# -- what the page says --------------------------------------------------------------------------


def _context(runs: Path, swept: Mapping[str, Any], recorded: Mapping[str, Any]) -> dict[str, Any]:
    entries: Mapping[str, Any] = swept["tasks"]
    task_ids = sorted({*list_clones(), *entries})
    found = {task_id: entries.get(task_id) for task_id in task_ids}
    not_cloned, note = _not_cloned()
    return {
        "tiles": list(tiles(found, recorded["tasks"])),
        "columns": COLUMNS,
        "recorded_columns": RECORDED_COLUMNS,
        "tasks": [_task(t, entry, recorded["tasks"].get(t), runs) for t, entry in found.items()],
        "missing": list(missing(found)),
        "not_cloned": not_cloned,
        "not_cloned_note": note,
        "recorded_with": _with(recorded),
        "swept_with": _with(swept) if "versions" in swept else "versions that were not noted",
        "date": datetime.now(timezone.utc).strftime("%-d %B %Y"),
        "commands": [
            "python -m parity compare --all --demos DIR --record",
            f"python -m parity sweep --demos DIR --out {shlex.quote(str(runs))}",
            f"python -m parity report --runs {shlex.quote(str(runs))}",
        ],
    }


def tiles(
    swept: Mapping[str, Mapping[str, Any] | None], recorded: Mapping[str, Mapping[str, Any]]
) -> Iterator[Tile]:
    """Yield the headline figures.

    Args:
        swept: Each task's entry in the sweep's summary, or None.
        recorded: The recorded comparison by task.
    """
    equal = sum(bool(result["equal"]) for result in recorded.values())
    counts = {key: sum(r[key] for r in recorded.values()) for key in ("episodes", "steps")}
    largest = max(
        (float(x) for result in recorded.values() for x in _differences(result)), default=0.0
    )
    yield Tile(
        f"{equal} of {len(swept)}", "tasks equal to native", "to the last bit", equal < len(swept)
    )
    yield Tile(
        number_text(largest),
        "largest difference",
        f"{counts['episodes']:,} recorded episodes, {counts['steps']:,} steps",
        largest > 0,
    )
    agreements = [entry["agreement"] for entry in swept.values() if entry and entry["agreement"]]
    same, played = (sum(found[key] for found in agreements) for key in ("equal", "episodes"))
    yield Tile(f"{same} of {played}", "replayed episodes equal", "in this sweep", same < played)
    verified = sum(is_verified(entry) for entry in swept.values())
    yield Tile(
        f"{verified} of {len(swept)}",
        "verified clips",
        "both sides succeed, every pixel equal",
    )


def is_verified(entry: Mapping[str, Any] | None) -> bool:
    """Tell whether a clip shows both sides succeed without any difference."""
    return entry is not None and bool(entry["clip"]) and SideBySide(**entry["clip"]).verified


def cells(entry: Mapping[str, Any] | None, result: Mapping[str, Any] | None) -> list[Cell]:
    """Return a task's figures, one for each of `COLUMNS`.

    Args:
        entry: The task's entry in the sweep's summary, or None.
        result: Its recorded comparison, or None.
    """
    return [*_recorded_cells(result), *_swept_cells(entry or {})]


def _recorded_cells(result: Mapping[str, Any] | None) -> list[Cell]:
    if result is None:
        return [Cell(UNKNOWN)] * 6
    largest = result["max_difference"]
    state = max(float(largest[quantity]) for quantity in _RECORDED_STATE)
    rest = max(*(float(largest[q]) for q in _RECORDED_REST), *map(float, result[REWARD].values()))
    success = result["success"]
    return [
        *(_count(result[key]) for key in ("episodes", "steps", "contact_steps")),
        _difference(state),
        _difference(rest),
        _success(success_text(result), success["native"], success["ours"]),
    ]


def _swept_cells(entry: Mapping[str, Any]) -> list[Cell]:
    agreement, rollout, clip = (entry.get(key) for key in ("agreement", "rollout", "clip"))
    found = [Cell(entry.get("source") or UNKNOWN, number=False)]
    if agreement:
        equal, played = agreement["equal"], agreement["episodes"]
        native, ours = agreement["native_success"], agreement["our_success"]
        found.append(Cell(f"{equal} / {played}", bad=equal < played, sort=str(equal / played)))
        found.append(_success(f"{native} / {ours}", native, ours))
    else:
        found.extend([Cell(UNKNOWN)] * 2)
    both = [part["max_difference"] for part in (agreement, rollout) if part]
    found.append(_difference(max(map(float, both))) if both else Cell(UNKNOWN))
    if clip:
        differing, frames = clip["differing_frames"], clip["frames"]
        found.append(_difference(clip["mean_pixel_difference"]))
        found.append(Cell(f"{differing} of {frames}", bad=differing > 0, sort=str(differing)))
    else:
        found.extend([Cell(UNKNOWN)] * 2)
    return found


def _count(value: int) -> Cell:
    return Cell(f"{value:,}", sort=str(value))


def _difference(value: float) -> Cell:
    return Cell(number_text(value), bad=value != 0, sort=str(value))


def _success(text: str, native: int, ours: int) -> Cell:
    return Cell(text, bad=native != ours, sort=str(native))


def _differences(result: Mapping[str, Any]) -> list[float | str]:
    return [*result["max_difference"].values(), *result[REWARD].values()]


def _task(
    task_id: str, entry: Mapping[str, Any] | None, result: Mapping[str, Any] | None, runs: Path
) -> dict[str, Any]:
    cls = get_task_class(task_id)
    robots, said = robots_text(cls.layout), read_docstring(cls)
    success = f" Success: {said.success}" if said.success else ""
    return {
        "id": task_id,
        "robots": robots,
        "summary": f"{said.summary}{success}",
        "numbers": f"{cls.layout.action_dim} action numbers, {cls.max_episode_steps} steps",
        "cells": cells(entry, result),
        "status": _status(entry),
        "no_clip": _sentence(_no_clip(entry)),
        "problems": list(_problems(entry)),
        "commands": list(_commands(task_id, entry, runs)),
        "caption": _caption(entry["clip"], cls) if entry and entry["clip"] else "",
    }


def _status(entry: Mapping[str, Any] | None) -> dict[str, str]:
    if entry is None:
        return {"kind": "open", "text": "not swept"}
    if entry["error"]:
        return {"kind": "bad", "text": "failed"}
    if not entry["equal"]:
        return {"kind": "bad", "text": "differs"}
    if is_verified(entry):
        return {"kind": "good", "text": "equal, both succeed"}
    return {"kind": "open", "text": "equal, no verified clip"}


def _no_clip(entry: Mapping[str, Any] | None) -> str:
    if entry is None:
        return "not swept"
    return entry["no_clip"] or entry["error"] or "the sweep did not come that far"


def _sentence(words: str) -> str:
    return f"{words[0].upper()}{words[1:].rstrip('.')}."


def _problems(entry: Mapping[str, Any] | None) -> Iterator[str]:
    if entry is None:
        return
    if entry["error"]:
        yield f"The sweep of this task failed: {entry['error']}"
    for difference in (entry["agreement"] or {}).get("differing", ()):
        yield f"Seed {difference['seed']} differs {difference['where']}."
    rollout = entry["rollout"]
    if rollout and rollout["max_difference"] != 0:
        yield f"Arrays of the rollout differ by up to {number_text(rollout['max_difference'])}."


def _caption(clip: Mapping[str, Any], cls: type[MultiRobotTask]) -> str:
    sides = [
        f"{name} {'succeeds' if clip[key] else 'does not succeed'}"
        for name, key in (("native", "native_success"), ("the clone", "our_success"))
    ]
    differing, frames = clip["differing_frames"], clip["frames"]
    pixels = (
        f"all {frames} frames equal in every pixel"
        if differing == 0
        else f"{differing} of {frames} frames differ, mean pixel difference"
        f" {clip['mean_pixel_difference']:.2g} of 255"
    )
    state, steps = number_text(clip["max_state_difference"]), clip["steps"]
    own = cls.max_episode_steps
    beyond = f" (the task allows {own})" if steps > own else ""
    return (
        f"Seed {clip['seed']}, {steps} steps{beyond} of {clip['source']}: {' and '.join(sides)};"
        f" {pixels}; max |Δ| of the state {state}."
    )


def _commands(task_id: str, entry: Mapping[str, Any] | None, runs: Path) -> Iterator[str]:
    yield f"python -m parity compare --task {task_id} --seeds 10 --steps 100"
    rollout = entry["rollout"] if entry else None
    if rollout is None or rollout["source"] == "random":
        yield f"python -m parity sweep --tasks {task_id} --out {shlex.quote(str(runs))}"
        return
    demo = "" if rollout["source"] == "expert" else f" --demo {shlex.quote(rollout['source'])}"
    if demo:
        yield f"python -m parity replay --task {task_id}{demo}"
    options = f"--task {task_id}{demo} --seed {rollout['seed']} --out {shlex.quote(str(runs))}"
    yield f"python -m parity rollout {options}"
    yield f"python -m parity render {options}"


def missing(swept: Mapping[str, Mapping[str, Any] | None]) -> Iterator[Group]:
    """Yield what is not there yet, kind by kind.

    Args:
        swept: Each task's entry in the sweep's summary, or None.
    """
    experts = list_experts()
    yield Group(
        "Tasks without a verified clip",
        grouped(
            (task, _why_not_verified(entry))
            for task, entry in swept.items()
            if not is_verified(entry)
        ),
        "None: in every task’s clip both sides succeed and every pixel is equal.",
    )
    yield Group(
        "Tasks without a scripted expert",
        grouped((task, "") for task in swept if task not in experts),
    )
    yield Group(
        "Failures and differences",
        grouped((task, problem) for task, entry in swept.items() for problem in _problems(entry)),
        "None in this sweep.",
    )


def grouped(found: Iterable[tuple[str, str]]) -> tuple[Item, ...]:
    """Put what is missing for the same reason together; takes pairs of name and reason."""
    by_reason: dict[str, list[str]] = {}
    for name, why in found:
        by_reason.setdefault(why, []).append(name)
    return tuple(Item(tuple(names), why) for why, names in by_reason.items())


def _why_not_verified(entry: Mapping[str, Any] | None) -> str:
    if entry is None or not entry["clip"]:
        return _no_clip(entry)
    clip = entry["clip"]
    said: list[str] = []
    if not clip["native_success"]:
        said.append("native does not succeed")
    if not clip["our_success"]:
        said.append("the clone does not succeed")
    if clip["differing_frames"]:
        said.append(f"{clip['differing_frames']} of {clip['frames']} frames differ")
    if clip["max_state_difference"]:
        said.append(f"the states differ by up to {number_text(clip['max_state_difference'])}")
    return "; ".join(said)


def _not_cloned() -> tuple[tuple[Item, ...] | None, str]:
    try:
        return grouped((task.task_id, task.reason) for task in missing_tasks()), ""
    except MissingPackageError:
        return None, f"They are known where mani_skill is installed: {INSTALL}"


def _with(found: Mapping[str, Any]) -> str:
    packages = ", ".join(f"{name} {version}" for name, version in found["versions"].items())
    return f"{packages} on {found['machine']}"


# -- how it is written ---------------------------------------------------------------------------


def _render(context: Mapping[str, Any], fitted: Mapping[str, embedding.Embedded]) -> str:
    try:
        import jinja2
    except ImportError:
        raise MissingPackageError("a page needs jinja2: pip install jinja2") from None
    folder = files("parity") / "templates"
    parts = {
        name: (folder / f"report.{suffix}").read_text(encoding="utf-8")
        for name, suffix in (("page", "html.jinja"), ("style", "css"), ("script", "js"))
    }
    environment = jinja2.Environment(
        autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined
    )
    shown = [{**task, "clip": _clip(task, fitted.get(task["id"]))} for task in context["tasks"]]
    return environment.from_string(parts["page"]).render(
        {
            **context,
            "tasks": shown,
            "style": parts["style"],
            "script": parts["script"],
            "policy": _policy(parts["style"], parts["script"]),
        }
    )


def _clip(task: Mapping[str, Any], clip: embedding.Embedded | None) -> dict[str, Any] | None:
    if clip is None:
        return None
    label = f"{task['id']}: native ManiSkill, the clone and their difference, side by side"
    return {
        "label": label,
        "caption": task["caption"],
        "source": _data_address("video/mp4", clip.video),
        "poster": _data_address("image/jpeg", clip.poster),
        "width": clip.width,
        "height": clip.height,
    }


def _data_address(kind: str, content: bytes) -> str:
    return f"data:{kind};base64,{base64.b64encode(content).decode()}"


def _policy(style: str, script: str) -> str:
    """Return a policy under which a browser loads nothing but what the page itself carries."""
    allowed = {
        name: base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
        for name, text in (("style-src", style), ("script-src", script))
    }
    own = "; ".join(f"{name} 'sha256-{digest}'" for name, digest in allowed.items())
    return f"default-src 'none'; img-src data:; media-src data: blob:; {own}; form-action 'none'"


def _write(path: Path, page: str) -> None:
    partial = path.with_name(f"{path.name}.{os.getpid()}.partial")
    try:
        path.absolute().parent.mkdir(parents=True, exist_ok=True)
        partial.write_text(page, encoding="utf-8")
        os.replace(partial, path)
    except OSError as error:
        raise RecordingError(f"cannot write {path}: {error}") from error
    finally:
        partial.unlink(missing_ok=True)

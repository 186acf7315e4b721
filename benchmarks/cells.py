"""``python -m benchmarks cells``: what the experts of cells solve with other robots than their own.

All roles that admit a robot are filled with it; those that need fingers keep their own robot where
it has none. Every two of twelve makes also play cells that are drawn for them, in which they take
the roles in turn; some are played by mixtures that were chosen, and some by their own robots in
places that a search found.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import closing
from itertools import cycle, permutations, product
from pathlib import Path
from random import Random
from typing import Any

import torch
from tqdm import tqdm

from benchmarks.records import (
    DOCS,
    Record,
    patience,
    read_record,
    table,
    versions_of,
    write_page,
    write_record,
)
from benchmarks.skills import robot_of
from robot_layouts.data.elsewhere import stand_elsewhere
from robot_layouts.experts import find_expert
from robots import RobotLayoutsError
from tasks import Needs, get_task_class, list_tasks, make
from tasks.episode import play

ROBOTS = ("so101", "xarm7", "xarm7_with_panda", "z1", "fetch", "ur10")
# Every two of these, by reach, take the roles of some cells in turn.
PAIRED = "koch so100 so101 ur3 xarm7 xarm7_with_panda panda panda_stick z1 ur5 fetch ur10".split()
LONGER = 2  # times as many steps as with their own robots; small arms move slowly
PATIENCE = 150  # s that an expert may plan an episode
MIXED = (
    ("CellPressTogether-v1", ("ur10", "panda", "xarm7")),
    ("CellGatherBlocks-v1", ("ur10", "panda_stick", "panda", "xarm7")),
    ("CellPutAndClose-v1", ("panda_wristcam", "ur10")),
    ("CellPutAndClose-v1", ("fetch", "xarm7")),
    ("CellLiftBoard-v1", ("franka_panda", "panda_wristcam", "panda", "panda_wristcam")),
    ("CellLiftPot-v1", ("panda_wristcam", "franka_panda")),
    ("CellLiftPot-v1", ("fetch", "panda_wristcam")),
    ("CellPutAway-v1", ("franka_panda", "panda_wristcam")),
    ("CellSortCubes-v1", ("fetch", "panda_wristcam", "panda")),
    ("CellBuildBridge-v1", ("panda", "panda_wristcam", "fetch")),
)


def cells(
    *,
    robots: tuple[str, ...] = ROBOTS,
    tasks: tuple[str, ...] | None = None,
    seeds: int = 3,
    pairs: int = 0,
    elsewhere: int = 0,
    out: Path = DOCS / "cells_robots.json",
) -> int:
    """Let experts of cells play with other robots in all roles that admit them, and with mixtures.

    Args:
        robots: Of what makes, by their names in the catalogue, or as ARM_with_HAND; none leaves
            mixtures.
        tasks: Which cells; all of those that fit their robots if not given.
        seeds: How many episodes of each; those in the record are not played again.
        pairs: How many cells each pair of makes plays, taking their roles in turn.
        elsewhere: In how many layouts of a search each cell is also played by its own robots.
        out: The record, written after every episode; the page is beside it.

    Raises:
        RobotLayoutsError: If something cannot be read or written.
    """
    torch.set_num_threads(1)
    record = read_record(out, versions={}, cells={}, pairs={}, mixed={}, elsewhere={})
    fitting = [task for task in cells_of_the_library() if get_task_class(task).fits()]
    chosen = fitting if tasks is None else tasks
    for task, label, named, kept in tqdm([*_cases(chosen, robots, pairs, elsewhere)], disable=None):
        seen = (
            record[kept].setdefault(task, {}).setdefault(label, {"robots": named, "episodes": {}})
        )
        for _ in _played(task, label, seen, seeds):
            record["versions"] |= versions_of("sapien", "ompl", "python-fcl")
            write_record(out, record)
    shown = [*dict.fromkeys(robot for of in record["cells"].values() for robot in of)]
    rows = [_row(task, of, shown) for task, of in sorted(record["cells"].items())]
    mixed = [
        (task, label, _of(seen))
        for task, of in sorted(record["mixed"].items())
        for label, seen in of.items()
    ]
    failures = [
        line
        for kept in ("cells", "pairs", "mixed", "elsewhere")
        for task, of in sorted(record[kept].items())
        for line in _failures(task, of)
    ]
    write_page(
        out,
        "cells_robots",
        versions=record["versions"],
        solved=table(("cell", *shown), [*rows, _total(record["cells"], shown)]),
        pairs=_matrix(record["pairs"]),
        mixed=mixed,
        elsewhere=[
            (task, *(_of(seen) if "scale" in seen else "none found" for seen in of.values()))
            for task, of in sorted(record["elsewhere"].items())
        ],
        failures=failures,
    )
    return 0


def cells_of_the_library() -> list[str]:
    """Return all cells but those that a program has added."""
    modules = {task: get_task_class(task).__module__ for task in list_tasks()}
    return [task for task, module in modules.items() if module.startswith("tasks.cells")]


def _cases(
    tasks: Sequence[str], robots: Sequence[str], pairs: int, elsewhere: int
) -> Iterator[tuple[str, str, dict[str, str], str]]:
    """Yield what is played: the task, what its robots are called together, which, and the table."""
    for robot, task in product(robots, tasks):
        if roles := _roles(task, robot):
            yield task, robot, dict.fromkeys(roles, robot), "cells"
    for two in permutations(PAIRED, 2) if pairs else ():
        label, admit = ", ".join(two), [task for task in tasks if _all_roles(task, *two)]
        for task in Random(label).sample(admit, min(pairs, len(admit))):
            yield task, label, dict(zip(get_task_class(task).layout, cycle(two))), "pairs"
    for task, named in MIXED:
        if task in tasks:
            yield (
                task,
                ", ".join(named),
                dict(zip(get_task_class(task).layout, named, strict=True)),
                "mixed",
            )
    for task, seed in product(tasks, range(elsewhere)):
        yield task, f"places {seed}", {}, "elsewhere"


def _roles(task: str, robot: str) -> list[str]:
    """Return the places of a task that a robot can fill."""
    cls, fingers = get_task_class(task), robot_of(robot).fingers is not None
    anyone = cls.needs.get("*", Needs())
    return [role for role in cls.layout if fingers or not cls.needs.get(role, anyone).fingers]


def _all_roles(task: str, *robots: str) -> bool:
    """Return whether each of these robots can fill any place of a task."""
    return all(len(_roles(task, robot)) == len(get_task_class(task).layout) for robot in robots)


def _making(task: str, label: str, robots: Mapping[str, str]) -> dict[str, Any]:
    """Return the robots of a case, or where its own stand."""
    if robots:
        named = {role: robot_of(name) for role, name in robots.items()}
        return {
            "robots": named,
            "max_episode_steps": LONGER * get_task_class(task).max_episode_steps,
        }
    return {"layout": stand_elsewhere(task, seed=int(label.split()[1]))}


def _played(task: str, label: str, seen: Record, seeds: int) -> Iterator[None]:
    """Play the seeds that are missing, and yield after each of them."""
    missing = [str(seed) for seed in range(seeds) if str(seed) not in seen["episodes"]]
    if not missing:
        return
    try:
        env = make(task, obs_mode="none", **_making(task, label, seen["robots"]))
    except RobotLayoutsError as error:
        seen["episodes"] |= dict.fromkeys(missing, _first_line(error))
        yield
        return
    with closing(env):
        seen["scale"] = round(env.task.fit.scale, 2)
        for seed in missing:
            try:
                with patience(PATIENCE):
                    plan = find_expert(task)(env, int(seed))
                solved = play(env, int(seed), plan).solved
                seen["episodes"][seed] = (
                    "" if solved else getattr(plan, "reason", "") or "not solved"
                )
            except RobotLayoutsError as error:
                seen["episodes"][seed] = _first_line(error).removeprefix("no plan: ")
            yield


def _first_line(error: RobotLayoutsError) -> str:
    return str(error).partition("\n")[0].rstrip(":")


def _row(task: str, of: Mapping[str, Record], robots: Sequence[str]) -> Iterator[str]:
    yield task
    for robot in robots:
        yield _of(of[robot]) if robot in of else "–"


def _of(seen: Record) -> str:
    return _share(seen["episodes"].values())


def _total(record: Mapping[str, Mapping[str, Record]], robots: Sequence[str]) -> Iterator[str]:
    yield "all"
    for robot in robots:
        tried = [of[robot]["episodes"].values() for of in record.values() if robot in of]
        yield _share([reason for reasons in tried for reason in reasons])


def _matrix(record: Mapping[str, Mapping[str, Record]]) -> str:
    """Return a table of what pairs of makes solve, by the first and the second of each."""
    found: dict[str, list[str]] = {}
    for of in record.values():
        for label, seen in of.items():
            found.setdefault(label, []).extend(seen["episodes"].values())
    rows = [
        (one, *(_share(found.get(f"{one}, {other}", ())) for other in PAIRED)) for one in PAIRED
    ]
    total = [reason for reasons in found.values() for reason in reasons]
    return table(("", *PAIRED), [*rows, (f"all: {_share(total)}", *[""] * len(PAIRED))])


def _share(reasons: Collection[str]) -> str:
    return f"{_solved(reasons)} of {len(reasons)}" if reasons else "–"


def _solved(reasons: Collection[str]) -> int:
    return sum(not reason for reason in reasons)


def _failures(task: str, of: Mapping[str, Record]) -> Iterator[str]:
    for robot, seen in of.items():
        reasons = Counter(reason for reason in seen["episodes"].values() if reason)
        yield from (f"{task}, {robot}: {count} × {reason}" for reason, count in reasons.items())

"""``python -m benchmarks experts``: how often experts of several robots succeed, and touch.

Each task is played in its own layout, and in others: those that `layouts.search` returns for what
its arms must reach, and for Relay rings of any number of robots. Every plan is played in a fresh
environment, in which each step of physics is looked at for arms that touch.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import cache
from itertools import chain, cycle, product
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
import torch
from tqdm import tqdm

from benchmarks.records import (
    DOCS,
    Record,
    patience,
    read_record,
    versions_of,
    write_page,
    write_record,
)
from benchmarks.skills import robot_of
from layouts import Layout, face_to_face, ring, search
from layouts.frames import Frame
from robot_layouts.experts import find_expert, first_success
from robot_layouts.experts.originals import two_robot_lift_bar as lifting
from robot_layouts.experts.rehearsal import Plan
from robot_layouts.experts.script import Scene, Script
from robot_layouts.experts.touching import ArmWatch
from robots import LayoutError, RobotLayoutsError, TaskError
from tasks import TaskEnv, get_task_class, make, register_task
from tasks.episode import play

Area = tuple[tuple[float, float], tuple[float, float], tuple[float, float]]  # x, y, z (m)

DOWN = (0.0, 1.0, 0.0, 0.0)  # a gripper that points straight down, wxyz
GRIPPERS = ("panda", "panda_wristcam", "franka_panda", "panda")  # in turn, place by place
STICKS = ("panda_stick", "panda")
RELAY = ("panda", "panda_stick", "panda_wristcam", "franka_panda")


@dataclass(frozen=True)
class Cell:
    """What a task asks of a layout.

    Attributes:
        reached: For each place, the boxes whose corners it must reach with the gripper pointing
            straight down.
        around: Where bases may stand; see `layouts.search`.
        robots: For each place the robots that stand there in turn.
    """

    reached: Mapping[str, Sequence[Area]]
    around: Mapping[str, Frame] | tuple[float, float, float, float]
    robots: Mapping[str, Sequence[str]]


def _beside(x: float, low: float, high: float, z: tuple[float, float] = (0.03, 0.1)) -> Area:
    """Return the box at both sides of x = 0, from one y to another."""
    return (-x, x), (low, high), z


def _above(low: float, high: float) -> Area:
    """Return the line over the origin from one height to another."""
    return _beside(0.0, 0.0, 0.0, (low, high))


CELLS = {
    "TwoRobotPickCube-v1": Cell(
        {
            "left": [_beside(0.05, -0.2, -0.1), _above(0.22, 0.22)],
            "right": [_beside(0.05, 0.1, 0.2, (0.1, 0.3)), _above(0.22, 0.22)],
        },
        (-0.3, -0.4, 0.3, 0.4),
        {"left": GRIPPERS, "right": GRIPPERS[1:]},
    ),
    "TwoRobotStackCube-v1": Cell(
        {
            "left": [_beside(0.05, -0.2, -0.1, (0.03, 0.15))],
            "right": [_beside(0.05, 0.1, 0.2), _beside(0.05, -0.1, -0.1)],
        },
        (-0.3, -0.4, 0.3, 0.4),
        {"left": GRIPPERS, "right": GRIPPERS[1:]},
    ),
    "TwoRobotLiftBar-v1": Cell(
        {
            "left": [_beside(0.13, -0.28, -0.2, (0.03, 0.25))],
            "right": [_beside(0.13, 0.2, 0.28, (0.03, 0.25))],
        },
        (-0.3, -0.45, 0.3, 0.45),
        {"left": GRIPPERS, "right": GRIPPERS[1:]},
    ),
    "TwoRobotPushPick-v1": Cell(
        {
            "pusher": [_beside(0.1, -0.33, 0.0, (0.03, 0.13))],
            "picker": [_beside(0.1, -0.03, 0.1), _beside(0.1, 0.15, 0.25, (0.1, 0.3))],
        },
        (-0.3, -0.5, 0.3, 0.5),
        {"pusher": STICKS, "picker": GRIPPERS},
    ),
    "FourRobotStack-v1": Cell(
        {
            "south": [_beside(0.08, -0.33, -0.25), _above(0.03, 0.1)],
            "east": [((0.25, 0.33), (-0.08, 0.08), (0.03, 0.1)), _above(0.07, 0.14)],
            "north": [_beside(0.08, 0.25, 0.33), _above(0.11, 0.18)],
            "west": [((-0.33, -0.25), (-0.08, 0.08), (0.03, 0.1)), _above(0.15, 0.22)],
        },
        (-0.5, -0.5, 0.5, 0.5),
        {"south": GRIPPERS, "east": GRIPPERS[1:], "north": GRIPPERS[2:], "west": GRIPPERS},
    ),
}
TASKS = (*CELLS, "Relay-v1")

HANDS = (
    *("panda", "so100", "so101", "z1", "fetch"),
    *("xarm7_with_panda", "ur3_with_panda", "ur5_with_panda", "ur10_with_panda"),
)
PAIRS = tuple(dict.fromkeys(pair for hand in HANDS for pair in ((hand, hand), ("panda", hand))))
BODIES = ("baxter", "mobile_panda_dual", "pr2", "tiago_pro", "unitree_g1_with_hands")
BAR = "TwoRobotLiftBar-v1"
PAIRED = ("TwoRobotHandOver-v1", BAR, "Relay-v1")  # what pairs of robots do
FITTING = "LiftBarThatFits-v1"  # the bar, as large as a pair holds and reaches
BAR_STEPS = 300  # small arms move by 0.3 rad per second
# At what share of their speed, and how, a pair raises the bar that slips at full speed: long arms
# with quick drives in few parts, arms of five joints in many.
SLOWER = (
    (0.15, lifting.Style(ready=0.02)),
    (0.5, lifting.Style(legs=16, near=0.02, ready=0.02)),
)
PATIENCE = 120  # s that an expert may plan an episode
NEARER = 0.75  # of a reach: with grippers down, arms of a ring get less far


def experts(
    *,
    tasks: tuple[str, ...] = TASKS,
    seeds: int = 100,
    layouts: int = 10,
    layout_seeds: int = 10,
    paired: tuple[str, ...] = PAIRED,
    pair_seeds: int = 5,
    out: Path = DOCS / "experts.json",
) -> int:
    """Let experts of tasks for several robots play in their own layouts and in others.

    Args:
        tasks: Task ids.
        seeds: In its own layout; those in the record are not played again.
        layouts: Other layouts.
        layout_seeds: In each of them.
        paired: Tasks that pairs of robots do.
        pair_seeds: Of each of them, by each pair.
        out: The record, written after every episode; the page is beside it.

    Raises:
        RobotLayoutsError: If something cannot be made, read or written.
    """
    torch.set_num_threads(1)
    record = read_record(out, versions={}, tasks={}, pairs={})
    by_pairs = len(paired) * len((*PAIRS, *BODIES)) * pair_seeds
    total = len(tasks) * (seeds + layouts * layout_seeds) + by_pairs
    with tqdm(total=total, disable=None) as bar:
        for _ in chain(
            _played(record, tasks, seeds, layouts, layout_seeds),
            *(_paired(task_id, record["pairs"], pair_seeds) for task_id in paired),
        ):
            record["versions"] |= versions_of("sapien", "ompl", "python-fcl")
            write_record(out, record)
            bar.update()
    shown = sorted(record["tasks"].items())
    rows = [row for task_id, seen in shown for row in _rows(task_id, seen)]
    failures = [line for task_id, seen in shown for line in _failures(task_id, seen)]
    failures += [
        line
        for task_id in PAIRED
        for pair, seen in record["pairs"].get(task_id, {}).items()
        for line in _lacking(task_id, pair, seen)
    ]
    write_page(
        out,
        "experts",
        versions=record["versions"],
        rows=rows,
        pairs=_pairs(record["pairs"]),
        failures=failures,
    )
    return 0


def _played(
    record: Record, task_ids: Iterable[str], seeds: int, layouts: int, layout_seeds: int
) -> Iterator[None]:
    """Play what the record lacks, and yield after every episode."""
    for task_id in task_ids:
        seen = record["tasks"].setdefault(task_id, {"own": {}, "others": {}})
        yield from _play(make(task_id, obs_mode="none"), seen["own"], seeds)
        for number in range(layouts):
            others = seen["others"]
            if str(number) not in others:
                try:
                    layout = other_layout(task_id, number).to_yaml()
                    others[str(number)] = {"layout": layout, "episodes": {}}
                except LayoutError as error:
                    others[str(number)] = {"error": str(error)}
            if "layout" in (other := others[str(number)]):
                task = make(task_id, layout=Layout.from_yaml(other["layout"]), obs_mode="none")
                yield from _play(task, other["episodes"], layout_seeds)


def _paired(task_id: str, record: Record, seeds: int) -> Iterator[None]:
    """Play what the record of pairs lacks of a task, and yield after every episode."""
    pairs = record.setdefault(task_id, {})
    for names in (*PAIRS, *BODIES):
        if isinstance(names, str) and task_id == "Relay-v1":  # no ring of three
            continue
        seen = pairs.setdefault(_label(names), {"episodes": {}})
        if len(seen["episodes"]) >= seeds or "error" in seen:
            continue
        try:
            task = standing(task_id, names)
        except RobotLayoutsError as error:
            seen["error"] = str(error).partition("\n")[0].rstrip(":")
            yield
        else:
            yield from _play(task, seen["episodes"], seeds)


def _label(names: str | tuple[str, str]) -> str:
    return names if isinstance(names, str) else ", ".join(names)


def standing(task_id: str, names: str | tuple[str, str]) -> TaskEnv:
    """Return a task of two robots, or of the arms of one.

    Hand-overs are face to face at the preset's distance, a bar is lifted where the task's own
    robots stand, as much nearer or farther as the pair reaches, and three take turns in a ring.
    """
    if task_id == BAR:
        task_id = _bar()
    if isinstance(names, str):
        return make(task_id, robots=names, obs_mode="none")
    robots = dict(zip(get_task_class(task_id).layout, map(robot_of, cycle(names)), strict=False))
    if task_id == FITTING:
        return make(task_id, robots=robots, obs_mode="none")
    if task_id == "Relay-v1":
        near = {place: replace(r, reach=NEARER * r.reach) for place, r in robots.items()}
        layout = ring(near).replace_robots(**robots)
    else:
        layout = face_to_face(robots)
    return make(task_id, layout=layout, obs_mode="none")


@cache
def _bar() -> str:
    """Return the id of a task in which the bar, and the places it lies at, fit the robots."""
    fields = {"__module__": __name__, "fits_robots": True, "max_episode_steps": BAR_STEPS}
    register_task(FITTING)(type("LiftBarThatFits", (get_task_class(BAR),), fields))
    return FITTING


def lift_bar(task: TaskEnv, seed: int) -> Plan:
    """Return the actions of the bar's expert, in the lengths in which the bar is declared."""
    # Private, as the file stays as it is: a published receipt names its SHA-256.
    script = lifting._script  # pyright: ignore[reportPrivateUsage]

    def scripts(scene: Scene) -> list[Script]:
        slower = (slowed(script(style, scene), pace) for pace, style in SLOWER)
        return [*(script(style, scene) for style in lifting.STYLES), *slower]

    return first_success(task, seed, scripts, as_declared=True)


def slowed(script: Script, pace: float) -> Script:
    """Return a script in which arms raise what they hold at a share of their greatest speed."""
    return {
        robot: tuple(
            replace(waypoint, pace=pace) if waypoint.name.startswith("raise") else waypoint
            for waypoint in waypoints
        )
        for robot, waypoints in script.items()
    }


def _play(task: TaskEnv, episodes: Record, seeds: int) -> Iterator[None]:
    expert = lift_bar if task.task_id == FITTING else find_expert(task.task_id)
    arms = ArmWatch(task)
    with closing(task):
        for seed in range(seeds):
            if str(seed) not in episodes:
                episodes[str(seed)] = _episode(task, seed, expert, arms)
                yield


def _episode(task: TaskEnv, seed: int, expert: Any, arms: ArmWatch) -> Record:
    """Return whether an expert's plan succeeds, its steps, and which arms touched."""
    try:
        with patience(PATIENCE):
            plan = expert(task, seed)
    except TaskError as error:
        return {"success": False, "steps": 0, "touching": [], "reason": str(error)}
    touching: dict[str, None] = {}

    def watch() -> None:
        touching.update(dict.fromkeys(f"{a}, {b}" for a, b in arms.touching()))

    played = play(task, seed, plan, watch)
    return {
        "success": played.solved,
        "steps": len(plan),
        "touching": list(touching),
        "reason": getattr(plan, "reason", ""),
    }


def other_layout(task_id: str, number: int) -> Layout:
    """Return one of the layouts that a task is tried in, besides its own; the same every time.

    For Relay it is a ring of any valid number of robots, else what `layouts.search` returns.

    Args:
        task_id: One of `TASKS`.
        number: Which one.

    Raises:
        LayoutError: If the search finds none.
        TaskError: If nothing is known of the task.
    """
    if task_id == "Relay-v1":
        return _ring(number)
    if task_id not in CELLS:
        raise TaskError(f"nothing is known of {task_id}; tasks: {', '.join(TASKS)}")
    cell = CELLS[task_id]
    robots = {place: choices[number % len(choices)] for place, choices in cell.robots.items()}
    targets = {
        f"{place} {i}": (*point, *DOWN)
        for place, areas in cell.reached.items()
        for i, point in enumerate(p for area in areas for p in dict.fromkeys(product(*area)))
    }
    edge_x, edge_y = np.random.default_rng(number).uniform(0.7, 1.1, 2).tolist()
    return search(
        {place: robots[place] for place in get_task_class(task_id).layout},
        targets,
        around=cell.around,
        within=(-edge_x, -edge_y, edge_x, edge_y),
        reached_by={name: name.split()[0] for name in targets},
        seed=number,
        tries=1,
    )


def _ring(number: int) -> Layout:
    """Return a ring of three to six robots, of any radius at which they can pass on."""
    random = np.random.default_rng(number)
    while True:
        names = [f"robot_{i + 1}" for i in range(3 + number % 4)]
        robots = {name: RELAY[int(random.integers(len(RELAY)))] for name in names}
        layout = ring(robots, radius=float(random.uniform(0.55, 1.1)))
        try:
            make("Relay-v1", layout=layout, obs_mode="none").close()
        except (LayoutError, TaskError):
            continue
        return layout


def _rows(task_id: str, seen: Record) -> Iterator[list[str]]:
    others = [other["episodes"] for other in seen["others"].values() if "layout" in other]
    every = [episode for episodes in others for episode in episodes.values()]
    yield [task_id, "its own", *_row([*seen["own"].values()])]
    yield [task_id, f"{len(others)} other{'s' * (len(others) != 1)}", *_row(every)]


def _row(episodes: Sequence[Record]) -> list[str]:
    solved = [episode for episode in episodes if episode["success"]]
    return [
        str(len(episodes)),
        f"{len(solved)} ({100 * len(solved) / len(episodes):.0f} %)" if episodes else "–",
        str(sum(bool(episode["touching"]) for episode in episodes)),
        f"{median(episode['steps'] for episode in solved):.0f}" if solved else "–",
    ]


def _pairs(record: Record) -> list[list[str]]:
    """Return a row for each pair of robots: what it solves of each task, and in how many steps."""
    rows: list[list[str]] = []
    for label in map(_label, (*PAIRS, *BODIES)):
        row = [label]
        touching = 0
        for task_id in PAIRED:
            seen = record.get(task_id, {}).get(label, {"episodes": {}})
            episodes = [*seen["episodes"].values()]
            solved = [episode["steps"] for episode in episodes if episode["success"]]
            touching += sum(bool(episode["touching"]) for episode in episodes)
            share = f"{len(solved)} of {len(episodes)}" if episodes else "–"
            row += [share, f"{median(solved):.0f}" if solved else "–"]
        rows.append([*row, str(touching)])
    return rows


def _lacking(task_id: str, pair: str, seen: Record) -> Iterator[str]:
    """Yield why a pair does not solve a task."""
    reasons = Counter(e["reason"] for e in seen["episodes"].values() if not e["success"])
    yield from (f"- {task_id} by {pair}: {n} × {why}" for why, n in reasons.items())
    if "error" in seen:
        yield f"- {task_id} by {pair}: {seen['error']}"


def _failures(task_id: str, seen: Record) -> Iterator[str]:
    """Yield why episodes fail, by layout, and why there is no layout."""
    where = {"its own layout": seen["own"]} | {
        f"layout {int(number) + 1}": other["episodes"]
        for number, other in seen["others"].items()
        if "layout" in other
    }
    for layout, episodes in where.items():
        reasons = Counter(e["reason"] for e in episodes.values() if not e["success"])
        yield from (f"- {task_id}, {layout}: {n} × {why}" for why, n in reasons.items())
    for number, other in seen["others"].items():
        if "error" in other:
            yield f"- {task_id}: no layout {int(number) + 1}: {other['error']}"

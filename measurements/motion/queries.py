"""``python -m measurements.motion queries``: random questions to the planner, and its answers.

Cells are random valid layouts of mixed arms; in each, random free postures are start and goal of
all arms, every fourth goal as TCP poses. A line of JSON is kept per query, so that a run goes on
where it stopped; the table is beside it as markdown.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from kinematics.rotations import Floats, quaternion_of
from measurements.motion.cells import FLOOR, random_cell, random_postures
from measurements.robots.record import versions_of
from motion import Motion, NoPlanError, TcpGoal, plan
from motion.cell import Cell
from motion.goals import Goal, arm_joints
from motion.search import import_ompl
from motion.timing import import_toppra
from robots import RobotLayoutsError
from robots.common.writing import write_whole
from robots.urdf.tcp import find_tcp

RECORD = Path("runs/motion_queries.jsonl")
CLEARANCE = 0.01  # m
PATIENCE = {2: 5.0, 3: 5.0, 4: 5.0}  # s of processor time within which a plan counts as solved
LONGEST = 30.0  # s, the same for more arms
ALONE = "even if the other robots that move were not there"  # in the planner's message
WAIT = 120.0  # s; wall time after which a query is given up, whatever else the machine does

Seen = dict[str, Any]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    add = parser.add_argument
    add("--cells", type=int, default=200, metavar="N", help="random layouts (%(default)s)")
    add("--queries", type=int, default=50, metavar="M", help="of each (%(default)s)")
    add("--arms", default="2-8", metavar="A-B", help="how many, from-to (%(default)s)")
    add("--workers", type=int, default=1, metavar="N", help="processes at a time (%(default)s)")
    add("--seed", type=int, default=0, metavar="S", help="of everything random (%(default)s)")
    add("--no-certify", action="store_true", help="leave the dense recheck out")
    add("--out", type=Path, default=RECORD, metavar="FILE", help="the record (%(default)s)")
    add("--page", type=Path, metavar="FILE", help="write a page, such as docs/planning.md, too")


def run(options: argparse.Namespace) -> int:
    """Ask what the record does not hold yet, and write its table."""
    first, _, last = options.arms.partition("-")
    counts = range(int(first), int(last or first) + 1)
    known = {(seen["cell"], seen["query"]) for seen in read(options.out)}
    wanted = [
        (cell, counts[cell % len(counts)], query, options.seed, not options.no_certify)
        for cell in range(options.cells)
        for query in range(options.queries)
        if (cell, query) not in known
    ]
    options.out.parent.mkdir(parents=True, exist_ok=True)
    with open(options.out, "a", encoding="utf-8") as record:
        for seen in _asked(wanted, options.workers):
            record.write(json.dumps(seen) + "\n")
            record.flush()
    table = options.out.with_suffix(".md")
    write_whole(table, "\n".join(markdown(read(options.out))) + "\n")
    print(table.read_text(encoding="utf-8"))
    if options.page is not None:
        shown = summary(read(options.out))
        write_whole(options.page.with_suffix(".json"), json.dumps(shown, indent=1) + "\n")
        write_whole(options.page, "\n".join(page(shown)) + "\n")
    return 0


def summary(record: Sequence[Seen]) -> dict[str, Any]:
    """Return what a page shows of a record: with what it was made, and the rows of its table."""
    return {
        "versions": versions_of("ompl", "toppra", "python-fcl", "numpy"),
        "cells": len({seen["cell"] for seen in record}),
        "queries": len(record),
        "table": list(markdown(record)),
    }


def page(shown: Mapping[str, Any]) -> Iterator[str]:
    """Yield the lines of the page."""
    versions = ", ".join(f"{name} {version}" for name, version in shown["versions"].items())
    yield "# Planning, measured"
    yield ""
    yield f"{shown['queries']} queries to `motion.plan` in {shown['cells']} random valid cells of"
    yield "mixed arms over a floor: from one random posture of all arms, free of collisions, to"
    yield "another, every fourth as TCP poses. `python -m measurements.motion queries --page` wrote"
    yield "this page. Times are processor time of one core, of whole plans. *In time* is within 5 s"
    yield "for up to four arms and 30 s for more; *certified* by `Motion.certify`, every millimetre"
    yield "and half degree. A goal that is said to be out of reach or in collision is a miss, too."
    yield f"Made with {versions}."
    yield ""
    yield from shown["table"]


def read(path: Path) -> list[Seen]:
    """Return the lines of a record; none if there is no file."""
    if not path.exists():
        return []
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]


def _asked(wanted: Sequence[tuple[int, int, int, int, bool]], workers: int) -> Iterator[Seen]:
    if workers < 2:
        yield from map(ask, wanted)
        return
    with multiprocessing.get_context("spawn").Pool(workers) as pool:
        yield from pool.imap_unordered(ask, wanted, chunksize=5)


_last: dict[tuple[int, int, int], Cell] = {}


def ask(query: tuple[int, int, int, int, bool]) -> Seen:
    """Ask one question: cell, arms, query, seed, and whether to certify the answer."""
    number, arms, which, seed, certify = query
    import_ompl()
    import_toppra()
    key = seed + number, arms, 0
    if key not in _last:
        _last.clear()
        _last[key] = Cell(random_cell(seed + number, arms), table=FLOOR)
    cell = _last[key]
    postures = random_postures(cell, (seed, number, which), CLEARANCE)
    start, end = next(postures), next(postures)
    seen: Seen = {
        "cell": number,
        "query": which,
        "arms": arms,
        "robots": [p.robot.name for p in cell.layout.values()],
        "goal": "tcp" if which % 4 == 3 else "joints",
    }
    began, wall = time.process_time(), time.monotonic()
    try:
        motion = plan(
            cell.layout,
            start,
            goals(cell, end, tcp=which % 4 == 3),
            table=FLOOR,
            clearance=CLEARANCE,
            seed=which,
            patience=WAIT,
            control_mode="pd_joint_pos",
        )
    except NoPlanError as error:
        seen |= {"solved": False, "reason": error.reason, "message": str(error)}
        motion = None
    except RobotLayoutsError as error:
        seen |= {"solved": False, "reason": type(error).__name__, "message": str(error)}
        motion = None
    seen |= {
        "seconds": round(time.process_time() - began, 4),
        "wall": round(time.monotonic() - wall, 4),
    }
    return seen | (_answer(motion, certify) if motion is not None else {})


def _answer(motion: Motion, certify: bool) -> Seen:
    answer: Seen = {"solved": True, "duration": round(motion.duration, 3)}
    if certify:
        certificate = motion.certify()
        near = certificate.clearance
        answer |= {
            "certified": certificate.ok,
            "collisions": len(certificate.collisions),
            "moments": certificate.moments,
            "clearance": None if near is None else round(near.distance, 5),
        }
        if not certificate.ok:
            answer["certificate"] = str(certificate)
    return answer


def goals(cell: Cell, end: Floats, *, tcp: bool) -> dict[str, Goal]:
    """Return the goals of all arms that a posture, (D,), stands for."""
    found: dict[str, Goal] = {}
    poses = cell.poses(end[None]) if tcp else None
    for name, placement in cell.layout.items():
        robot, own = placement.robot, end[cell.slices[name]]
        if poses is None:
            found[name] = [float(own[robot.joints.index(joint)]) for joint in arm_joints(robot)]
            continue
        tree = cell.models[name].kinematics
        point = find_tcp(robot, tree)
        first = cell.links.index((name, tree.links[0]))
        links = poses[:, first : first + len(tree.links)]
        found[name] = TcpGoal(
            point.places(links)[0].tolist(), quaternion_of(links[0, point.turned, :3, :3]).tolist()
        )
    return found


def markdown(record: Sequence[Seen]) -> Iterator[str]:
    """Yield the lines of the table: a row per number of arms."""
    yield (
        "| arms | queries | solved | in time | median s | 90 % s | 99 % s | slowest s | certified"
        " | collisions | least clearance mm | an arm finds no way even alone"
        " | wrongly said to be infeasible |"
    )
    yield "|" + " ---: |" * 13
    for arms in sorted({seen["arms"] for seen in record}):
        yield _row(arms, [seen for seen in record if seen["arms"] == arms])


def _row(arms: int, seen: Sequence[Seen]) -> str:
    known = ("goal in collision", "start in collision", "unreachable")
    solved = [s for s in seen if s["solved"]]
    wrong = [s for s in seen if s.get("reason") in known]  # goals are those of free postures
    seconds = np.array([s["seconds"] for s in seen])
    in_time = sum(s["seconds"] <= PATIENCE.get(arms, LONGEST) for s in solved)
    checked = [s for s in solved if "certified" in s]
    clearances = [s["clearance"] for s in checked if s["clearance"] is not None]
    numbers = [
        arms,
        len(seen),
        _share(len(solved), len(seen)),
        _share(in_time, len(seen)),
        *(f"{np.quantile(seconds, q):.2f}" for q in (0.5, 0.9, 0.99, 1.0)),
        _share(sum(s["certified"] for s in checked), len(checked)),
        sum(s["collisions"] for s in checked),
        f"{1e3 * min(clearances):.1f}" if clearances else "",
        sum(ALONE in s.get("message", "") for s in seen),
        len(wrong),
    ]
    return "| " + " | ".join(map(str, numbers)) + " |"


def _share(part: int, whole: int) -> str:
    return f"{part / whole:.1%}" if whole else ""

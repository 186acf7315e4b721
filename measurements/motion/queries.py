"""``python -m measurements.motion queries``: random questions to the planner, and its answers.

Cells are random valid layouts of mixed arms, of the catalogue and from URDFs of installed packages.
In each, random free postures are start and goal of all arms, every fourth goal as TCP poses; two
more questions have no answer. What is planned is certified, and carried out in SAPIEN. A line of
JSON is kept per query, so that a run goes on where it stopped; the table is beside it as markdown.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import time
from collections.abc import Iterator, Sequence
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

from kinematics.rotations import Floats
from measurements.motion.answers import (
    CATALOGUE,
    CLEARANCE,
    IN_COLLISION,
    INFEASIBLE,
    OUT_OF_REACH,
    Seen,
    markdown,
    page,
    summary,
)
from measurements.motion.arms import arms_of
from measurements.motion.cells import FLOOR, RandomPostures, random_cell
from measurements.motion.execution import Stage
from measurements.motion.random_goals import goals_at, in_collision, out_of_reach
from measurements.robots.sources import PACKAGES
from motion import Motion, NoPlanError, plan
from motion.collision.cell import Cell
from motion.planning.goals import Goal
from motion.planning.rrt_connect import import_ompl
from motion.timing.velocities import import_toppra
from robots import RobotLayoutsError
from robots.common.writing import write_whole
from rollouts.progress import LiveLine

RECORD = Path("runs/motion_queries.jsonl")
MODE = "pd_joint_pos"  # control mode
HOPELESS = 1000  # number of the first question of a cell that has no answer
WAIT = 1800.0  # s; wall time after which a query is given up, whatever else the machine does


class Query(NamedTuple):
    """A question.

    Attributes:
        cell: Number of the cell.
        arms: How many it holds.
        number: Of the question among those of the cell.
        kind: How the goals are given, or why nothing gets there: see `INFEASIBLE`.
        seed: Of everything random.
        sources: Packages from whose URDFs some arms come.
        certify: Whether to check the answer densely.
        execute: Whether to carry it out.
    """

    cell: int
    arms: int
    number: int
    kind: str
    seed: int
    sources: tuple[str, ...]
    certify: bool
    execute: bool


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    add = parser.add_argument
    add("--cells", type=int, default=200, metavar="N", help="random layouts (%(default)s)")
    add("--queries", type=int, default=50, metavar="M", help="of each (%(default)s)")
    add("--arms", default="2-8", metavar="A-B", help="how many, from-to (%(default)s)")
    add(
        "--sources",
        nargs="+",
        default=[],
        metavar="PACKAGE",
        help=f"arms from URDFs of installed packages, too: {', '.join(PACKAGES)}",
    )
    add("--workers", type=int, default=1, metavar="N", help="processes at a time (%(default)s)")
    add("--seed", type=int, default=0, metavar="S", help="of everything random (%(default)s)")
    add(
        "--round",
        type=int,
        default=10,
        metavar="N",
        help="queries of a cell before the next cell's, round after round (%(default)s)",
    )
    add("--no-certify", action="store_true", help="leave the dense recheck out")
    add(
        "--execute",
        type=int,
        default=1,
        metavar="K",
        help="carry every K-th motion out in SAPIEN; 0 for none (%(default)s)",
    )
    add("--out", type=Path, default=RECORD, metavar="FILE", help="the record (%(default)s)")
    add("--page", type=Path, metavar="FILE", help="write a page, such as docs/planning.md, too")


def run(options: argparse.Namespace) -> int:
    """Ask what the record does not hold yet, and write its table."""
    known = {(seen["cell"], seen["query"]) for seen in read(options.out)}
    wanted = [query for query in questions(options) if (query.cell, query.number) not in known]
    options.out.parent.mkdir(parents=True, exist_ok=True)
    with (
        open(options.out, "a", encoding="utf-8") as record,
        LiveLine(len(wanted), "queries") as line,
    ):
        for seen in _asked(wanted, options.workers):
            record.write(json.dumps(seen) + "\n")
            record.flush()
            line.advance(1, f"cell {seen['cell']}, query {seen['query']}")
    table = options.out.with_suffix(".md")
    write_whole(table, "\n".join(markdown(read(options.out))) + "\n")
    print(table.read_text(encoding="utf-8"))
    if options.page is not None:
        shown = summary(read(options.out))
        write_whole(options.page.with_suffix(".json"), json.dumps(shown, indent=1) + "\n")
        write_whole(options.page, "\n".join(page(shown)) + "\n")
    return 0


def questions(options: argparse.Namespace) -> Iterator[Query]:
    """Yield all questions, some of each cell first, so that a run that is cut off has seen all."""
    first, _, last = options.arms.partition("-")
    counts = range(int(first), int(last or first) + 1)
    kinds = dict(enumerate(INFEASIBLE, HOPELESS))
    kinds |= {i: "tcp" if i % 4 == 3 else "joints" for i in range(options.queries)}
    for begun in range(0, len(kinds), options.round):
        for cell in range(options.cells):
            for number in [*kinds][begun : begun + options.round]:
                yield Query(
                    cell,
                    counts[cell % len(counts)],
                    number,
                    kinds[number],
                    options.seed,
                    tuple(options.sources),
                    not options.no_certify,
                    options.execute > 0 and number % options.execute == 0,
                )


def read(path: Path) -> list[Seen]:
    """Return the lines of a record; none if there is no file."""
    if not path.exists():
        return []
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]


def _asked(wanted: Sequence[Query], workers: int) -> Iterator[Seen]:
    if workers < 2:
        yield from map(ask, wanted)
        return
    with multiprocessing.get_context("spawn").Pool(workers) as pool:
        yield from pool.imap_unordered(ask, wanted, chunksize=5)


class _Place:
    """A cell, and what it takes to ask questions in it.

    Attributes:
        cell: The cell.
        sources: Where each robot comes from.
        postures: Random ones.
    """

    def __init__(self, query: Query) -> None:
        arms = arms_of(query.sources)
        extra = [arm.robot for arm in arms]
        self.cell = Cell(random_cell(query.seed + query.cell, query.arms, extra), table=FLOOR)
        known = {arm.robot: arm.source for arm in arms}
        robots = [placement.robot for placement in self.cell.layout.values()]
        self.sources = [known.get(robot, CATALOGUE) for robot in robots]
        self.postures = RandomPostures(self.cell, CLEARANCE)

    @cached_property
    def stage(self) -> Stage:
        """Where motions are carried out."""
        return Stage(self.cell.layout, MODE)


_last: dict[tuple[int, int, tuple[str, ...]], _Place] = {}


def _place(query: Query) -> _Place:
    """Return a query's cell; the last one is kept."""
    key = query.seed + query.cell, query.arms, query.sources
    if key not in _last:
        for old in _last.values():
            if "stage" in vars(old):
                old.stage.close()
        _last.clear()
        _last[key] = _Place(query)
    return _last[key]


def ask(query: Query) -> Seen:
    """Ask one question, and return what came of it."""
    import_ompl()
    import_toppra()
    place = _place(query)
    cell = place.cell
    drawn = place.postures.drawn((query.seed, query.cell, query.number))
    start, end = next(drawn), next(drawn)
    seen: Seen = {
        "cell": query.cell,
        "query": query.number,
        "arms": query.arms,
        "robots": [p.robot.name for p in cell.layout.values()],
        "sources": place.sources,
        "goal": query.kind,
    }
    began, wall = time.process_time(), time.monotonic()
    try:
        motion = plan(
            cell.layout,
            start,
            _goals(query, cell, end),
            table=FLOOR,
            clearance=CLEARANCE,
            seed=query.number,
            patience=WAIT,
            control_mode=MODE,
        )
    except RobotLayoutsError as error:
        reason = error.reason if isinstance(error, NoPlanError) else type(error).__name__
        seen |= {"solved": False, "reason": reason, "message": str(error)}
        motion = None
    seen |= {
        "seconds": round(time.process_time() - began, 4),
        "wall": round(time.monotonic() - wall, 4),
    }
    if motion is None:
        return seen
    seen |= {"solved": True, "duration": round(motion.duration, 3)}
    if query.certify:
        seen |= _certified(motion)
    return seen | (place.stage.carry_out(motion) if query.execute else {})


def _goals(query: Query, cell: Cell, end: Floats) -> dict[str, Goal]:
    if query.kind == OUT_OF_REACH:
        return out_of_reach(cell, end)
    if query.kind == IN_COLLISION:
        return in_collision(cell, end, query.number)
    return goals_at(cell, end, tcp=query.kind == "tcp")


def _certified(motion: Motion) -> Seen:
    certificate = motion.certify()
    near = certificate.clearance
    answer: Seen = {
        "certified": certificate.ok,
        "collisions": len(certificate.collisions),
        "moments": certificate.moments,
        "clearance": None if near is None else round(near.distance, 5),
    }
    if not certificate.ok:
        answer["certificate"] = str(certificate)
    return answer

"""``python -m benchmarks planning``: random queries to the planner, and its answers.

Cells are random valid layouts of mixed arms, of the catalogue and from URDFs of installed packages.
In each, random free postures are start and goal of all arms, every fourth goal as TCP poses; two
more queries have no answer. What is planned is certified, and carried out in SAPIEN. A line of JSON
is kept per query, so that a run goes on where it stopped.
"""

from __future__ import annotations

import json
import multiprocessing
import re
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from tqdm import tqdm

from benchmarks.records import Record, render, table, versions_of, write_record
from benchmarks.robots.survey import Robot, find_robots, package_folder
from layouts import Layout, face_to_face, grid, ring, side_by_side
from layouts.frames import Rectangle
from robot_layouts.core.writing import write_whole
from robot_layouts.experts import follow
from robot_layouts.kinematics.rotations import Floats, quaternion_of
from robot_layouts.motion import Motion, NoPlanError, TcpGoal, plan
from robot_layouts.motion.collision.cell import Cell
from robot_layouts.motion.collision.checker import Checker
from robot_layouts.motion.planning.goals import Goal, arm_joints
from robot_layouts.motion.planning.infeasibility import CUT_OFF
from robot_layouts.motion.planning.rrt_connect import import_ompl
from robot_layouts.motion.timing.velocities import import_toppra
from robot_layouts.simulation import State, World
from robots import RobotDescriptor, RobotLayoutsError, RobotRegistry, TaskError
from robots.urdf.tcp import find_tcp
from tasks import EpisodeRandom, MultiRobotTask, TaskEnv

MODE = "pd_joint_pos"  # control mode
CLEARANCE = 0.02  # m; how far robots are asked to stay apart
WAIT = 1800.0  # s; wall time after which a query is given up, whatever else the machine does
IN_TIME, LONGEST = {2: 5.0, 3: 5.0, 4: 5.0}, 30.0  # s of processor time, by number of arms
CATALOGUE = "catalogue"  # the source of robots that this library knows
OUT_OF_REACH, IN_COLLISION = "out of reach", "in collision"  # kinds of goals that have no answer
INFEASIBLE = {OUT_OF_REACH: "unreachable", IN_COLLISION: "goal in collision"}
REASONS = ("goal in collision", "start in collision", "unreachable")  # that a check can see
ALONE = "even if the other robots that move were not there"  # in the planner's message
HOPELESS = 1000  # number of the first query of a cell that has no answer
BEYOND = 1.5  # of an arm's reach: where nothing gets

LARGE = (
    "panda",
    "panda_stick",
    "panda_wristcam",
    "panda_pinch",
    "franka_panda",
    "ur3",
    "ur5",
    "ur10",
    "xarm7",
    "jaco2",
    "z1",
    "ur5_gripper",
    "talos_left_arm",
)
SMALL = ("so100", "so101", "koch")
LARGE_REACH = 0.5  # m; of arms from elsewhere, those with less are small
SHARE_OF_EXTRA, SHARE_OF_SMALL = 0.45, 0.15  # of the arms, if there are others; of the cells
CLOSENESS = 0.75, 1.05  # of distances that presets choose by themselves
FLOOR: Rectangle = (-6.0, -6.0, 6.0, 6.0)  # m; robots stand on it
ABOVE_FLOOR = 0.01  # m; the links of shoulders turn at less than 2 cm above what some arms stand on
TRIES = 20  # batches of 20 postures per robot

# An arm of a URDF is of the size and number of joints that manipulators have.
JOINTS, MOST_JOINTS, REACHES = range(5, 9), 16, (0.35, 1.5)  # of an arm; with its gripper; m
_MOVING = re.compile(rb"""<joint\s[^>]*type\s*=\s*["'](?:revolute|continuous|prismatic)["']""")

COLUMNS = (
    "arms",
    "queries",
    "solved",
    "solved, of those with a way alone",
    "in time",
    "median s",
    "90 % s",
    "99 % s",
    "slowest s",
    "certified",
    "collisions",
    "least clearance mm",
    "carried out",
    "robots touched",
    "farthest from the plan mm",
    "an arm finds no way even alone",
    "cut off, recognised",
    "wrongly said to be infeasible",
    "infeasible, recognised",
)


@dataclass(frozen=True)
class Query:
    """A query.

    Attributes:
        cell: Number of the cell.
        arms: How many it holds.
        number: Of the query among those of the cell.
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


def planning(
    *,
    cells: int = 200,
    queries: int = 50,
    arms: tuple[int, int] = (2, 8),
    sources: tuple[str, ...] = (),
    workers: int = 1,
    seed: int = 0,
    batch: int = 10,
    no_certify: bool = False,
    execute: int = 1,
    out: Path = Path("runs/planning.jsonl"),
    page: Path | None = None,
) -> int:
    """Ask the planner random queries that the record lacks, and write a table of its answers.

    Args:
        cells: Random layouts.
        queries: Of each.
        arms: How many, from and to.
        sources: Arms from URDFs of installed packages, too, such as pybullet.
        workers: Processes at a time.
        seed: Of everything random.
        batch: Queries of a cell before the next cell's, round after round.
        no_certify: Leave the dense recheck out.
        execute: Carry every K-th motion out in SAPIEN; 0 for none.
        out: The record; the table is beside it.
        page: Write a page and its figures, such as docs/planning.md, too.

    Raises:
        RobotLayoutsError: If a package is not installed, or something cannot be written.
    """
    kinds = dict(enumerate(INFEASIBLE, HOPELESS))
    kinds |= {i: "tcp" if i % 4 == 3 else "joints" for i in range(queries)}
    counts = range(arms[0], arms[1] + 1)
    known = {(seen["cell"], seen["query"]) for seen in read(out)}
    # Some queries of each cell first, so that a run that is cut off has seen all.
    wanted = [
        Query(
            cell,
            counts[cell % len(counts)],
            number,
            kinds[number],
            seed,
            sources,
            not no_certify,
            execute > 0 and number % execute == 0,
        )
        for begun in range(0, len(kinds), batch)
        for cell in range(cells)
        for number in [*kinds][begun : begun + batch]
        if (cell, number) not in known
    ]
    out.parent.mkdir(parents=True, exist_ok=True)
    with open(out, "a", encoding="utf-8") as record:
        for seen in tqdm(_asked(wanted, workers), total=len(wanted), disable=None):
            record.write(json.dumps(seen) + "\n")
            record.flush()
    rows = table_of(read(out))
    write_whole(out.with_suffix(".md"), rows + "\n")
    print(rows)
    if page is not None:
        shown = summary(read(out))
        write_record(page.with_suffix(".json"), shown)
        write_whole(page, render("planning", **shown))
    return 0


def read(path: Path) -> list[Record]:
    """Return the lines of a record; none if there is no file."""
    if not path.exists():
        return []
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]


def _asked(wanted: Sequence[Query], workers: int) -> Iterator[Record]:
    if workers < 2:
        yield from map(ask, wanted)
        return
    with multiprocessing.get_context("spawn").Pool(workers) as pool:
        yield from pool.imap_unordered(ask, wanted, chunksize=5)


def ask(query: Query) -> Record:
    """Ask one query, and return what the planner answered."""
    import_ompl()
    import_toppra()
    place = _place(query.seed + query.cell, query.arms, query.sources)
    cell = place.cell
    drawn = place.postures.drawn((query.seed, query.cell, query.number))
    start, end = next(drawn), next(drawn)
    seen: Record = {
        "cell": query.cell,
        "query": query.number,
        "arms": query.arms,
        "robots": [p.robot.name for p in cell.layout.values()],
        "sources": place.sources,
        "goal": query.kind,
    }
    began, wall, motion = time.process_time(), time.monotonic(), None
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
    seen |= {
        "seconds": round(time.process_time() - began, 4),
        "wall": round(time.monotonic() - wall, 4),
    }
    if motion is None:
        return seen
    seen |= {"solved": True, "duration": round(motion.duration, 3)}
    if query.certify:
        certificate = motion.certify()
        near = certificate.clearance
        seen |= {
            "certified": certificate.ok,
            "collisions": len(certificate.collisions),
            "moments": certificate.moments,
            "clearance": None if near is None else round(near.distance, 5),
        }
        if not certificate.ok:
            seen["certificate"] = str(certificate)
    return seen | (place.carry_out(motion) if query.execute else {})


class Place:
    """A cell, and what it takes to ask queries in it.

    Attributes:
        cell: The cell.
        sources: Where each robot comes from.
        postures: Random ones.
    """

    def __init__(self, seed: int, arms: int, sources: tuple[str, ...]) -> None:
        """Find a random valid cell, the same for the same seed."""
        others = _arms_of(sources)
        layout = random_cell(seed, arms, list(others.values()))
        self.cell = Cell(layout, table=FLOOR)
        known = {robot: key for key, robot in others.items()}
        self.sources = [known.get(placed.robot, CATALOGUE) for placed in layout.values()]
        self.postures = RandomPostures(self.cell, CLEARANCE)

    @cached_property
    def task(self) -> TaskEnv:
        """Where motions are carried out."""
        layout = self.cell.layout
        scenario = replace(FreeRobots.scenario, layout=layout, control_mode=MODE)
        task = FreeRobots(replace(scenario, check_layout=False))
        task.simulation.backend.watch_arms()
        return task

    def carry_out(self, motion: Motion) -> Record:
        """Carry a motion out in SAPIEN, and return whether robots touched in any step of physics.

        ``stray`` is how far any link was from the plan (m), ``late`` how much longer it took (s).
        """
        task, touching = self.task, dict[str, None]()
        vars(task.task)["starts"] = {name: rows[0] for name, rows in motion.positions.items()}
        task.reset(0)

        def watch() -> None:
            pairs = task.simulation.backend.arms_touching(0)
            touching.update(dict.fromkeys(f"{one}, {other}" for one, other in pairs))

        watch()
        touching.clear()
        try:
            done = follow(task, motion, watch=watch)
        except TaskError as error:
            return {"executed": False, "touching": list(touching), "refused": str(error)}
        return {
            "executed": True,
            "touching": list(touching),
            "stray": round(max(done.strays.values()), 5),
            "late": round(done.late, 3),
        }


_last: dict[tuple[int, int, tuple[str, ...]], Place] = {}


def _place(*key: Any) -> Place:
    """Return a query's place; the last one is kept."""
    if key not in _last:
        for old in _last.values():
            if "task" in vars(old):
                old.task.close()
        _last.clear()
        _last[key] = Place(*key)
    return _last[key]


class FreeRobots(MultiRobotTask):
    """Robots that stand where their layout starts them, and nothing else.

    Attributes:
        starts: Joint positions of those that begin elsewhere (rad, m).
    """

    layout = face_to_face({"left": "panda", "right": "panda"}, spacing=1.4)
    robot_counts = range(1, 9)
    max_episode_steps = 10_000
    starts: Mapping[str, Floats] = MappingProxyType({})

    def build(self, world: World) -> None:
        """Add nothing."""

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Place nothing."""

    def reset_robots(self, world: World, rng: EpisodeRandom) -> None:
        """Stand the robots where they start, without noise."""
        for name, placement in self.layout.items():
            world.stand(name, self.starts.get(name, placement.start_qpos))

    def evaluate(self, state: State) -> dict[str, Any]:
        """Nothing is ever achieved."""
        return {"success": state.array(np.zeros(state.num_envs)) > 1}


@lru_cache(maxsize=4)
def _arms_of(packages: tuple[str, ...]) -> dict[str, RobotDescriptor]:
    """Return the arms whose URDFs lie in packages by SOURCE/PATH, the first of each name in each.

    They are called as in their URDF, with ``_urdf`` behind.
    """
    found: dict[tuple[str, str], tuple[str, RobotDescriptor]] = {}
    for file in find_robots((name, package_folder(name)) for name in packages):
        if (robot := _arm(file)) is not None:
            found.setdefault((file.source, robot.name), (file.key, robot))
    return dict(found.values())


def _arm(file: Robot) -> RobotDescriptor | None:
    """Return the arm that a URDF holds: no legs, wheels, heads or slides; None if it holds none."""
    count = len(_MOVING.findall(file.file.read_bytes()))
    if not JOINTS.start <= count <= MOST_JOINTS or file.missing_meshes():
        return None
    try:
        robot = RobotDescriptor.from_urdf(file.file, quiet=True)
    except RobotLayoutsError:
        return None
    is_arm = set(robot.action_split.groups) <= {"arm", "gripper"}
    fits = len(robot.arm_joints) in JOINTS and REACHES[0] <= robot.reach <= REACHES[1]
    return replace(robot, name=f"{robot.name}_urdf") if is_arm and fits else None


def random_cell(seed: int, arms: int, extra: Sequence[RobotDescriptor] = ()) -> Layout:
    """Return a valid layout of some arms whose workspaces overlap, the same for the same seed.

    Args:
        seed: Of everything random.
        arms: How many.
        extra: Robots to draw from, besides those of the catalogue.
    """
    random = np.random.default_rng([seed, arms])
    while True:
        small = random.random() < SHARE_OF_SMALL  # arms of both sizes seldom share space
        pool = [RobotRegistry.load(name) for name in (SMALL if small else LARGE)]
        others = [robot for robot in extra if (robot.reach < LARGE_REACH) == small]
        robots: dict[str, RobotDescriptor] = {}
        for i in range(arms):
            chosen = others if others and random.random() < SHARE_OF_EXTRA else pool
            robots[f"arm{i}"] = chosen[int(random.integers(len(chosen)))]
        closeness = float(random.uniform(*CLOSENESS))
        try:
            layout = _arranged(robots, int(random.integers(3)), closeness)
            if layout.validate(table=FLOOR, samples=0, workspaces=False).ok:
                return layout
        except RobotLayoutsError:
            continue


def _arranged(robots: dict[str, RobotDescriptor], kind: int, closeness: float) -> Layout:
    if kind == 0:
        across = len(robots) == 2
        layout = face_to_face(robots, spacing="auto") if across else ring(robots)
    else:
        layout = side_by_side(robots, spacing="auto") if kind == 1 else grid(robots)
    scale = np.array([closeness, closeness, 1.0])
    return Layout(
        {
            name: replace(p, position=tuple((scale * p.base_position).tolist()))
            for name, p in layout.items()
        }
    )


class RandomPostures:
    """Postures of all arms of a cell in which nothing comes near anything.

    One arm after the other is drawn until it keeps clear of those before: joints anywhere within
    their limits (those that turn without end: half a turn to each side of zero), but not more than
    half a turn from where the layout starts them, as arms that stand on a floor cannot turn all the
    way round.
    """

    def __init__(self, cell: Cell, clearance: float) -> None:
        """Prepare to draw.

        Args:
            cell: The cell.
            clearance: How near robots may come to each other (m); to a table, `ABOVE_FLOOR` at
                most.
        """
        self._cell, self._whole = cell, cell.checker()
        limits = np.nan_to_num(cell.limits, posinf=np.pi, neginf=-np.pi)
        self._limits = np.clip(limits, cell.start[:, None] - np.pi, cell.start[:, None] + np.pi)
        self._checkers: dict[str, tuple[Checker, Checker]] = {}
        for i, name in enumerate(cell.robots):
            earlier = [(name, other) for other in cell.robots[:i]]
            later = [(name, other) for other in cell.robots[i + 1 :]]
            tables = [(name, table) for table in cell.tables]
            self._checkers[name] = (
                cell.checker([name], clearance, own=None, except_=later + tables),
                cell.checker([name], min(clearance, ABOVE_FLOOR), except_=later + earlier),
            )

    def drawn(self, seed: Sequence[int]) -> Iterator[Floats]:
        """Yield postures, (D,) (rad, m), the same for the same seed."""
        random = np.random.default_rng(list(seed))
        while True:
            state: Floats | None = self._cell.start.copy()
            for name in self._cell.robots:
                if state is not None:
                    state = self._with_arm(state, name, random)
            if state is not None and self._whole.free(state[None])[0]:
                yield state

    def _with_arm(self, state: Floats, name: str, random: np.random.Generator) -> Floats | None:
        columns = _columns(self._cell, name)
        low, high = self._limits[columns].T
        for _ in range(TRIES):
            states = np.tile(state, (20, 1))
            states[:, columns] = random.uniform(low, high, (20, len(columns)))
            free = np.all([checker.free(states) for checker in self._checkers[name]], axis=0)
            if free.any():
                return states[np.argmax(free)]
        return None


def _columns(cell: Cell, name: str) -> list[int]:
    """Return where the joints of a robot's arm stand in a posture of the cell."""
    robot, first = cell.layout[name].robot, cell.slices[name].start
    return [first + robot.joints.index(joint) for joint in arm_joints(robot)]


def _goals(query: Query, cell: Cell, end: Floats) -> dict[str, Goal]:
    """Return the goals of a query, for which a posture stands, (D,), or that cannot be reached."""
    name = cell.robots[-1]
    if query.kind == OUT_OF_REACH:
        base, reach = cell.layout[name].base_position, cell.layout[name].robot.reach
        beyond = TcpGoal((float(base[0]) + BEYOND * reach, float(base[1]), 0.2))
        return {**goals_at(cell, end, tcp=True), name: beyond}
    if query.kind != IN_COLLISION:
        return goals_at(cell, end, tcp=query.kind == "tcp")
    columns, state = _columns(cell, name), end.copy()
    checker, random = cell.checker([name]), np.random.default_rng(query.number)
    low, high = np.clip(cell.limits, cell.start[:, None] - np.pi, cell.start[:, None] + np.pi).T
    while checker.free(state[None])[0]:
        state[columns] = random.uniform(low[columns], high[columns])
    return goals_at(cell, state, tcp=False)


def goals_at(cell: Cell, end: Floats, *, tcp: bool) -> dict[str, Goal]:
    """Return the goals of all arms for which a posture stands, (D,), as TCP poses or joints."""
    if not tcp:
        return {name: end[_columns(cell, name)].tolist() for name in cell.robots}
    found: dict[str, Goal] = {}
    poses = cell.poses(end[None])
    for name, placement in cell.layout.items():
        tree = cell.models[name].kinematics
        point = find_tcp(placement.robot, tree)
        first = cell.links.index((name, tree.links[0]))
        links = poses[:, first : first + len(tree.links)]
        found[name] = TcpGoal(
            point.places(links)[0].tolist(), quaternion_of(links[0, point.turned, :3, :3]).tolist()
        )
    return found


def summary(record: Sequence[Record]) -> Record:
    """Return what a page shows of a record: with what it was made, and its table."""
    cells = {seen["cell"]: seen["sources"] for seen in record}
    sources = [source for own in cells.values() for source in own]
    packages = sorted({source.split("/")[0] for source in sources} - {CATALOGUE})
    return {
        "versions": versions_of("ompl", "toppra", "python-fcl", "sapien", "numpy"),
        "packages": dict.fromkeys(packages, "") | versions_of(*packages),
        "cells": len(cells),
        "arms": len(sources),
        "urdfs": sum(source != CATALOGUE for source in sources),
        "queries": sum(seen["goal"] not in INFEASIBLE for seen in record),
        "table": table_of(record).splitlines(),
    }


def table_of(record: Sequence[Record]) -> str:
    """Return a row per number of arms."""
    counts = sorted({seen["arms"] for seen in record})
    rows = (_row(arms, [seen for seen in record if seen["arms"] == arms]) for arms in counts)
    return table(COLUMNS, rows, range(len(COLUMNS)))


def _row(arms: int, every: Iterable[Record]) -> Iterator[str]:
    hopeless = [s for s in every if s["goal"] in INFEASIBLE]
    asked = [s for s in every if s["goal"] not in INFEASIBLE]
    seen = [s for s in asked if s.get("reason") != CUT_OFF]
    solved = [s for s in seen if s["solved"]]
    seconds = np.array([s["seconds"] for s in seen])
    in_time = sum(s["seconds"] <= IN_TIME.get(arms, LONGEST) for s in solved)
    checked = [s for s in solved if "certified" in s]
    clearances = [s["clearance"] for s in checked if s["clearance"] is not None]
    tried = [s for s in solved if "executed" in s]
    strays = [s["stray"] for s in tried if s["executed"]]
    alone = sum(ALONE in s.get("message", "") for s in seen)
    numbers = [
        arms,
        len(seen),
        _share(len(solved), len(seen)),
        _share(len(solved), len(seen) - alone),
        _share(in_time, len(seen)),
        *(f"{np.quantile(seconds, q):.2f}" if seen else "" for q in (0.5, 0.9, 0.99, 1.0)),
        _share(sum(s["certified"] for s in checked), len(checked)),
        sum(s["collisions"] for s in checked),
        f"{1e3 * min(clearances):.1f}" if clearances else "",
        f"{sum(s['executed'] for s in tried)} of {len(tried)}",
        sum(bool(s["touching"]) for s in tried),
        f"{1e3 * max(strays):.1f}" if strays else "",
        alone,
        len(asked) - len(seen),
        sum(s.get("reason") in REASONS for s in seen),
        f"{sum(s.get('reason') == INFEASIBLE[s['goal']] for s in hopeless)} of {len(hopeless)}",
    ]
    yield from map(str, numbers)


def _share(part: int, whole: int) -> str:
    return f"{part / whole:.1%}" if whole else ""

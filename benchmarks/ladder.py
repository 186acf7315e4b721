"""``python -m benchmarks ladder``: what behaviour cloning learns of the cells.

Each task is learned by ``examples/imitate.py`` from a few of its expert's episodes, and played with
unseen seeds by ``robot-layouts evaluate``, whose receipts hold how each episode went. Both run as
processes of their own, with the words that users would type. Then the episodes are played once more
here, and it is noted in which of them arms touch each other.
"""

from __future__ import annotations

import importlib
import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import closing
from copy import deepcopy
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import torch

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
from robot_layouts.data.receipts import Receipt
from robot_layouts.data.suite.results import result_of, wilson
from robot_layouts.experts.touching import ArmWatch
from tasks import Randomization, Shift, Uniform, make
from tasks.cell_options import chosen_robots
from tasks.episode import moments

EXAMPLES = DOCS.parent / "examples"
TASKS = (
    "CellPressTogether-v1",
    "CellCloseDrawers-v1",
    "CellLiftBoard-v1",
    "CellHoldAndPush-v1",
    "CellLiftPot-v1",
    "CellPushBar-v1",
    "CellCarryBeam-v1",
    "CellPutAndClose-v1",
)
ELSEWHERE = ("CellPressTogether-v1",)  # also played by arms that stand elsewhere
SHIFTS = (0.01, 0.05)  # m, how far each base is moved at most along x and along y
EPISODES, STEPS = 80, 4000  # to learn from, if nothing else is said, and batches of them
SIZE, VISUALS = 64, "full"  # of pictures: their width and height (pixels), and what they show
FIRST_TEST = 1_000_000  # seed; experts were recorded with those from 0 on
OWN = "its own"
COLUMNS = (
    *("task", "arms", "learned from", "layout"),
    *("success (%)", "stage score", "steps", "arms touch", "minutes"),
)


@dataclass(frozen=True)
class Rung:
    """A network that learns a task.

    Attributes:
        task: Id of the task.
        episodes: Of the expert, to learn from.
        steps: Batches to learn from.
        robots: Others than the task's, as ``imitate.py --robots`` names them; "" for none.
        pictures: Whether it learns from pictures.
        seed: Of its first weights, and of its batches.
    """

    task: str
    episodes: int
    steps: int
    robots: str
    pictures: bool
    seed: int

    @property
    def recorded(self) -> str:
        """The name of the run that records the episodes which it learns from."""
        usual = (self.episodes, self.steps) == (EPISODES, STEPS)
        length = "" if usual else f"{self.episodes}x{self.steps}"
        seen = "pictures" if self.pictures else ""
        return "_".join(filter(None, (self.task, self.robots, seen, length)))

    @property
    def name(self) -> str:
        """The name of its run, its row and its receipt."""
        return f"{self.recorded}_seed{self.seed}" if self.seed else self.recorded

    @property
    def example(self) -> str:
        """The example that trains it, and whose policy plays."""
        return "imitate_images" if self.pictures else "imitate"


def ladder(
    *,
    tasks: tuple[str, ...] = TASKS,
    robots: str = "",
    pictures: bool = False,
    episodes: int = EPISODES,
    steps: int = STEPS,
    seeds: tuple[int, ...] = (0,),
    tests: int = 50,
    elsewhere: tuple[str, ...] = ELSEWHERE,
    runs: Path = Path("runs/ladder"),
    out: Path = DOCS / "ladder.json",
) -> int:
    """Let a network imitate the expert of each task, and play seeds that it has not seen.

    Args:
        tasks: Task ids; what is in the record is neither learned nor played again.
        robots: Others than the tasks' own: one name for all places, or ``PLACE=ROBOT,…``.
        pictures: Learn from pictures, and from what robots sense of themselves.
        episodes: Of the expert, to learn from.
        steps: Batches to learn from.
        seeds: Of the first weights and the batches, one for each network; those after the first
            learn from the episodes that were recorded for 0.
        tests: Episodes to play.
        elsewhere: Tasks that are also played by arms that stand elsewhere.
        runs: Where recordings and weights are kept, in a folder for each network.
        out: The record, written after every task; the page is beside it, and the receipts are in
            ``receipts/ladder``.

    Raises:
        RobotLayoutsError: If something cannot be learned, played, read or written.
    """
    torch.set_num_threads(1)
    record = read_record(out, versions={}, tasks={})
    receipts = out.parent / "receipts" / "ladder"
    for task, seed in product(tasks, seeds):
        rung = Rung(task, episodes, steps, robots, pictures, seed)
        if rung.name not in record["tasks"]:
            record["tasks"][rung.name] = _learned(rung, runs)
            write_record(out, record)
        seen, file = record["tasks"][rung.name], runs / rung.name / "policy.pt"
        for shift in (0.0, *(SHIFTS if rung.name in elsewhere else ())):
            name = f"bases up to {100 * shift:.0f} cm off" if shift else OWN
            if name not in seen["layouts"]:
                moved = f"_{1000 * shift:.0f}mm" if shift else ""
                receipt = receipts / f"{rung.name}{moved}.json"
                seen["layouts"][name] = _played(rung, file, shift, tests, receipt)
                record["versions"] |= versions_of("numpy", "torch", "sapien", "ompl")
                write_record(out, record)
    write_page(
        out,
        "ladder",
        versions=record["versions"],
        table=table(
            COLUMNS,
            [row for _, seen in sorted(record["tasks"].items()) for row in _rows(seen)],
            range(4, len(COLUMNS)),
        ),
        recipe={"episodes": EPISODES, "steps": STEPS},
    )
    return 0


def _learned(rung: Rung, runs: Path) -> Record:
    """Learn a task, and return how, and the processor's time it took (min), None if not all of it.

    Raises:
        RecordError: If it cannot be learned.
    """
    folder = runs / rung.name
    new, before = not folder.exists(), os.times()
    words: dict[str, Any] = {
        **{"episodes": rung.episodes, "steps": rung.steps, "seed": rung.seed},
        **{"examined": 1, "tests": 1, "workers": 0},
    }
    if rung.robots:
        words["robots"] = rung.robots
    if rung.pictures:
        words |= {"size": SIZE, "visuals": VISUALS}
    if rung.seed:
        words["recording"] = runs / rung.recorded / "recording"
    told = [word for name, value in words.items() for word in (f"--{name}", value)]
    _run(EXAMPLES / f"{rung.example}.py", rung.task, *told, "--out", folder)
    after = os.times()  # the example ends with 1 if it learned little
    time = sum(after[2:4]) - sum(before[2:4])  # user and system, of children
    found = read_record(folder / "learning_curve.json", recipe={})
    if not found["recipe"]:
        raise RecordError(f"{rung.name} was not learned; what the example printed stands above")
    robots = chosen_robots(rung.robots.split(",")) if rung.robots else None
    with closing(make(rung.task, robots=robots)) as env:
        arms = [placement.robot.name for placement in env.layout.values()]
    return {
        "arms": arms,
        "recipe": found["recipe"],
        "minutes": round(time / 60, 1) if new else None,
        "layouts": {},
    }


def _played(rung: Rung, file: Path, shift: float, tests: int, receipt: Path) -> Record:
    """Play the test seeds, write their receipt, and return how they went."""
    receipt.parent.mkdir(parents=True, exist_ok=True)
    varied = Randomization(bases={"*": Shift(x=_upto(shift), y=_upto(shift))}) if shift else None
    how: list[Any] = ["--control-mode", "pd_joint_pos", "--obs-mode"]
    how += ["rgb", "--camera-size", f"{SIZE}x{SIZE}"] if rung.pictures else ["state_dict"]
    if rung.robots:
        how += ["--robots", *rung.robots.split(",")]
    if varied is not None:
        varied.save(where := file.with_name(receipt.with_suffix(".yaml").name))
        how += ["--randomization", where]
    seeds = ["--seed", FIRST_TEST, "--episodes", tests, "--workers", 0]
    words = ["--task", rung.task, "--policy", f"{rung.example}:policy", *how, *seeds]
    weights = {f"{rung.example.upper()}_POLICY": str(file)}
    if _run("-m", "robot_layouts", "evaluate", *words, "--receipt", receipt, **weights):
        raise RecordError(f"{rung.name} was not played; what the command printed stands above")
    played = Receipt.read(receipt)
    result = result_of(played.episodes)
    return {
        "receipt": receipt.name,
        "episodes": result.episodes,
        "solved": result.successes,
        "stage_score": result.stage_score,
        "steps": result.length,
        "touching": [*_touching(rung, played, file, varied)],
    }


def _upto(shift: float) -> Uniform:
    return Uniform(-shift, shift)


def _touching(
    rung: Rung, receipt: Receipt, file: Path, varied: Randomization | None
) -> Iterator[int]:
    """Yield the seeds in which links of different arms touch.

    Raises:
        RecordError: If an episode does not go as its receipt says.
    """
    if str(EXAMPLES) not in sys.path:
        sys.path.append(str(EXAMPLES))
    example = importlib.import_module(rung.example)
    policies = example.SeeingPolicy if rung.pictures else example.ClonedPolicy
    policy = policies.load(file)
    env = make(rung.task, reward_mode="none", randomization=varied, **policy.making)
    with closing(env):
        arms = ArmWatch(env)
        for episode in receipt.episodes:
            played = moments(env, episode.seed, deepcopy(policy), episode.steps)
            touched, succeeded = zip(*((arms.touching(), m.success) for m in played), strict=True)
            if succeeded[-1] != episode.success:
                raise RecordError(f"{rung.name}, seed {episode.seed}: not as its receipt says")
            if any(touched):
                yield episode.seed


def _run(*words: Any, **variables: str) -> int:
    """Run Python with the examples at hand, and return its exit code; what it prints is shown."""
    paths = (str(EXAMPLES), os.environ.get("PYTHONPATH", ""))
    variables["PYTHONPATH"] = os.pathsep.join(filter(None, paths))
    environment = {**os.environ, "OMP_NUM_THREADS": "1", **variables}
    command = [sys.executable, *map(str, words)]
    return subprocess.run(command, env=environment, check=False).returncode


def _rows(seen: Record) -> Iterator[Sequence[str]]:
    recipe = seen["recipe"]
    pictures = ", pictures" if "size" in recipe else ""
    learned = f"{recipe['episodes']} episodes, {recipe['steps']:,} batches{pictures}"
    if recipe["seed"]:
        learned = f"the same, with seed {recipe['seed']}"
    for name, found in seen["layouts"].items():
        low, high = wilson(found["solved"], found["episodes"])
        rate, score = found["solved"] / found["episodes"], found["stage_score"]
        own = name == OWN
        yield (
            recipe["task"] if own else "",
            ", ".join(seen["arms"]) if own else "",
            learned if own else "",
            name,
            f"{100 * rate:.0f} ({100 * low:.1f} to {100 * high:.1f})",
            "–" if score is None else f"{score:.2f}",
            f"{found['steps']:g}",
            f"{len(found['touching'])} of {found['episodes']}",
            ("–" if seen["minutes"] is None else str(seen["minutes"])) if own else "",
        )

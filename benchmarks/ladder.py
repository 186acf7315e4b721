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
from tasks import Randomization, Shift, Uniform, get_task_class, make
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
FIRST_TEST = 1_000_000  # seed; experts were recorded with those from 0 on
OWN = "its own"
COLUMNS = (
    *("task", "arms", "layout"),
    *("success (%)", "stage score", "steps", "arms touch", "minutes"),
)


def ladder(
    *,
    tasks: tuple[str, ...] = TASKS,
    episodes: int = 80,
    steps: int = 4000,
    tests: int = 50,
    elsewhere: tuple[str, ...] = ELSEWHERE,
    runs: Path = Path("runs/ladder"),
    out: Path = DOCS / "ladder.json",
) -> int:
    """Let a network imitate the expert of each task, and play seeds that it has not seen.

    Args:
        tasks: Task ids; what is in the record is neither learned nor played again.
        episodes: Of the expert, to learn from.
        steps: Batches to learn from.
        tests: Episodes to play.
        elsewhere: Tasks that are also played by arms that stand elsewhere.
        runs: Where recordings and weights are kept, in a folder for each task.
        out: The record, written after every task; the page is beside it, and the receipts are in
            ``receipts/ladder``.

    Raises:
        RobotLayoutsError: If something cannot be learned, played, read or written.
    """
    torch.set_num_threads(1)
    record = read_record(out, versions={}, tasks={})
    receipts = out.parent / "receipts" / "ladder"
    for task in tasks:
        if task not in record["tasks"]:
            record["tasks"][task] = _learned(task, episodes, steps, runs / task)
            write_record(out, record)
        seen, file = record["tasks"][task], runs / task / "policy.pt"
        for shift in (0.0, *(SHIFTS if task in elsewhere else ())):
            name = f"bases up to {100 * shift:.0f} cm off" if shift else OWN
            if name not in seen["layouts"]:
                moved = f"_{1000 * shift:.0f}mm" if shift else ""
                receipt = receipts / f"{task}{moved}.json"
                seen["layouts"][name] = _played(task, file, shift, tests, receipt)
                record["versions"] |= versions_of("numpy", "torch", "sapien", "ompl")
                write_record(out, record)
    shown = sorted(record["tasks"].items())
    rows = [row for task, seen in shown for row in _rows(task, seen)]
    recipes = [seen["recipe"] for _, seen in shown]
    write_page(
        out,
        "ladder",
        versions=record["versions"],
        table=table(COLUMNS, rows, range(3, len(COLUMNS))),
        recipes=sorted({_words(recipe) for recipe in recipes}),
        elsewhere=any(len(seen["layouts"]) > 1 for _, seen in shown),
        recipe=recipes[0] if recipes else {"episodes": episodes, "steps": steps},
    )
    return 0


def _learned(task: str, episodes: int, steps: int, folder: Path) -> Record:
    """Learn a task, and return how, and the processor's time it took (min), None if not all of it.

    Raises:
        RecordError: If it cannot be learned.
    """
    new, before = not folder.exists(), os.times()
    words = {"episodes": episodes, "steps": steps, "examined": 1, "tests": 1, "workers": 0}
    told = [text for word, number in words.items() for text in (f"--{word}", str(number))]
    _run(EXAMPLES / "imitate.py", task, *told, "--out", folder)  # ends with 1 if it learned little
    after = os.times()
    time = sum(after[2:4]) - sum(before[2:4])  # user and system, of children
    found = read_record(folder / "learning_curve.json", recipe={})
    if not found["recipe"]:
        raise RecordError(f"{task} was not learned; what the example printed stands above")
    placements = get_task_class(task).layout.values()
    return {
        "arms": [placement.robot.name for placement in placements],
        "recipe": found["recipe"],
        "minutes": round(time / 60, 1) if new else None,
        "layouts": {},
    }


def _played(task: str, file: Path, shift: float, tests: int, receipt: Path) -> Record:
    """Play the test seeds, write their receipt, and return how they went."""
    receipt.parent.mkdir(parents=True, exist_ok=True)
    varied = Randomization(bases={"*": Shift(x=_upto(shift), y=_upto(shift))}) if shift else None
    more: list[Any] = []
    if varied is not None:
        varied.save(where := file.with_name(receipt.with_suffix(".yaml").name))
        more = ["--randomization", where]
    how = ["--obs-mode", "state_dict", "--control-mode", "pd_joint_pos", *more]
    seeds = ["--seed", FIRST_TEST, "--episodes", tests, "--workers", 0]
    words = ["--task", task, "--policy", "imitate:policy", *how, *seeds, "--receipt", receipt]
    if _run("-m", "robot_layouts", "evaluate", *words, IMITATE_POLICY=str(file)):
        raise RecordError(f"{task} was not played; what the command printed stands above")
    played = Receipt.read(receipt)
    result = result_of(played.episodes)
    return {
        "receipt": receipt.name,
        "episodes": result.episodes,
        "solved": result.successes,
        "stage_score": result.stage_score,
        "steps": result.length,
        "touching": [*_touching(played, file, varied)],
    }


def _upto(shift: float) -> Uniform:
    return Uniform(-shift, shift)


def _touching(receipt: Receipt, file: Path, varied: Randomization | None) -> Iterator[int]:
    """Yield the seeds in which links of different arms touch.

    Raises:
        RecordError: If an episode does not go as its receipt says.
    """
    if str(EXAMPLES) not in sys.path:
        sys.path.append(str(EXAMPLES))
    policy = importlib.import_module("imitate").ClonedPolicy.load(file)
    task: str = receipt.task["id"]
    env = make(task, reward_mode="none", randomization=varied, **policy.making)
    with closing(env):
        arms = ArmWatch(env)
        for episode in receipt.episodes:
            played = moments(env, episode.seed, deepcopy(policy), episode.steps)
            touched, succeeded = zip(*((arms.touching(), m.success) for m in played), strict=True)
            if succeeded[-1] != episode.success:
                raise RecordError(f"{task}, seed {episode.seed}: not as its receipt says")
            if any(touched):
                yield episode.seed


def _run(*words: Any, **variables: str) -> int:
    """Run Python with the examples at hand, and return its exit code; what it prints is shown."""
    paths = (str(EXAMPLES), os.environ.get("PYTHONPATH", ""))
    variables["PYTHONPATH"] = os.pathsep.join(filter(None, paths))
    environment = {**os.environ, "OMP_NUM_THREADS": "1", **variables}
    command = [sys.executable, *map(str, words)]
    return subprocess.run(command, env=environment, check=False).returncode


def _rows(task: str, seen: Record) -> Iterator[Sequence[str]]:
    arms = seen["arms"]
    for name, found in seen["layouts"].items():
        low, high = wilson(found["solved"], found["episodes"])
        rate, score = found["solved"] / found["episodes"], found["stage_score"]
        own = name == OWN
        yield (
            task if own else "",
            ", ".join(arms) if own else "",
            name,
            f"{100 * rate:.0f} ({100 * low:.1f} to {100 * high:.1f})",
            "–" if score is None else f"{score:.2f}",
            f"{found['steps']:g}",
            f"{len(found['touching'])} of {found['episodes']}",
            ("–" if seen["minutes"] is None else str(seen["minutes"])) if own else "",
        )


def _words(recipe: Record) -> str:
    return f"{recipe['episodes']} episodes, {recipe['steps']:,} batches of {recipe['batch']}"

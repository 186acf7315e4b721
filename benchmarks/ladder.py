"""``python -m benchmarks ladder``: what is learned of the cells, and how well it plays.

Each task is learned from a few of its expert's episodes or from its reward, as `benchmarks.rungs`
says, and played with unseen seeds by ``robot-layouts evaluate``, whose receipts hold how each
episode went. All that runs in processes of its own, with the words that users would type. Then the
episodes are played once more here, and it is noted in which of them arms touch each other.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import closing
from copy import deepcopy
from itertools import product
from pathlib import Path
from typing import Any, Literal

import torch

from benchmarks.records import (
    DOCS,
    Record,
    RecordError,
    read_record,
    table,
    write_page,
    write_record,
)
from benchmarks.rungs import EPISODES, STEPS, Imitation, LeRobot, Reinforced, Rung, run
from robot_layouts.data.receipts import Receipt
from robot_layouts.data.suite.results import result_of, wilson
from robot_layouts.experts.touching import ArmWatch
from tasks import Randomization, Shift, Uniform, make
from tasks.episode import moments

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
NAMES = {
    **{"act": "ACT", "diffusion": "diffusion policy", "pictures": "pictures"},
    **{"ppo": "PPO", "mappo": "MAPPO"},
}
COLUMNS = (
    *("task", "arms", "learned from", "layout"),
    *("success (%)", "stage score", "steps", "arms touch", "minutes"),
)


def ladder(
    *,
    tasks: tuple[str, ...] = TASKS,
    robots: str = "",
    learner: Literal["imitation", "act", "diffusion", "ppo", "mappo"] = "imitation",
    pictures: bool = False,
    episodes: int | None = None,
    steps: int | None = None,
    seeds: tuple[int, ...] = (0,),
    tests: int = 50,
    elsewhere: tuple[str, ...] = ELSEWHERE,
    runs: Path = Path("runs/ladder"),
    out: Path = DOCS / "ladder.json",
) -> int:
    """Let a policy learn each task from its expert or its reward, and play unseen seeds.

    Args:
        tasks: Task ids; what is in the record is neither learned nor played again.
        robots: Others than the tasks' own: one name for all places, or ``PLACE=ROBOT,…``.
        learner: The networks of examples/imitate.py; a policy that LeRobot trains; or PPO or MAPPO,
            which learn from the reward. Their packages have to be installed beside this.
        pictures: With imitation: learn from pictures, and from what robots sense of themselves.
        episodes: Of the expert, to learn from; 80 by default. PPO and MAPPO take none.
        steps: Batches to learn from, 4,000 by default; of PPO and MAPPO, steps of the task,
            1,000,000 by default.
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
    if pictures and learner != "imitation":
        raise RecordError(f"--pictures goes with --learner imitation, and not with {learner}")
    if episodes is not None and learner in Reinforced.LIBRARIES:
        raise RecordError(f"{learner} learns from no expert's episodes; --steps says how long")
    sizes = {"episodes": episodes, "steps": steps}
    told = {"robots": robots, **{name: size for name, size in sizes.items() if size is not None}}
    for task, seed in product(tasks, seeds):
        rung = _rung(learner, pictures, task=task, seed=seed, **told)
        if rung.name not in record["tasks"]:
            record["tasks"][rung.name] = _learned(rung, runs)
            write_record(out, record)
        seen, file = record["tasks"][rung.name], rung.file(runs)
        for shift in (0.0, *(SHIFTS if rung.name in elsewhere else ())):
            name = f"bases up to {100 * shift:.0f} cm off" if shift else OWN
            if name not in seen["layouts"]:
                moved = f"_{1000 * shift:.0f}mm" if shift else ""
                receipt = receipts / f"{rung.name}{moved}.json"
                seen["layouts"][name] = _played(rung, file, shift, tests, receipt)
                record["versions"][rung.FAMILY] = rung.versions()
                write_record(out, record)
    # runs that differ in their seed alone follow each other
    rows = sorted(record["tasks"].items(), key=lambda run: run[0].partition("_seed"))
    write_page(
        out,
        "ladder",
        versions=record["versions"],
        table=table(
            COLUMNS,
            [row for _, seen in rows for row in _rows(seen)],
            range(4, len(COLUMNS)),
        ),
        recipe={"episodes": EPISODES, "steps": STEPS},
    )
    return 0


def _rung(learner: str, pictures: bool, **told: Any) -> Rung:
    if learner == "imitation":
        return Imitation(**told, pictures=pictures)
    if learner in Reinforced.LIBRARIES:
        return Reinforced(**told, learner=learner)
    return LeRobot(**told, learner=learner)


def _learned(rung: Rung, runs: Path) -> Record:
    """Learn a task, and return how, and the processor's time it took (min), None if not all of it.

    Raises:
        RecordError: If it cannot be learned.
    """
    new, before = not (runs / rung.name).exists(), os.times()
    recipe = rung.learn(runs)
    after = os.times()
    time = sum(after[2:4]) - sum(before[2:4])  # user and system, of children
    with closing(make(rung.task, **rung.others)) as env:
        arms = [placement.robot.name for placement in env.layout.values()]
    minutes = round(time / 60, 1) if new else None
    return {"arms": arms, "recipe": recipe, "minutes": minutes, "layouts": {}}


def _played(rung: Rung, file: Path, shift: float, tests: int, receipt: Path) -> Record:
    """Play the test seeds, write their receipt, and return how they went."""
    receipt.parent.mkdir(parents=True, exist_ok=True)
    varied = Randomization(bases={"*": Shift(x=_upto(shift), y=_upto(shift))}) if shift else None
    how: list[Any] = ["--control-mode", rung.MODE, *rung.observed]
    if rung.robots:
        how += ["--robots", *rung.robots.split(",")]
    if varied is not None:
        varied.save(where := file.with_name(receipt.with_suffix(".yaml").name))
        how += ["--randomization", where]
    seeds = ["--seed", FIRST_TEST, "--episodes", tests, "--workers", 0]
    words = ["--task", rung.task, "--policy", rung.policy, *how, *seeds, "--receipt", receipt]
    if run("-m", "robot_layouts", "evaluate", *words, **rung.variables(file)):
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
    policy, making = rung.load(file)
    env = make(rung.task, reward_mode="none", randomization=varied, **making)
    with closing(env):
        arms = ArmWatch(env)
        for episode in receipt.episodes:
            played = moments(env, episode.seed, deepcopy(policy), episode.steps)
            touched, succeeded = zip(*((arms.touching(), m.success) for m in played), strict=True)
            if succeeded[-1] != episode.success:
                raise RecordError(f"{rung.name}, seed {episode.seed}: not as its receipt says")
            if any(touched):
                yield episode.seed


def _rows(seen: Record) -> Iterator[Sequence[str]]:
    recipe = seen["recipe"]
    kind = recipe.get("policy", "pictures" if "size" in recipe else "")
    of = f"{recipe['episodes']} episodes, " if recipe["episodes"] else "its reward, "
    learned = f"{of}{recipe['steps']:,} {'batches' if recipe['episodes'] else 'steps'}"
    learned += f", {NAMES[kind]}" if kind else ""
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

"""What the reinforcement learning examples share: runs that resume exactly, and their curves.

A run is a chain of checkpoints. Each is computed from the one before it, as it was read from its
file, and from the run's settings: worlds are built anew at every checkpoint, and random numbers
begin anew. So a run that was killed goes on to the same weights as one that was not.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import torch
from matplotlib.figure import Figure
from numpy.typing import NDArray

from robot_layouts.core.progress import Progress
from robot_layouts.core.writing import PARTIAL, remove, write_whole, written_whole
from robot_layouts.data import evaluate
from robot_layouts.data.log import HOW, Log, opened_log
from robots import RobotLayoutsError, TaskError
from tasks.cell_options import chosen_robots
from tasks.episode import Policy

TEST_SEED = 1_000_000  # of the first test episode; the others follow
LEARN_SEED = 10_000_000  # what is learned from has this seed or a higher one
SEEDS_OF_A_RUN = 100_000  # how far apart the seeds are that runs with other --seed learn from
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7")


@dataclass(frozen=True)
class Point:
    """A point of a learning curve.

    Attributes:
        steps: Steps that the policy has learned from.
        seconds: Time that it has learned for.
        reward: Mean reward of a step while it learned, from 0 to 1.
        learning_success: Share of the episodes that it learned from whose last step is a success.
        success: Share of test episodes with success; it plays them without noise.
    """

    steps: int
    seconds: float
    reward: float
    learning_success: float
    success: float


class Learner(Protocol):
    """Learns from one checkpoint to the next.

    Attributes:
        task: The task's id.
        making: Arguments of `tasks.make`.
        segment: Steps of all environments together from one checkpoint to the next.
    """

    task: str
    making: dict[str, Any]
    segment: int

    def begin(self, folder: Path) -> None:
        """Write a policy that has learned nothing."""
        ...

    def learn(
        self, before: Path, after: Path, number: int, notice: Callable[[int], None]
    ) -> tuple[float, float]:
        """Read checkpoint ``number``, learn, and write the next one.

        Args:
            before: Folder of the checkpoint.
            after: Folder of the next one.
            number: How many came before.
            notice: Called now and then with how many steps were made since the checkpoint.

        Returns:
            Mean reward of a step, and share of episodes whose last step is a success.
        """
        ...

    def policy(self, folder: Path) -> Policy:
        """Return the policy of a checkpoint."""
        ...

    def close(self) -> None:
        """Let the environments go."""
        ...


@dataclass(frozen=True)
class LearnedPolicy:
    """What was learned, without noise: observation (1, D) → action of all robots (A,).

    Attributes:
        folder: A checkpoint, or a run, which stands for its newest checkpoint.
        names: Which of the checkpoint's files decide what it does.
        load: Makes a function of them, once in each process.
    """

    folder: Path
    names: tuple[str, ...]
    load: Callable[..., Callable[[Any], NDArray[np.float32]]]

    @property
    def files(self) -> tuple[Path, ...]:
        """The files that decide what it does."""
        folder = checkpoint_of(self.folder)
        return tuple(folder / name for name in self.names)

    def __call__(self, obs: Any) -> NDArray[np.float32]:
        """Return the action."""
        return self.load(*self.files)(obs)


@dataclass(frozen=True)
class Run:
    """A folder of checkpoints, ``checkpoint-0000`` and so on.

    Attributes:
        folder: The folder.
    """

    folder: Path

    def checkpoint(self, number: int) -> Path:
        """Return the folder of a checkpoint."""
        return self.folder / f"checkpoint-{number:04d}"

    @property
    def latest(self) -> Path:
        """The folder of the newest checkpoint."""
        return checkpoint_of(self.folder)

    @property
    def curve(self) -> list[Point]:
        """The learning curve up to the newest checkpoint."""
        return [Point(**point) for point in json.loads((self.latest / "curve.json").read_text())]

    def settle(self, settings: Mapping[str, Any]) -> None:
        """Keep a run's settings, or compare them with those that it began with.

        Raises:
            TaskError: If they differ: the run would not go on as it began.
        """
        path = self.folder / "settings.json"
        if not path.exists():
            write_whole(path, json.dumps(settings, indent=2) + "\n")
        began = json.loads(path.read_text())
        now = json.loads(json.dumps(settings))
        for name in [*began, *now]:
            if began.get(name) != now.get(name):
                raise TaskError(
                    f"{self.folder} holds a run with {name} {began.get(name)}, and this one has"
                    f" {now.get(name)}; give it another folder, or the same settings"
                )


def checkpoint_of(folder: Path) -> Path:
    """Return a checkpoint's folder as it is, and of a run the newest checkpoint's.

    Raises:
        TaskError: If there is none.
    """
    if folder.name.startswith("checkpoint-"):
        return folder
    kept = sorted(folder.glob("checkpoint-????"))
    if not kept:
        raise TaskError(f"{folder} holds no checkpoint; a run leaves some there")
    return kept[-1]


def making_of(options: argparse.Namespace, control_mode: str) -> dict[str, Any]:
    """Return the arguments of `tasks.make` that options choose."""
    robots = {"robots": chosen_robots(options.robots.split(","))} if options.robots else {}
    return {"control_mode": control_mode, **robots}


def first_seed(options: argparse.Namespace, number: int) -> int:
    """Return the seed of the first world, and of all else, at checkpoint ``number``."""
    return LEARN_SEED + options.seed * SEEDS_OF_A_RUN + number * options.envs


def learn(
    learner: Learner, run: Run, steps: int, tests: int, log: Log = lambda step, numbers: None
) -> list[Point]:
    """Learn from the newest checkpoint on, or from the beginning, and return the whole curve.

    Args:
        learner: What learns.
        run: Where checkpoints are kept.
        steps: Steps to learn from in all; rounded up to whole checkpoints.
        tests: Test episodes at each checkpoint.
        log: Takes the numbers of each.
    """
    for unfinished in run.folder.glob(f"checkpoint-*{PARTIAL}"):
        remove(unfinished)
    if not run.checkpoint(0).exists():
        with written_whole(run.checkpoint(0)) as folder:
            folder.mkdir()
            learner.begin(folder)
            write_whole(folder / "curve.json", "[]\n")
    done = int(run.latest.name.rpartition("-")[2])
    with Progress(steps) as line:
        for number in range(done, -(-steps // learner.segment)):
            point = _next(learner, run, number, tests, line)
            line.say(_told(point))
            log(point.steps, {n: v for n, v in asdict(point).items() if n != "steps"})
    return run.curve


def _next(learner: Learner, run: Run, number: int, tests: int, line: Progress) -> Point:
    """Learn to the next checkpoint, and return the point of the curve that it adds."""
    steps = number * learner.segment
    curve = run.curve
    began = time.perf_counter()
    with written_whole(run.checkpoint(number + 1)) as folder:
        folder.mkdir()
        reward, learning_success = learner.learn(
            run.checkpoint(number), folder, number, lambda more: line.update(steps + more, "learn")
        )
        seconds = time.perf_counter() - began + (curve[-1].seconds if curve else 0.0)
        line.update(steps + learner.segment, "test")
        success = examine(learner, folder, tests)
        steps += learner.segment
        point = Point(steps, round(seconds, 1), round(reward, 4), learning_success, success)
        curve = [asdict(known) for known in (*curve, point)]
        write_whole(folder / "curve.json", json.dumps(curve, indent=2) + "\n")
    return point


def examine(learner: Learner, folder: Path, tests: int) -> float:
    """Return in which share of the test episodes a checkpoint's policy succeeds."""
    policy, seeds = learner.policy(folder), range(TEST_SEED, TEST_SEED + tests)
    found = evaluate(policy, learner.task, seeds, num_envs=10, workers=0, **learner.making)
    return found.success_rate


def draw(curves: Mapping[str, Sequence[Point]], title: str, path: Path) -> None:
    """Save learning curves as a picture: success on test seeds, and while learning dashed."""
    figure = Figure(figsize=(7, 4), dpi=110, layout="constrained")
    axes = figure.add_subplot()
    for (name, curve), colour in zip(curves.items(), COLOURS, strict=False):
        steps = [point.steps / 1e6 for point in curve]
        axes.plot(steps, [100 * point.success for point in curve], color=colour, label=name)
        while_learning = [100 * point.learning_success for point in curve]
        axes.plot(steps, while_learning, "--", color=colour, alpha=0.6, linewidth=1)
    axes.set(ylim=(0, 102), xlabel="steps (millions)", ylabel="success (%)", title=title)
    axes.plot([], [], "--", color="grey", linewidth=1, label="while learning, with noise")
    axes.legend()
    axes.grid(alpha=0.3)
    figure.savefig(path)


def read_arguments(
    description: str, folder: str, arguments: Sequence[str] | None
) -> argparse.Namespace:
    """Read the words of the command line that all examples take.

    Args:
        description: What the example does.
        folder: Where it keeps its run unless it is given another place.
        arguments: The words; None for those of this process.
    """
    parser = argparse.ArgumentParser(description=description)
    add = parser.add_argument
    about = "task id; MODULE:ID for one of your own (default %(default)s)"
    add("--task", default="TwoRobotPickCube-v1", help=about)
    add("--robots", help="others than the task's own: ROBOT for all places, or PLACE=ROBOT,…")
    add("--steps", type=int, help="steps to learn from (default: the recipe's)")
    add("--envs", type=int, default=64, help="environments to learn in (default %(default)s)")
    add("--every", type=int, help="iterations between checkpoints (default: the recipe's)")
    add("--tests", type=int, default=20, help="test episodes at each (default %(default)s)")
    add("--workers", type=int, help="processes that step worlds (default: one per core)")
    add("--threads", type=int, default=1, help="threads that learn (default %(default)s)")
    add("--seed", type=int, default=0, help="of weights and episodes (default %(default)s)")
    add("--out", type=Path, default=Path(folder), help="folder of the run (default %(default)s)")
    add("--log", help=f"also log the curve: {HOW}")
    add("--beside", type=Path, nargs="*", default=[], help="other runs to draw curves of")
    sys.path.append(os.getcwd())  # for MODULE:ID of the present folder
    return parser.parse_args(arguments)


def main(
    options: argparse.Namespace, make: Callable[[], Learner], settings: Mapping[str, Any]
) -> int:
    """Make a run, or go on with one, and draw its curve.

    Args:
        options: What `read_arguments` returned, with ``steps`` set.
        make: Makes what learns.
        settings: What the weights depend on, besides the task and the options.

    Returns:
        0 if nine of ten test episodes succeed at the end, else 1.
    """
    run = Run(options.out)
    words = ("task", "robots", "steps", "envs", "threads", "seed")
    try:
        run.settle(
            {
                **{word: getattr(options, word) for word in words},
                **settings,
                "torch": version("torch"),
                "processor": torch.backends.cpu.get_cpu_capability(),
            }
        )
        with opened_log(options.log) as log, closing(make()) as learner:
            curve = learn(learner, run, options.steps, options.tests, log)
        beside = {other.name: Run(other).curve for other in options.beside}
    except RobotLayoutsError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    write_whole(run.folder / "curve.json", (run.latest / "curve.json").read_text())
    draw({run.folder.name: curve, **beside}, options.task, run.folder / "curve.png")
    print(
        f"{curve[-1].success:.0%} of {options.tests} test episodes succeed; see {run.folder}",
    )
    return 0 if curve[-1].success >= 0.9 else 1


def _told(point: Point) -> str:
    return (
        f"{point.steps:>9,} steps {point.seconds:>6.0f} s  reward {point.reward:.3f}"
        f"  success {point.learning_success:>4.0%} while learning, {point.success:>4.0%} in tests"
    )

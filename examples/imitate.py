"""A network learns a task of one arm or two from an expert's episodes: behaviour cloning in chunks.

    pip install 'robot-layouts[preview]'
    python examples/imitate.py TwoRobotPickCube-v1

It records the expert while its arms are shaken, plays that again, notes what is observed before
each action, and lets a network predict the next actions from it. The network is examined on seeds
that were never recorded, with arms that nothing shakes. The same command goes on where it was
stopped or killed, and equal commands make equal networks, to the last bit.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass
from functools import cache
from math import cos, pi
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import torch
from matplotlib.figure import Figure
from numpy.typing import NDArray
from torch import Tensor, nn
from typing_extensions import Self

import tasks
from layouts import Layout
from robot_layouts.core.progress import Progress
from robot_layouts.data import Evaluation, evaluate, record
from robot_layouts.data.log import HOW, Log, opened_log
from robot_layouts.data.reading.recording import Recording, Trajectory
from robot_layouts.kinematics.rotations import rotation_of
from robots import RobotLayoutsError, TaskError
from tasks import Cube, Normal, Randomization
from tasks.cell_options import chosen_robots
from tasks.driving import DrivenGroup, driven_groups
from tasks.episode import moments

MODE = "pd_joint_pos"  # of the network: it says where to go, which is smooth; the expert, how far
OBSERVED = "state_dict"
FILE = "runs/imitate/TwoRobotPickCube-v1/policy.pt"  # or what IMITATE_POLICY says: the `policy`
EXAMINED_SEED = 500_000  # of the first episode that is played while it learns
TEST_SEED = 1_000_000  # of the first test episode; recorded ones begin with 0
TOGETHER = 25  # episodes played at once

Floats = NDArray[np.float32]


@dataclass(frozen=True)
class Recipe:
    """What decides the weights.

    Attributes:
        task: Id of the task.
        episodes: How many of the expert's are learned from.
        steps: How many batches.
        seed: Of the first weights and of the batches.
        shake: Noise of the expert's turns, which it does not know of, so that the network sees how
            it comes back (action numbers, standard deviation; 1 is 0.1 rad).
        chunk: How many actions are predicted at once.
        played: How many of these are carried out before it looks again.
        width: Of the network's layers.
        blocks: How many pairs of layers it has.
        batch: Moments in a batch.
        learning_rate: At first, after 200 batches; it falls to 0.
        simulator: In which it learns.
        robots: Others than the task's: one name for all places, or ``PLACE=ROBOT,…``.
    """

    task: str
    episodes: int = 1000
    steps: int = 20_000
    seed: int = 0
    shake: float = 0.15
    chunk: int = 8
    played: int = 4
    width: int = 256
    blocks: int = 3
    batch: int = 256
    learning_rate: float = 1e-3
    simulator: str = "sapien3"
    robots: str = ""
    options: ClassVar[tuple[str, ...]] = (  # fields that the command line sets, too
        *("shake", "chunk", "played", "simulator", "robots"),
    )

    @property
    def making(self) -> dict[str, Any]:
        """How the task is made that is recorded: arguments of `tasks.make`."""
        others = {"robots": chosen_robots(self.robots.split(","))} if self.robots else {}
        return {"simulator": self.simulator, **others}


def shaking(recipe: Recipe) -> Randomization:
    """Return the noise that moves arms aside while the expert brings them back."""
    env = tasks.make(recipe.task, **recipe.making)
    env.close()
    groups = [f"{driven.robot}.{driven.name}" for driven in _arms(env.layout)]
    return Randomization(action_noise=dict.fromkeys(groups, Normal(recipe.shake)))


def _arms(layout: Layout) -> Iterator[DrivenGroup]:
    """Yield the joint groups whose action numbers are turns of their joints."""
    return (driven for driven in driven_groups(layout) if driven.group.delta)


def demonstrate(recipe: Recipe, folder: Path, workers: int | None) -> None:
    """Record the expert's episodes that are not in the folder yet."""
    how: dict[str, Any] = {"workers": workers, "randomization": shaking(recipe), **recipe.making}
    with Progress(recipe.episodes, "episodes") as line:
        how["on_event"] = lambda so_far, _: line.update(so_far.recorded, "recording")
        record(recipe.task, range(recipe.episodes), folder, **how)


class Senses:
    """What the network gets of an observation: positions and poses, as numbers.

    Speeds are left out: from how an arm moves one can guess what it will do, but not what it
    should. A cube looks the same after a quarter turn, and nobody shall have to learn that: its
    rotation is given in numbers that are the same, too.
    """

    def __init__(self, task: str) -> None:
        """Ask the task which of its bodies are cubes."""
        bodies = tasks.get_task_class(task).bodies.items()
        self._cubes = {f"{name}_pose" for name, body in bodies if isinstance(body, Cube)}

    def __call__(self, observation: Mapping[str, Any]) -> Tensor:
        """Return the numbers, (N, D), of what ``obs_mode="state_dict"`` observes."""
        return torch.cat([*self._numbers(observation)], dim=1)

    def _numbers(self, observation: Mapping[str, Any]) -> Iterator[Tensor]:
        for name, part in observation.items():
            if isinstance(part, Mapping):
                yield from self._numbers(part)
            elif name in self._cubes:
                yield part[:, :3]
                turned = torch.from_numpy(rotation_of(part[:, 3:].numpy())).float()
                yield (turned**3 @ turned.mT).flatten(1)
            elif name != "qvel":
                yield part.reshape(len(part), -1).float()


class Observer:
    """Plays recorded episodes again, and notes what is observed before every action."""

    def __init__(self, recipe: Recipe, senses: Senses) -> None:
        """Make the task as it was recorded."""
        shaken = shaking(recipe)
        how: dict[str, Any] = {**recipe.making, "obs_mode": OBSERVED, "reward_mode": "none"}
        self.env = tasks.make(recipe.task, randomization=shaken, **how)
        self._senses, self._arms = senses, list(_arms(self.env.layout))

    def __call__(self, episode: Trajectory) -> tuple[Floats, Floats]:
        """Return observations (T, D), and actions (T, A) as positions of joints."""
        actions, seen, positions = iter(episode.actions), list[Floats](), list[Floats]()
        steps, seed = len(episode.actions), episode.seed or 0
        happening = moments(self.env, seed, lambda _: next(actions), steps)
        for action, moment in zip(episode.actions, happening, strict=False):
            seen.append(self._senses(moment.observation)[0].numpy())
            positions.append(self._positions(action))
        return np.stack(seen), np.stack(positions)

    def _positions(self, action: Floats) -> Floats:
        """Return an action with the positions that it turns joints to, from where they are."""
        joints, wanted = self.env.simulation.read().joint_positions[0], action.copy()
        for arm in self._arms:
            low, high = np.array(arm.group.ranges).T
            turn = low + (high - low) * (action[arm.numbers].clip(-1, 1) + 1) / 2
            wanted[arm.numbers] = joints[arm.joints] + turn
        return wanted


def observe(recipe: Recipe, recording: Path, senses: Senses) -> tuple[Tensor, Tensor]:
    """Return what was observed, (N, D), and the actions that follow, (N, chunk · A).

    Episodes that the expert did not solve are left out.

    Raises:
        TaskError: If the recording has too few episodes.
        TrajectoryError: If it cannot be read, or is of another world.
    """
    observer, samples = Observer(recipe, senses), list[tuple[Floats, Floats]]()
    with closing(observer.env), Recording(recording) as file:
        file.expect(observer.env.task_id, observer.env.layout.action_dim)
        file.expect_world(observer.env)
        if len(file) < recipe.episodes:
            raise TaskError(f"{recording} has {len(file)} episodes, not {recipe.episodes}")
        with Progress(recipe.episodes, "episodes") as line:
            for number in range(recipe.episodes):
                if (episode := file[number]).solved:
                    samples.append(observer(episode))
                line.update(number + 1, "observing")
    seen = np.concatenate([observations for observations, _ in samples])
    chunks = np.concatenate([chunks_of(actions, recipe.chunk) for _, actions in samples])
    return torch.from_numpy(seen), torch.from_numpy(chunks)


def chunks_of(actions: Floats, size: int) -> Floats:
    """Return the actions from each step on, (T, size · A); the last one is held."""
    steps = np.arange(len(actions))[:, None] + np.arange(size)
    return actions[steps.clip(max=len(actions) - 1)].reshape(len(actions), -1)


class Block(nn.Module):
    """Two layers whose outcome is added to what came in."""

    def __init__(self, width: int) -> None:
        """Make both as wide as what comes in."""
        super().__init__()
        inner, outer = nn.Linear(width, width), nn.Linear(width, width)
        self.layers = nn.Sequential(nn.LayerNorm(width), inner, nn.GELU(), outer)

    def forward(self, x: Tensor) -> Tensor:
        """Map (N, width) to (N, width)."""
        return x + self.layers(x)


class ChunkNetwork(nn.Module):
    """Predicts the next actions: a linear fit, and what a network adds to it.

    Most of an action is where the arm is already. The fit takes that away, and the rest is given to
    the network in units in which it is neither small nor large.
    """

    mean: Tensor
    scale: Tensor
    unit: Tensor
    switches: Tensor

    def __init__(self, inputs: int, outputs: int, width: int, blocks: int, more: int = 0) -> None:
        """Make it, for observations of ``inputs`` numbers and chunks of ``outputs``.

        The network gets ``more`` numbers that the linear fit does not.
        """
        super().__init__()
        self.sizes: tuple[int, ...] = inputs, outputs, width, blocks
        middle = (Block(width) for _ in range(blocks))
        first, last = nn.Linear(inputs + more, width), nn.Linear(width, outputs)
        self.network = nn.Sequential(first, *middle, nn.LayerNorm(width), last)
        self.linear = nn.Linear(inputs, outputs).requires_grad_(False)
        for name, size in (("mean", inputs), ("scale", inputs), ("unit", outputs)):
            self.register_buffer(name, torch.ones(size))
        self.register_buffer("switches", torch.zeros(outputs, dtype=torch.bool))

    @torch.no_grad()
    def fit(self, observations: Any, chunks: Tensor) -> None:
        """Fit the linear part by least squares, and measure the units."""
        self.mean.copy_(observations.mean(0))
        self.scale.copy_(observations.std(0).clamp(min=1e-2))
        seen, middle = self.normalised(observations), chunks.mean(0)
        x, y = seen.double(), (chunks - middle).double()
        ridge = 1e-3 * len(x) * torch.eye(x.shape[1], dtype=x.dtype)
        self.linear.weight.copy_(torch.linalg.solve(x.T @ x + ridge, x.T @ y).T)
        self.linear.bias.copy_(middle)
        self.unit.copy_((chunks - self.linear(seen)).std(0).clamp(min=1e-2))
        self.switches.copy_((chunks.abs() == 1).all(0))

    def normalised(self, observations: Tensor) -> Tensor:
        """Return observations in units of their standard deviation."""
        return ((observations - self.mean) / self.scale).clamp(-6.0, 6.0)

    def forward(self, observations: Any) -> Tensor:
        """Predict chunks, (N, outputs)."""
        seen = self.normalised(observations)
        return self.linear(seen) + self.unit * self.network(seen)

    def choose(self, observations: Any) -> Tensor:
        """Predict chunks whose grippers are opened or closed, as the expert's are.

        Half closed they would look as if they were closing, and be closed.
        """
        chunks = self(observations)
        return torch.where(self.switches, chunks.sign(), chunks)


class ClonedPolicy:
    """Plays what a network predicts; each episode is played by a copy of its own.

    Attributes:
        recipe: What it learned, and how.
        file: Where it was loaded from, or None.
    """

    recipes: ClassVar[type[Recipe]] = Recipe
    networks: ClassVar[type[ChunkNetwork]] = ChunkNetwork
    examinations: ClassVar[int] = 20  # while it learns; after each, what it has learned is kept

    def __init__(self, recipe: Any, network: ChunkNetwork, file: str | None = None) -> None:
        """Play with a network."""
        self.recipe, self.file = recipe, file
        self._senses, self._network, self._left = Senses(recipe.task), network, list[Tensor]()

    @classmethod
    def load(cls, file: str | Path) -> Self:
        """Load what `Training.save` wrote."""
        saved: dict[str, Any] = torch.load(file, weights_only=True)
        network = cls.networks(*saved["sizes"])
        network.load_state_dict(saved["network"])
        return cls(cls.recipes(**saved["recipe"]), network, str(file))

    @classmethod
    def training(cls, recipe: Any, recording: Path, workers: int | None, out: Path) -> Training:
        """Return what learns from a recording."""
        observations, chunks = observe(recipe, recording, Senses(recipe.task))
        torch.manual_seed(recipe.seed)  # of the first weights
        sizes = observations.shape[1], chunks.shape[1], recipe.width, recipe.blocks
        return Training(recipe, ChunkNetwork(*sizes), observations, chunks)

    @property
    def making(self) -> dict[str, Any]:
        """How the task is made that it plays: arguments of `tasks.make`."""
        return {**self.recipe.making, "control_mode": MODE, "obs_mode": OBSERVED}

    def sense(self, observation: Mapping[str, Any]) -> Any:
        """Return what the network gets of an observation."""
        return self._senses(observation)

    @torch.no_grad()
    def __call__(self, observation: Mapping[str, Any]) -> Tensor:
        """Return the next action, (A,), after an observation of one environment."""
        if not self._left:
            chunk = self._network.choose(self.sense(observation)).reshape(self.recipe.chunk, -1)
            self._left = [*chunk[: self.recipe.played]]
        return self._left.pop(0)

    def examine(self, first: int, count: int, on_event: Callable[[Any], None]) -> Evaluation:
        """Play the episodes of some seeds."""
        task, seeds = self.recipe.task, range(first, first + count)
        how: dict[str, Any] = {"workers": 0, "num_envs": TOGETHER, **self.making}
        return evaluate(self, task, seeds, on_event=on_event, **how)


class Training:
    """A network, and how far it has learned.

    Attributes:
        network: The network.
        steps: Batches that it has learned from.
        curve: How well it did: batches learned from, mean error since the last examination in units
            of what the linear fit leaves, share of episodes that succeeded.
    """

    def __init__(
        self, recipe: Recipe, network: ChunkNetwork, observations: Any, chunks: Tensor
    ) -> None:
        """Begin with a network's first weights and the linear fit.

        What was observed gives a batch of it for a tensor of indices, as tensors do.
        """
        self.network, self.steps, self.curve = network, 0, list[tuple[int, float, float]]()
        self._recipe, self._observations, self._chunks = recipe, observations, chunks
        self._random = torch.Generator().manual_seed(recipe.seed)
        self._errors = list[float]()
        network.fit(observations, chunks)
        learned = [weights for weights in network.parameters() if weights.requires_grad]
        self._optimizer = torch.optim.AdamW(learned)

    def step(self) -> None:
        """Learn from a batch."""
        recipe, network = self._recipe, self.network
        pace = min(1.0, (self.steps + 1) / 200) * (1 + cos(pi * self.steps / recipe.steps)) / 2
        self._optimizer.param_groups[0]["lr"] = recipe.learning_rate * pace
        batch = torch.randint(len(self._chunks), (recipe.batch,), generator=self._random)
        missed = network(self._observations[batch]) - self._chunks[batch]
        error = (missed / network.unit).abs().mean()
        self._optimizer.zero_grad()
        error.backward()
        self._optimizer.step()
        self.steps += 1
        self._errors.append(error.item())

    def note(self, success: float) -> str:
        """Add an examination to the curve, and return it as a line."""
        error = round(float(np.mean(self._errors)), 4)
        self.curve.append((self.steps, error, success))
        self._errors = []
        return f"{self.steps:>7} batches  error {error:.3f}  success {success:>4.0%}"

    def save(self, path: Path) -> None:
        """Write all that it takes to go on, whole or not at all."""
        state = {
            "recipe": asdict(self._recipe),
            "sizes": self.network.sizes,
            "network": self.network.state_dict(),
            "optimizer": self._optimizer.state_dict(),
            "random": self._random.get_state(),
            "steps": self.steps,
            "errors": self._errors,
            "curve": self.curve,
        }
        torch.save(state, beside := path.with_name(f"{path.name}.new"))
        os.replace(beside, path)

    def load(self, path: Path) -> None:
        """Go on where another one was saved.

        Raises:
            TaskError: If that one followed another recipe.
        """
        state: dict[str, Any] = torch.load(path, weights_only=True)
        if state["recipe"] != asdict(self._recipe):
            raise TaskError(f"{path} follows another recipe; choose another folder with --out")
        self.network.load_state_dict(state["network"])
        self._optimizer.load_state_dict(state["optimizer"])
        self._random.set_state(state["random"])
        self.steps, self._errors = state["steps"], state["errors"]
        self.curve = state["curve"]


def learn(training: Training, policy: ClonedPolicy, examined: int, file: Path, log: Log) -> None:
    """Learn all steps; examine the policy, log that and keep everything now and then."""
    recipe, every = policy.recipe, -(-policy.recipe.steps // policy.examinations)
    with Progress(recipe.steps, "batches") as line:
        while training.steps < recipe.steps:
            training.step()
            line.update(training.steps, "learning")
            if training.steps % every == 0 or training.steps == recipe.steps:
                found = policy.examine(EXAMINED_SEED, examined, lambda _: None)
                line.say(training.note(found.success_rate))
                training.save(file)
                log(training.steps, {"error": training.curve[-1][1], "success": found.success_rate})


def draw(curve: Sequence[tuple[int, float, float]], title: str, path: Path) -> None:
    """Save the learning curve as a picture."""
    steps, errors, successes = np.array(curve).T
    figure = Figure(figsize=(7, 4), dpi=110, layout="constrained")
    success = figure.add_subplot(title=title, xlabel="batches", ylim=(0, 102))
    success.plot(steps, 100 * successes, "o-", color="#0072B2")
    success.set_ylabel("success on unseen seeds (%)", color="#0072B2")
    success.grid(alpha=0.3)
    error = success.twinx()
    error.plot(steps, errors, "s--", color="#D55E00")
    error.set_ylabel("error on what it learns from", color="#D55E00")
    figure.savefig(path)


def imitate(
    recipe: Recipe, options: argparse.Namespace, out: Path, policies: type[ClonedPolicy], log: Log
) -> Evaluation:
    """Record, learn, and play the test seeds; leave weights, curve and numbers in a folder."""
    torch.set_num_threads(1)  # several would add up in other orders
    warnings.filterwarnings("ignore", "robot .* is thrown about")  # beginners hit the table
    out.mkdir(parents=True, exist_ok=True)
    if options.recording is None:
        demonstrate(recipe, out / "recording", options.workers)
    recording, file = options.recording or out / "recording", out / "policy.pt"
    training = policies.training(recipe, recording, options.workers, out)
    if file.exists():
        training.load(file)
    learn(training, policies(recipe, training.network), options.examined, file, log)
    policy = policies.load(file)
    with Progress(options.tests, "episodes") as line:
        result = policy.examine(TEST_SEED, options.tests, lambda _: line.advance(1, "examining"))
    numbers = {
        "recipe": asdict(recipe),
        "test_seeds": [TEST_SEED, TEST_SEED + options.tests - 1],
        "success": result.success_rate,
        "failed": [seed for seed, success in result.successes.items() if not success],
        "curve": [
            dict(zip(("steps", "error", "success"), row, strict=True)) for row in training.curve
        ],
    }
    (out / "learning_curve.json").write_text(json.dumps(numbers, indent=2) + "\n")
    title = f"{recipe.task}, learned from {recipe.episodes} episodes"
    draw(training.curve, title, out / "learning_curve.png")
    return result


def main(
    arguments: Sequence[str] | None = None,
    policies: type[ClonedPolicy] = ClonedPolicy,
    task: str = "TwoRobotPickCube-v1",
    name: str = "imitate",
) -> int:
    """Run the example.

    Args:
        arguments: Words of the command line; by default those of this process.
        policies: What learns.
        task: The task's id, unless the command line says it.
        name: Of the example.

    Returns:
        0 if 85 of 100 test episodes succeed, else 1.
    """
    usual = policies.recipes(task)
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    add = parser.add_argument
    about = "task id; MODULE:ID for one of your own (default %(default)s)"
    add("task", nargs="?", default=task, help=about)
    add("--episodes", type=int, default=usual.episodes, help="to learn from (%(default)s)")
    add("--steps", type=int, default=usual.steps, help="batches to learn from (%(default)s)")
    add("--seed", type=int, default=usual.seed, help="of weights and batches (%(default)s)")
    add("--examined", type=int, default=25, help="episodes now and then (%(default)s)")
    add("--tests", type=int, default=100, help="test episodes (%(default)s)")
    for field in usual.options:
        value = getattr(usual, field)
        add(f"--{field}", type=type(value), default=value, help="see the recipe (%(default)s)")
    add("--workers", type=int, help="processes that record (default: one per core)")
    add("--recording", type=Path, help="a recording that is there: folder, or hub:OWNER/NAME")
    add("--out", type=Path, help=f"folder (default: runs/{name}/TASK)")
    add("--log", help=f"also log the curve: {HOW}")
    options = parser.parse_args(arguments)
    sys.path.append(os.getcwd())  # for MODULE:ID of the present folder
    fields = ("task", "episodes", "steps", "seed", *usual.options)
    recipe = policies.recipes(**{name: getattr(options, name) for name in fields})
    out = options.out or Path("runs") / name / options.task.rpartition(":")[2]
    try:
        with opened_log(options.log) as log:
            result = imitate(recipe, options, out, policies, log)
    except RobotLayoutsError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    print(f"{result}\nsee {out}")
    return 0 if result.success_rate >= 0.85 else 1


@cache
def _learned() -> ClonedPolicy:
    return ClonedPolicy.load(os.environ.get("IMITATE_POLICY", FILE))


def __getattr__(name: str) -> Any:
    """Return what was learned, as `policy`, so that commands and receipts can name it."""
    if name == "policy":
        return _learned()
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


if __name__ == "__main__":  # the workers are processes of their own
    sys.exit(main())

"""What learns on the ladder: the policies of the examples, and LeRobot's."""

from __future__ import annotations

import importlib
import os
import shutil
import subprocess
import sys
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any, ClassVar

from benchmarks.records import DOCS, Record, RecordError, read_record, versions_of
from tasks import Normal, Randomization, make
from tasks.cell_options import chosen_robots
from tasks.driving import driven_groups
from tasks.episode import Policy

EXAMPLES = DOCS.parent / "examples"
EPISODES, STEPS = 80, 4000  # to learn from, if nothing else is said, and batches of them
REWARDED = 1_000_000  # steps of a task to learn from by reinforcement
SIZE, VISUALS = 64, "full"  # of pictures: their width and height (pixels), and what they show
SHAKEN = 0.015  # rad, standard deviation of an arm's noise: as in examples/imitate.py


@dataclass(frozen=True)
class Rung(ABC):
    """A policy that learns a task.

    Attributes:
        task: Id of the task.
        robots: Others than the task's, as ``--robots`` of commands names them, with commas; "" for
            none.
        seed: Of its first weights, and of its batches.
        episodes: Of the expert, to learn from.
        steps: Batches to learn from.
    """

    FAMILY: ClassVar[str]
    """What policies of its kind are called together."""
    MODE: ClassVar[str] = "pd_joint_pos"
    """What its actions mean."""
    task: str
    robots: str = ""
    seed: int = 0
    episodes: int = EPISODES
    steps: int = STEPS

    @property
    @abstractmethod
    def kind(self) -> str:
        """What sets it apart from the usual one, in its name; "" for nothing."""

    @property
    @abstractmethod
    def module(self) -> str:
        """The module whose ``policy`` plays."""

    @property
    @abstractmethod
    def observed(self) -> Sequence[Any]:
        """What commands are told of observations."""

    @abstractmethod
    def file(self, runs: Path) -> Path:
        """Return where the policy is."""

    @abstractmethod
    def variables(self, file: Path) -> Mapping[str, str]:
        """Return the environment variables that name a file to `policy`."""

    @abstractmethod
    def load(self, file: Path) -> tuple[Policy, Mapping[str, Any]]:
        """Return the policy in a file, and how the task is made that it plays."""

    @abstractmethod
    def learn(self, runs: Path) -> Record:
        """Learn, go on learning, or do nothing if that is done; return the recipe.

        Raises:
            RecordError: If it cannot be learned.
        """

    @abstractmethod
    def versions(self) -> dict[str, str]:
        """Return the versions of what it was learned and played with."""

    @property
    def policy(self) -> str:
        """What commands call the policy."""
        return f"{self.module}:policy"

    @property
    def length(self) -> str:
        """How long it learns, in its name; "" if that is as usual."""
        usual = (self.episodes, self.steps) == (EPISODES, STEPS)
        return "" if usual else f"{self.episodes}x{self.steps}"

    @property
    def recorded(self) -> str:
        """The name of the run that records the episodes which it learns from."""
        return "_".join(filter(None, (self.task, self.robots, self.kind, self.length)))

    @property
    def name(self) -> str:
        """The name of its run, its row and its receipt."""
        return f"{self.recorded}_seed{self.seed}" if self.seed else self.recorded

    @property
    def others(self) -> dict[str, Any]:
        """The robots in place of the task's own, as an argument of `tasks.make`, if there are."""
        return {"robots": chosen_robots(self.robots.split(","))} if self.robots else {}


@dataclass(frozen=True)
class Imitation(Rung):
    """A network of ``examples/imitate.py``, or of ``imitate_images.py``.

    Attributes:
        pictures: Whether it learns from pictures.
    """

    FAMILY: ClassVar[str] = "the examples' networks"
    pictures: bool = False

    @property
    def kind(self) -> str:
        """See `Rung`."""
        return "pictures" if self.pictures else ""

    @property
    def module(self) -> str:
        """The example that trains it."""
        return "imitate_images" if self.pictures else "imitate"

    @property
    def observed(self) -> Sequence[Any]:
        """See `Rung`."""
        if not self.pictures:
            return "--obs-mode", "state_dict"
        return "--obs-mode", "rgb", "--camera-size", f"{SIZE}x{SIZE}"

    def file(self, runs: Path) -> Path:
        """See `Rung`."""
        return runs / self.name / "policy.pt"

    def variables(self, file: Path) -> Mapping[str, str]:
        """See `Rung`."""
        return {f"{self.module.upper()}_POLICY": str(file)}

    def load(self, file: Path) -> tuple[Policy, Mapping[str, Any]]:
        """See `Rung`."""
        example = imported(self.module)
        policy = (example.SeeingPolicy if self.pictures else example.ClonedPolicy).load(file)
        return policy, policy.making

    def learn(self, runs: Path) -> Record:
        """See `Rung`."""
        words: dict[str, Any] = {
            **{"episodes": self.episodes, "steps": self.steps, "seed": self.seed},
            **{"examined": 1, "tests": 1, "workers": 0},
        }
        if self.robots:
            words["robots"] = self.robots
        if self.pictures:
            words |= {"size": SIZE, "visuals": VISUALS}
        if self.seed:
            words["recording"] = runs / self.recorded / "recording"
        told = [word for name, value in words.items() for word in (f"--{name}", value)]
        folder = runs / self.name
        run(EXAMPLES / f"{self.module}.py", self.task, *told, "--out", folder)
        # the example ends with 1 if it learned little
        recipe: Record = read_record(folder / "learning_curve.json", recipe={})["recipe"]
        if not recipe:
            raise RecordError(f"{self.name} was not learned; what the example printed stands above")
        return recipe

    def versions(self) -> dict[str, str]:
        """See `Rung`."""
        return versions_of("numpy", "torch", "sapien", "ompl")


@dataclass(frozen=True)
class LeRobot(Rung):
    """A policy that LeRobot's commands train on an exported dataset.

    Attributes:
        learner: One of `LEARNERS`.
    """

    FAMILY: ClassVar[str] = "LeRobot's policies"
    LEARNERS: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        "act": {
            **{"chunk_size": 8, "n_action_steps": 4, "dim_model": 128, "n_heads": 4},
            **{"dim_feedforward": 512, "n_encoder_layers": 2, "use_vae": "false"},
            **{"pretrained_backbone_weights": "null", "optimizer_lr": 5e-4},
        },
        "diffusion": {
            **{"horizon": 16, "n_action_steps": 4, "down_dims": "[64,128]"},
            **{"noise_scheduler_type": "DDIM", "num_inference_steps": 10},
            **{"pretrained_backbone_weights": "null", "optimizer_lr": 5e-4},
        },
    }
    """By type the fields of its configuration that are not LeRobot's own."""
    BATCH: ClassVar[int] = 64
    learner: str = "act"

    @property
    def kind(self) -> str:
        """See `Rung`."""
        return self.learner

    @property
    def module(self) -> str:
        """See `Rung`."""
        return "lerobot_env_robot_layouts.policies"

    @property
    def observed(self) -> Sequence[Any]:
        """See `Rung`."""
        return "--obs-mode", "lerobot"

    def file(self, runs: Path) -> Path:
        """See `Rung`."""
        return runs / self.name / "checkpoints" / "last" / "pretrained_model"

    def variables(self, file: Path) -> Mapping[str, str]:
        """See `Rung`."""
        return {"LEROBOT_POLICY": str(file), "LEROBOT_TASK": self.task}

    def load(self, file: Path) -> tuple[Policy, Mapping[str, Any]]:
        """See `Rung`."""
        policies = importlib.import_module(self.module).LeRobotPolicy
        making = {**self.others, "obs_mode": "lerobot", "control_mode": self.MODE}
        return policies.load(file, self.task), making

    def learn(self, runs: Path) -> Record:
        """See `Rung`."""
        if find_spec("lerobot") is None:
            raise RecordError(
                f"{self.learner} is trained by LeRobot, which is not installed here;"
                " docs/howto/lerobot.md says how to install it"
            )
        shared = self.task, self.robots, str(self.episodes), "demonstrations"
        data = runs / "_".join(filter(None, shared))
        if not (dataset := data / "dataset").exists():
            data.mkdir(parents=True, exist_ok=True)
            self.shaking().save(noise := data / "shaking.yaml")
            words: list[Any] = ["--task", self.task, "--episodes", self.episodes, "--workers", 0]
            words += ["--control-mode", self.MODE, "--randomization", noise]
            words += ["--robots", *self.robots.split(",")] if self.robots else []
            recording = data / "recording"
            run("-m", "robot_layouts", "record", *words, "--out", recording)
            words = [recording, "--format", "lerobot", "--workers", 0, "--out", dataset]
            run("-m", "robot_layouts", "export", *words)
        if not (file := self.file(runs)).exists():
            shutil.rmtree(runs / self.name, ignore_errors=True)  # LeRobot writes into no old folder
            told: dict[str, Any] = {
                **{"dataset.repo_id": "local/demonstrations", "dataset.root": dataset},
                **{"output_dir": runs / self.name, "policy.type": self.learner, "seed": self.seed},
                **{f"policy.{name}": value for name, value in self.LEARNERS[self.learner].items()},
                **{"policy.device": "cpu", "policy.push_to_hub": "false", "wandb.enable": "false"},
                **{"num_workers": 2, "env_eval_freq": 0, "save_freq": self.steps},
                **{"batch_size": self.BATCH, "steps": self.steps},
            }
            run("-m", "lerobot.scripts.lerobot_train", *(f"--{k}={v}" for k, v in told.items()))
        if not file.exists():
            raise RecordError(f"{self.name} was not learned; what LeRobot printed stands above")
        named = {"task": self.task, "robots": self.robots, "seed": self.seed}
        sizes = {"episodes": self.episodes, "steps": self.steps, "batch": self.BATCH}
        return {**named, **sizes, "policy": self.learner, **self.LEARNERS[self.learner]}

    def shaking(self) -> Randomization:
        """Return the noise that moves arms aside while the expert brings them back."""
        with closing(make(self.task, **self.others)) as env:
            driven = [found for found in driven_groups(env.layout) if found.group.delta]
        groups = [f"{found.robot}.{found.name}" for found in driven]
        return Randomization(action_noise=dict.fromkeys(groups, Normal(SHAKEN)))

    def versions(self) -> dict[str, str]:
        """See `Rung`."""
        return versions_of("lerobot", "diffusers", "torch", "numpy", "sapien")


@dataclass(frozen=True)
class Reinforced(Rung):
    """A policy that ``examples/ppo_two_arms.py`` or ``mappo_two_arms.py`` learns from the reward.

    Attributes:
        episodes: None.
        steps: Of the task, to learn from.
        learner: ``ppo`` or ``mappo``.
    """

    LIBRARIES: ClassVar[Mapping[str, str]] = {"ppo": "stable-baselines3", "mappo": "torchrl"}
    """By learner the package that does the learning."""
    FAMILY: ClassVar[str] = "PPO and MAPPO"
    MODE: ClassVar[str] = "pd_ee_delta_pos"
    episodes: int = 0
    steps: int = REWARDED
    learner: str = "ppo"

    @property
    def kind(self) -> str:
        """See `Rung`."""
        return self.learner

    @property
    def length(self) -> str:
        """See `Rung`."""
        return "" if self.steps == REWARDED else str(self.steps)

    @property
    def module(self) -> str:
        """The example that trains it."""
        return f"{self.learner}_two_arms"

    @property
    def observed(self) -> Sequence[Any]:
        """See `Rung`."""
        return "--obs-mode", "state"

    def file(self, runs: Path) -> Path:
        """See `Rung`."""
        return runs / self.name

    def variables(self, file: Path) -> Mapping[str, str]:
        """See `Rung`."""
        return {f"{self.learner.upper()}_RUN": str(file)}

    def load(self, file: Path) -> tuple[Policy, Mapping[str, Any]]:
        """See `Rung`."""
        policy = replace(imported(self.module).policy, folder=file)
        return policy, {**self.others, "obs_mode": "state", "control_mode": self.MODE}

    def learn(self, runs: Path) -> Record:
        """See `Rung`."""
        if find_spec(self.LIBRARIES[self.learner].replace("-", "_")) is None:
            raise RecordError(
                f"{self.learner} learns with {self.LIBRARIES[self.learner]}, which is not installed"
                " here; docs/tutorials/reinforcement.md says how to install it"
            )
        told: list[Any] = ["--task", self.task, "--steps", self.steps, "--seed", self.seed]
        told += ["--every", 10, "--workers", 0]
        told += ["--robots", self.robots] if self.robots else []
        folder = self.file(runs)
        run(EXAMPLES / f"{self.module}.py", *told, "--out", folder)
        # the example ends with 1 if it learned little
        if not (folder / "curve.json").exists():
            raise RecordError(f"{self.name} was not learned; what the example printed stands above")
        named = {"task": self.task, "robots": self.robots, "seed": self.seed}
        return {**named, "episodes": 0, "steps": self.steps, "policy": self.learner}

    def versions(self) -> dict[str, str]:
        """See `Rung`."""
        return versions_of("numpy", "torch", "sapien", self.LIBRARIES[self.learner])


def imported(example: str) -> Any:
    """Return the module of an example."""
    if str(EXAMPLES) not in sys.path:
        sys.path.append(str(EXAMPLES))
    return importlib.import_module(example)


def run(*words: Any, **variables: str) -> int:
    """Run Python with the examples at hand, and return its exit code; what it prints is shown."""
    paths = (str(EXAMPLES), os.environ.get("PYTHONPATH", ""))
    variables["PYTHONPATH"] = os.pathsep.join(filter(None, paths))
    environment = {**os.environ, "OMP_NUM_THREADS": "1", **variables}
    command = [sys.executable, *map(str, words)]
    return subprocess.run(command, env=environment, check=False).returncode

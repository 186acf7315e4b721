"""A network learns a task of one arm or two from what cameras see: behaviour cloning in chunks.

    pip install 'robot-layouts[preview,light]'
    python examples/imitate_images.py TwoRobotLiftBar-v1
    python examples/imitate_images.py PushCube-v1 --size 64 --visuals light --episodes 100

It learns as the network of `imitate.py` does, but is not told where objects are: it gets small
pictures of all cameras, and what real robots sense of themselves. The pictures are recorded with
the episodes, which takes a Vulkan driver. The same command goes on where it was stopped or killed,
and equal commands make equal networks, to the last bit.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, ClassVar, cast

import numpy as np
import torch
from imitate import MODE, ChunkNetwork, ClonedPolicy, Recipe, Senses, Training, main, observe
from numpy.typing import NDArray
from torch import Tensor, nn

import tasks
from robot_layouts.data.reading.recording import Recording
from robots import TaskError

OBSERVED = "rgb"
FILE = "runs/imitate_images/TwoRobotLiftBar-v1/policy.pt"  # or what IMITATE_IMAGES_POLICY says
SEEN = 64  # numbers that are made of the pictures of a moment


@dataclass(frozen=True)
class PictureRecipe(Recipe):
    """What decides the weights.

    Attributes:
        size: Width and height of a picture (pixels).
        visuals: Which meshes are drawn, ``"full"`` or ``"light"``.
    """

    episodes: int = 300
    steps: int = 4_000
    batch: int = 64
    size: int = 96
    visuals: str = "full"
    options: ClassVar[tuple[str, ...]] = (*Recipe.options, "size", "visuals")

    @property
    def making(self) -> dict[str, Any]:
        """How the task is made: arguments of `tasks.make`."""
        size = self.size, self.size
        seen = {"obs_mode": OBSERVED, "camera_size": size, "visuals": self.visuals}
        return {**super().making, **seen}


@dataclass(frozen=True)
class Sights:
    """What is observed at N moments.

    Attributes:
        numbers: Of the robots, (N, D).
        pictures: Of C cameras, (N, 3 · C, H, W), uint8.
    """

    numbers: Tensor
    pictures: Tensor

    def __getitem__(self, moments: Tensor) -> Sights:
        """Return some of them."""
        return Sights(self.numbers[moments], self.pictures[moments])


class RobotSenses(Senses):
    """What a network gets beside pictures: numbers that `OBSERVED` has, too."""

    def __init__(self, recipe: PictureRecipe) -> None:
        """Ask the task what it tells beside pictures."""
        super().__init__(recipe.task)
        env = tasks.make(recipe.task, **recipe.making)
        with closing(env):
            spaces = cast(Mapping[str, Any], env.observation_space)
            self._extra = sorted(spaces["extra"])  # as networks that were trained before know it

    def __call__(self, observation: Mapping[str, Any]) -> Tensor:
        """Return the numbers, (N, D), of what ``obs_mode="state_dict"`` or `OBSERVED` observes."""
        told = {name: observation["extra"][name] for name in self._extra}
        return super().__call__({"agent": observation["agent"], "extra": told})


def pictures_of(observation: Mapping[str, Any]) -> Iterable[Any]:
    """Return the pictures of each camera in an observation, (N, H, W, 3)."""
    return (camera["rgb"] for camera in observation["sensor_data"].values())


def load_pictures(recording: Path, recipe: PictureRecipe) -> Tensor:
    """Return the pictures of what is learned from, one after the other, (N, 3 · C, H, W).

    Raises:
        TaskError: If they were not recorded, or are of another size.
    """
    pictures = list[NDArray[np.uint8]]()
    with Recording(recording) as episodes:
        for number in range(recipe.episodes):
            if episodes[number].solved:
                seen = episodes.observations(number)
                if not isinstance(seen, dict) or "sensor_data" not in seen:
                    raise TaskError(f"{recording} holds no pictures; choose another folder")
                before = [rows[:-1] for rows in pictures_of(cast("dict[str, Any]", seen))]
                pictures.append(np.concatenate(before, 3))
                if pictures[-1].shape[1:3] != (recipe.size, recipe.size):
                    raise TaskError(f"{recording} has pictures that are not {recipe.size} wide")
    return torch.from_numpy(np.concatenate(pictures)).permute(0, 3, 1, 2).contiguous()


class Eye(nn.Module):
    """Makes few numbers of a picture, which three layers halve in width and height each."""

    def __init__(self, channels: int, size: int) -> None:
        """Make it, for square pictures of some channels."""
        super().__init__()
        self.layers = nn.Sequential(
            nn.Conv2d(channels, 16, 5, stride=2, padding=2),
            nn.GELU(),
            nn.Conv2d(16, 32, 3, stride=2, padding=1),
            nn.GELU(),
            nn.Conv2d(32, 32, 3, stride=2, padding=1),
            nn.GELU(),
            nn.Conv2d(32, 8, 1),
            nn.GELU(),
            nn.Flatten(),
            nn.Linear(8 * (-(-size // 8)) ** 2, SEEN),
        )

    def forward(self, pictures: Tensor) -> Tensor:
        """Map (N, channels, size, size), uint8, to (N, SEEN)."""
        return self.layers(pictures.float() / 127.5 - 1)


class SeeingNetwork(ChunkNetwork):
    """Predicts the next actions from pictures, too."""

    def __init__(self, inputs: int, outputs: int, width: int, blocks: int, *picture: int) -> None:
        """Make it, for pictures of so many channels and such a size."""
        super().__init__(inputs, outputs, width, blocks, more=SEEN)
        self.sizes = (*self.sizes, *picture)
        self.eye = Eye(*picture)

    def fit(self, observations: Sights, chunks: Tensor) -> None:
        """Fit the linear part to the numbers."""
        super().fit(observations.numbers, chunks)

    def forward(self, observations: Sights) -> Tensor:
        """Predict chunks, (N, outputs)."""
        numbers = self.normalised(observations.numbers)
        seen = torch.cat([numbers, self.eye(observations.pictures)], 1)
        return self.linear(numbers) + self.unit * self.network(seen)


class SeeingPolicy(ClonedPolicy):
    """Plays what a network predicts that sees."""

    recipes, networks = PictureRecipe, SeeingNetwork
    examinations: ClassVar[int] = 5

    def __init__(self, recipe: Any, network: ChunkNetwork, file: str | None = None) -> None:
        """Play with a network."""
        super().__init__(recipe, network, file)
        self._senses = RobotSenses(recipe)

    @classmethod
    def training(cls, recipe: Any, recording: Path, workers: int | None, out: Path) -> Training:
        """Return what learns from a recording."""
        senses = RobotSenses(recipe)
        numbers, chunks = observe(recipe, recording, senses)
        sights = Sights(numbers, load_pictures(recording, recipe))
        torch.manual_seed(recipe.seed)  # of the first weights
        sizes = numbers.shape[1], chunks.shape[1], recipe.width, recipe.blocks
        network = SeeingNetwork(*sizes, *sights.pictures.shape[1:3])
        return Training(recipe, network, sights, chunks)

    @property
    def making(self) -> dict[str, Any]:
        """How the task is made that it plays."""
        return {"control_mode": MODE, **self.recipe.making}

    def sense(self, observation: Mapping[str, Any]) -> Sights:
        """Return what the network gets of an observation."""
        seen = torch.cat([*pictures_of(observation)], 3)
        return Sights(self._senses(observation), seen.permute(0, 3, 1, 2))


@cache
def _learned() -> SeeingPolicy:
    return SeeingPolicy.load(os.environ.get("IMITATE_IMAGES_POLICY", FILE))


def __getattr__(name: str) -> Any:
    """Return what was learned, as `policy`, so that commands and receipts can name it."""
    if name == "policy":
        return _learned()
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def run(arguments: Sequence[str] | None = None) -> int:
    """Run the example; see `imitate.main`."""
    return main(arguments, SeeingPolicy, "TwoRobotLiftBar-v1", "imitate_images")


if __name__ == "__main__":  # the workers are processes of their own
    sys.exit(run())

"""The random streams of one environment, drawing what native draws for the same seed."""

from __future__ import annotations

import secrets
from collections.abc import Iterable, Sequence

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from layouts import Layout
from robot_layouts.simulation.maths import sqrt
from robots import TaskError
from tasks.randomization.distributions import Stream


def phrasings(streams: Sequence[EpisodeRandom], count: int) -> NDArray[np.int64]:
    """Return which of so many instructions the present episodes have, one number a stream."""
    return np.array([stream.phrasing(count) for stream in streams], np.int64)


class FirstSeeds:
    """Seeds for the first episodes of environments that are not given a seed.

    They are drawn from the system's entropy, so that no two environments play the same episodes
    unless someone wants that.
    """

    def __init__(self, num_envs: int) -> None:
        """Wait for the first seed of each environment."""
        self._num_envs = num_envs
        self._seeded: set[int] = set()

    def fill(self, seeds: Sequence[int | None], ids: Sequence[int]) -> list[int | None]:
        """Return seeds in which those of environments that still wait for theirs are drawn.

        As with one seed for all, environment i gets what was drawn plus i.

        Args:
            seeds: The seed of each environment in ``ids``, or None.
            ids: Numbers of environments.
        """
        drawn = secrets.randbelow(2**32 - self._num_envs + 1)
        return [
            drawn + i if seed is None and i not in self._seeded else seed
            for seed, i in zip(seeds, ids, strict=True)
        ]

    def given(self, ids: Iterable[int]) -> None:
        """Note that environments began an episode with a seed."""
        self._seeded.update(ids)


class EpisodeRandom:
    """Two independent streams per environment, as native keeps them.

    ``numpy`` (MT19937) draws joint noise, ``torch`` draws objects and goals. An explicit seed
    restarts both; without one they run on.

    Attributes:
        seed: What both streams last began with.
        resets: How many resets without a seed came since then.
        numpy: Stream for joint noise.
        torch: Stream for objects and goals.
        spread: Share of the ways between bounds, about their middles, on which numbers lie.
    """

    seed: int
    resets: int
    spread: float = 1.0
    numpy: np.random.RandomState
    torch: torch.Generator

    def __init__(self, seed: int) -> None:
        """Start both streams from ``seed``."""
        self.torch, self.numpy = torch.Generator(), np.random.RandomState(0)
        self._seeds = np.random.RandomState(0)
        self.restart(seed)

    @property
    def stream(self) -> Stream:
        """Where the numbers of the present episode come from that are not the task's own."""
        return Stream(self.seed, self.resets)

    def phrasing(self, count: int) -> int:
        """Return which of so many instructions the present episode has."""
        return (self.seed + self.resets) % count

    def restart(self, seed: int) -> None:
        """Start both streams anew, as an explicit seed does."""
        self._seeds.seed(seed)  # a new stream costs fifty times as much
        self.seed = self._numpy_seed = seed
        self.resets = 0
        self.restart_numpy()
        self.torch.manual_seed(seed)

    def restart_numpy(self) -> None:
        """Start the numpy stream anew, as native does after a build has drawn from it."""
        self.numpy.seed(self._numpy_seed)

    def reseed_for_rebuild(self) -> None:
        """Give the numpy stream the next seed of a third stream, as native does at a rebuild.

        The torch stream runs on.
        """
        self._numpy_seed = int(self._seeds.randint(2**31))
        self.restart_numpy()

    def uniform(self, *shape: int) -> Tensor:
        """Draw float32 numbers in [0, 1) from the torch stream.

        Raises:
            TaskError: If a length is not a whole number of at least 0.
        """
        try:
            return torch.rand(shape, generator=self.torch)
        except (TypeError, RuntimeError):
            raise TaskError(
                f"rng.uniform takes the shape of what is drawn, whole numbers; given: {shape}."
                " uniform_between([low, …], [high, …]) draws between bounds"
            ) from None

    def uniform_between(self, low: Sequence[float], high: Sequence[float]) -> Tensor:
        """Draw one float32 number between each pair of bounds from the torch stream.

        Raises:
            TaskError: If they are no two rows of as many numbers.
        """
        lowest, highest = torch.tensor(low), torch.tensor(high)
        if lowest.ndim != 1 or lowest.shape != highest.shape:
            raise TaskError(
                "rng.uniform_between takes the lower bounds and the upper ones, as many:"
                f" ([low, …], [high, …]); given: {low}, {high}"
            )
        drawn = self.uniform(1, len(low))[0] * (highest - lowest) + lowest
        if self.spread == 1.0:
            return drawn
        middle = (lowest + highest) / 2
        return middle + self.spread * (drawn - middle)

    def torch_normal(self, std: float, count: int) -> Tensor:
        """Draw ``count`` float32 numbers of mean 0 from the torch stream (unit of ``std``)."""
        return torch.normal(0.0, std, (1, count), generator=self.torch)[0]

    def torch_standard_normal(self, count: int) -> Tensor:
        """Draw ``count`` float32 numbers of mean 0 and deviation 1 from the torch stream.

        Times a deviation they are the numbers of `torch_normal` but for their last bits.
        """
        return torch.randn((1, count), generator=self.torch)[0]

    def torch_uniform(self, low: float, high: float, count: int) -> Tensor:
        """Draw ``count`` float32 numbers in [low, high) from the torch stream.

        As ``Tensor.uniform_`` draws them: the numbers of `uniform_between` but for their last bits.
        """
        drawn = torch.empty(count).uniform_(low, high, generator=self.torch)
        if self.spread == 1.0:
            return drawn
        middle = (low + high) / 2
        return middle + self.spread * (drawn - middle)

    def torch_whole(self, low: int, high: int) -> int:
        """Draw a whole number from ``low`` to ``high - 1`` from the torch stream."""
        return int(torch.randint(low, high, (1,), generator=self.torch))

    def normal(self, std: float, count: int) -> NDArray[np.float64]:
        """Draw ``count`` numbers of mean 0 from the numpy stream (unit of ``std``)."""
        return self.numpy.normal(0, std, count)

    def joint_noise(
        self, layout: Layout, *, shared: bool = False
    ) -> dict[str, NDArray[np.float64]]:
        """Draw the joint noise of each robot, (dof,) (rad, m), from the numpy stream.

        Args:
            layout: The robots, and how large the noise of each is.
            shared: Whether all robots get the same numbers.

        A robot that takes no action number gets no noise, and nothing is drawn for it: episodes
        begin as they do without it.
        """
        acting = {name: place for name, place in layout.items() if place.robot.action_dim}
        still = {n: np.zeros(p.robot.dof) for n, p in layout.items() if n not in acting}
        if not shared:
            noise = {n: self.normal(p.qpos_noise, p.robot.dof) for n, p in acting.items()}
            return {**noise, **still}
        largest = max(placement.robot.dof for placement in acting.values())
        common = self.normal(max(p.qpos_noise for p in acting.values()), largest)
        return {**{name: common[: p.robot.dof] for name, p in acting.items()}, **still}

    def yaw_quaternion(self, low: float = 0.0, high: float = 2 * np.pi) -> Tensor:
        """Draw a rotation about z by an angle in [low, high), as a wxyz quaternion (4,), w ≥ 0.

        Follows the operations of native's ``random_quaternions(lock_x=True, lock_y=True)``: it
        draws three angles, uses the last, and reads the quaternion off the rotation matrix.

        Args:
            low: Smallest angle (rad).
            high: Largest angle (rad).
        """
        angle = self.uniform(1, 3)[0, 2] * (high - low) + low
        if self.spread != 1.0:
            angle = (low + high) / 2 + self.spread * (angle - (low + high) / 2)
        cos, sin = torch.cos(angle), torch.sin(angle)
        w_squared, z_squared = 1.0 + cos + cos + 1.0, 1.0 - cos - cos + 1.0
        w, z = sqrt(w_squared), sqrt(z_squared)
        zero = torch.zeros(())
        if w >= z:
            quaternion = torch.stack((w**2, zero, zero, sin + sin)) / (2.0 * w)
        else:
            quaternion = torch.stack((sin + sin, zero, zero, z**2)) / (2.0 * z)
        return -quaternion if quaternion[0] < 0 else quaternion

    def points_apart(
        self, count: int, low: Sequence[float], high: Sequence[float], distance: float
    ) -> Tensor:
        """Draw points in a rectangle, each drawn again until it is far enough from those before.

        Follows native's ``UniformPlacementSampler`` with 100 trials: a point that never finds
        room is the origin.

        Args:
            count: Number of points.
            low: Smallest coordinates, shape (2,) (m).
            high: Largest coordinates, shape (2,) (m).
            distance: How far two points must be apart (m).

        Returns:
            Shape (count, 2) (m).
        """
        start = torch.tensor(low)
        size = torch.tensor(high) - start
        points = torch.zeros(count, 2)
        for i in range(count):
            for _ in range(_TRIALS):
                point = self.uniform(1, 2) * size + start
                if (torch.linalg.vector_norm(point - points[:i], dim=-1) > distance).all():
                    points[i] = point[0]
                    break
        return points


_TRIALS = 100  # mani_skill 3.0.1, envs/utils/randomization/samplers.py, as its tasks call it

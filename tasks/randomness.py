"""The random streams of one environment, drawing what native draws for the same seed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor


class EpisodeRandom:
    """Two independent streams per environment, as native keeps them.

    ``numpy`` (MT19937) draws joint noise, ``torch`` draws objects and goals. An explicit seed
    restarts both; without one they run on.

    Attributes:
        numpy: Stream for joint noise.
        torch: Stream for objects and goals.
    """

    numpy: np.random.RandomState
    torch: torch.Generator

    def __init__(self, seed: int) -> None:
        """Start both streams from ``seed``."""
        self.torch = torch.Generator()
        self.restart(seed)

    def restart(self, seed: int) -> None:
        """Start both streams anew, as an explicit seed does."""
        self._seeds = np.random.RandomState(seed)
        self._seed = seed
        self.restart_numpy()
        self.torch.manual_seed(seed)

    def restart_numpy(self) -> None:
        """Start the numpy stream anew, as native does after a build has drawn from it."""
        self.numpy = np.random.RandomState(self._seed)

    def reseed_for_rebuild(self) -> None:
        """Give the numpy stream the next seed of a third stream, as native does at a rebuild.

        The torch stream runs on.
        """
        self._seed = int(self._seeds.randint(2**31))
        self.restart_numpy()

    def uniform(self, *shape: int) -> Tensor:
        """Draw float32 numbers in [0, 1) from the torch stream."""
        return torch.rand(shape, generator=self.torch)

    def uniform_between(self, low: Sequence[float], high: Sequence[float]) -> Tensor:
        """Draw one float32 number between each pair of bounds from the torch stream."""
        lowest, highest = torch.tensor(low), torch.tensor(high)
        return self.uniform(1, len(low))[0] * (highest - lowest) + lowest

    def torch_normal(self, std: float, count: int) -> Tensor:
        """Draw ``count`` float32 numbers of mean 0 from the torch stream (unit of ``std``)."""
        return torch.normal(0.0, std, (1, count), generator=self.torch)[0]

    def normal(self, std: float, count: int) -> NDArray[np.float64]:
        """Draw ``count`` numbers of mean 0 from the numpy stream (unit of ``std``)."""
        return self.numpy.normal(0, std, count)

    def yaw_quaternion(self, lowest: float = 0.0, highest: float = np.pi * 2) -> Tensor:
        """Draw a rotation about z, as a wxyz quaternion (4,), w ≥ 0.

        Args:
            lowest: Smallest angle (rad).
            highest: Largest angle (rad).

        Follows the operations of native's ``random_quaternions(lock_x=True, lock_y=True)``: it
        draws three angles, uses the last, and reads the quaternion off the rotation matrix.
        """
        angle = self.uniform(1, 3)[0, 2] * (highest - lowest) + lowest
        cos, sin = torch.cos(angle), torch.sin(angle)
        w_squared, z_squared = 1.0 + cos + cos + 1.0, 1.0 - cos - cos + 1.0
        w, z = torch.sqrt(w_squared), torch.sqrt(z_squared)
        zero = torch.zeros(())
        if w >= z:
            quaternion = torch.stack((w**2, zero, zero, sin + sin)) / (2.0 * w)
        else:
            quaternion = torch.stack((sin + sin, zero, zero, z**2)) / (2.0 * z)
        return -quaternion if quaternion[0] < 0 else quaternion

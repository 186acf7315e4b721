"""Statistics of a dataset's features, as LeRobot keeps them beside the data."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Statistics = dict[str, NDArray[np.float64]]

QUANTILES = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}
LEVELS = 256  # of a colour of a picture
DEPTH_LEVELS = 65536  # of a distance (mm)


def describe_numbers(numbers: NDArray[np.generic]) -> Statistics:
    """Return the statistics of each column.

    Args:
        numbers: Shape (T, k), T of 1 or more; flags count as 0 and 1.

    Returns:
        ``min``, ``max``, ``mean``, ``std`` and the quantiles, each (k,), and ``count``, (1,).
    """
    values = numbers.astype(np.float64)
    found = {
        "min": values.min(0),
        "max": values.max(0),
        "mean": values.mean(0),
        "std": values.std(0),
        "count": np.array([len(values)]),
    }
    quantiles = np.quantile(values, list(QUANTILES.values()), axis=0)
    return found | dict(zip(QUANTILES, quantiles, strict=True))


class PictureStatistics:
    """Counts how often each level occurs in each channel; everything else follows from that."""

    def __init__(
        self, channels: int = 3, levels: int = LEVELS, largest: float = LEVELS - 1
    ) -> None:
        """Begin with no pictures.

        Args:
            channels: Numbers of a pixel.
            levels: Their values are 0 to this number - 1.
            largest: The value that counts as 1 in what is described.
        """
        self.pictures, self._largest = 0, largest
        self._counts = np.zeros((channels, levels), np.int64)

    def add(self, picture: NDArray[np.integer[Any]]) -> None:
        """Count a picture, (height, width, channels)."""
        self.pictures += 1
        unsigned = picture.view(np.uint16) if picture.dtype == np.int16 else picture
        for counts, channel in zip(self._counts, np.moveaxis(unsigned, 2, 0), strict=True):
            counts += np.bincount(channel.ravel(), minlength=len(counts))

    def include(self, others: PictureStatistics) -> None:
        """Count the pictures that others counted, too."""
        self.pictures += others.pictures
        self._counts += others._counts

    def describe(self) -> Statistics:
        """Return statistics of each channel, each (channels, 1, 1), and ``count``.

        Colours are scaled to [0, 1].
        """
        levels = np.arange(self._counts.shape[1]) / self._largest
        weights = self._counts / self._counts.sum(1, keepdims=True)
        mean = weights @ levels
        columns = {
            "min": np.array([levels[np.flatnonzero(counts)[0]] for counts in self._counts]),
            "max": np.array([levels[np.flatnonzero(counts)[-1]] for counts in self._counts]),
            "mean": mean,
            "std": np.sqrt((weights * (levels - mean[:, None]) ** 2).sum(1)),
            **{
                name: np.array([_quantile(levels, counts, share) for counts in self._counts])
                for name, share in QUANTILES.items()
            },
        }
        found = {name: column.reshape(-1, 1, 1) for name, column in columns.items()}
        return found | {"count": np.array([self.pictures])}


def flatten(statistics: Statistics) -> Iterable[tuple[str, list[object]]]:
    """Yield each statistic's name and its values as nested lists."""
    for name, values in statistics.items():
        yield name, values.tolist()


def _quantile(levels: NDArray[np.float64], counts: NDArray[np.int64], share: float) -> float:
    """Return a quantile of levels that occur ``counts`` times each, linear between neighbours."""
    rank = share * (counts.sum() - 1)
    below, above = np.searchsorted(counts.cumsum(), [np.floor(rank), np.ceil(rank)], side="right")
    return float(levels[below] + (rank - np.floor(rank)) * (levels[above] - levels[below]))

"""Images of patterns, computed: the same for the same numbers, and seamless on every side."""

from __future__ import annotations

from hashlib import shake_128

import numpy as np
from numpy.typing import NDArray

from simulation.looks import Pattern

SIZE = 256  # pixels along each side
_OCTAVES = 3
_FLOW = 0.7  # by how much of a ring's width the rings of wood wander
_GRAIN = 0.25  # how much of wood is fine grain

Amounts = NDArray[np.float64]


def pattern_image(pattern: Pattern) -> NDArray[np.uint8]:
    """Return the image of a pattern, (256, 256, 4): red, green, blue and 255, of light."""
    amount = _KINDS[pattern.kind](pattern.cells, pattern.seed)[..., None]
    first, second = np.array(pattern.first), np.array(pattern.second)
    colors = (first + (second - first) * amount) * 255 + 0.5
    image = np.full((SIZE, SIZE, 4), 255, np.uint8)
    image[..., :3] = colors.astype(np.uint8)
    return image


def _ramp() -> Amounts:
    """Return where the middle of each pixel is, from 0 to 1."""
    return (np.arange(SIZE) + 0.5) / SIZE


def _stripes(cells: int, seed: int) -> Amounts:
    band = np.floor(_ramp() * 2 * cells) % 2
    return np.broadcast_to(band, (SIZE, SIZE))


def _checker(cells: int, seed: int) -> Amounts:
    band = np.floor(_ramp() * 2 * cells)
    return (band[:, None] + band) % 2


def _noise(cells: int, seed: int) -> Amounts:
    """Return noise whose largest lumps are half a cell wide."""
    layers = [_lumps(cells * 2**i, cells * 2**i, seed + i) for i in range(1, _OCTAVES + 1)]
    weights = [0.5**i for i in range(_OCTAVES)]
    total = sum(weight * layer for weight, layer in zip(weights, layers, strict=True))
    return np.clip((total / sum(weights) - 0.5) * 2 + 0.5, 0.0, 1.0)


def _wood(cells: int, seed: int) -> Amounts:
    """Return rings that were cut along: lines that wander, with fine grain along them."""
    wander = _lumps(2, cells, seed) * _FLOW + _lumps(4, 2 * cells, seed + 1) * _FLOW / 2
    place = _ramp()[:, None] * cells + wander
    ring = np.abs(2 * (place - np.floor(place)) - 1)
    return ring * ring * (1 - _GRAIN) + _lumps(4, 16 * cells, seed + 2) * _GRAIN


def _lumps(across: int, along: int, seed: int) -> Amounts:
    """Return smooth noise between 0 and 1 from a grid of so many random numbers each way."""
    columns, rows = min(across, SIZE), min(along, SIZE)
    words = shake_128(f"{seed} {columns} {rows}".encode()).digest(2 * columns * rows)
    grid = np.frombuffer(words, "<u2").reshape(rows, columns) / 65535
    (down, below, far), (left, right, share) = _between(rows), _between(columns)
    upper = grid[down][:, left] * (1 - share) + grid[down][:, right] * share
    lower = grid[below][:, left] * (1 - share) + grid[below][:, right] * share
    return upper * (1 - far[:, None]) + lower * far[:, None]


def _between(count: int) -> tuple[NDArray[np.intp], NDArray[np.intp], Amounts]:
    """Return for each pixel the grid lines before and behind it, and how near it is to either."""
    place = _ramp() * count
    before = np.floor(place).astype(np.intp)
    share = place - before
    return before, (before + 1) % count, share * share * (3 - 2 * share)


_KINDS = {"checker": _checker, "stripes": _stripes, "noise": _noise, "wood": _wood}

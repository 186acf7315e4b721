"""Everything comparable about a batch of environments at one moment, sorted by quantity."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

# In the order of a report's columns.
QUANTITIES = (
    "object pose",
    "object velocity",
    "qpos",
    "qvel",
    "root",
    "observation",
    "reward",
    "info",
)

STATE = QUANTITIES[:5]  # what physics moves

Key = tuple[str, str]  # quantity, entry
Snapshot = dict[Key, NDArray[Any]]

_POSE = slice(0, 7)  # position (m) and quaternion (wxyz) of a native state row
_VELOCITY = slice(7, 13)  # linear (m/s) and angular (rad/s)
_ROOT = slice(0, 13)  # both, of a robot's root; qpos and qvel follow


def take(
    env: Any,
    count: int,
    observation: Any,
    info: Mapping[str, Any],
    reward: Any = None,
    terminated: Any = None,
) -> Snapshot:
    """Gather what a reset or a step returned, and the state dict behind it.

    Args:
        env: The environment, native or ours; asked for its state dict.
        count: Its number of environments N.
        observation: Flat observation, (N, D).
        info: What `evaluate` and the environment reported.
        reward: Reward (N,), or None after a reset.
        terminated: Flags (N,), or None after a reset.

    Returns:
        Arrays with one row per environment.
    """
    found: Snapshot = {("observation", "observation"): _rows(observation, count)}
    state = env.get_state_dict()
    for name, values in state.get("actors", {}).items():
        row = _rows(values, count)
        found["object pose", name] = row[:, _POSE]
        found["object velocity", name] = row[:, _VELOCITY]
    for name, values in state.get("articulations", {}).items():
        row = _rows(values, count)
        joints = row[:, _ROOT.stop :]
        dof = joints.shape[1] // 2
        found["root", name] = row[:, _ROOT]
        found["qpos", name], found["qvel", name] = joints[:, :dof], joints[:, dof:]
    for name, value in info.items():
        found["info", name] = _rows(value, count)
    if reward is not None:
        found["reward", "reward"] = _rows(reward, count)
        found["info", "terminated"] = _rows(terminated, count)
    return found


def state_dict(snapshot: Snapshot) -> dict[str, dict[str, NDArray[np.float32]]]:
    """Return the state that a snapshot was taken of, in native's format.

    Returns:
        ``actors`` and ``articulations``: name → one row per environment.
    """
    entries = {quantity: _entries(snapshot, quantity) for quantity in STATE}
    return {
        "actors": {
            name: np.concatenate([pose, entries["object velocity"][name]], 1)
            for name, pose in entries["object pose"].items()
        },
        "articulations": {
            name: np.concatenate([root, entries["qpos"][name], entries["qvel"][name]], 1)
            for name, root in entries["root"].items()
        },
    }


def _entries(snapshot: Snapshot, quantity: str) -> dict[str, NDArray[Any]]:
    return {name: values for (group, name), values in snapshot.items() if group == quantity}


def select(snapshot: Snapshot, rows: Sequence[int]) -> Snapshot:
    """Return some rows of a snapshot, in the order asked for."""
    return {key: values[list(rows)] for key, values in snapshot.items()}


def stack(snapshots: Sequence[Snapshot]) -> Snapshot:
    """Put the rows of snapshots with the same keys one below the other."""
    return {key: np.concatenate([part[key] for part in snapshots]) for key in snapshots[0]}


def differing(first: Snapshot, second: Snapshot) -> list[Key]:
    """Return the keys under which two snapshots are not equal, or that only one of them has."""
    return [
        key
        for key in dict.fromkeys([*first, *second])
        if key not in first
        or key not in second
        or not np.array_equal(first[key], second[key], equal_nan=True)
    ]


def largest_difference(a: NDArray[Any], b: NDArray[Any]) -> float:
    """Return max |a - b|: 0 only if every number is equal, infinite if shapes or NaNs differ."""
    if a.shape != b.shape:
        return np.inf
    if np.array_equal(a, b, equal_nan=True):
        return 0.0
    wide_a, wide_b = a.astype(np.float64), b.astype(np.float64)
    same = (wide_a == wide_b) | (np.isnan(wide_a) & np.isnan(wide_b))
    delta = np.abs(wide_a[~same] - wide_b[~same])
    return float(np.where(np.isnan(delta), np.inf, delta).max())


def _rows(value: Any, count: int) -> NDArray[Any]:
    # A copy: environments may hand out what they write to later.
    array = value.numpy(force=True).copy() if isinstance(value, Tensor) else np.array(value)
    return np.full(count, array) if array.ndim == 0 else array

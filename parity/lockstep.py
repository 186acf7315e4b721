"""Plays episodes on two sides in lock-step and finds every difference, to the last bit."""

from __future__ import annotations

import gc
from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from itertools import islice
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

import tasks
from parity.native import make_native, native_action, native_action_dim, native_agents, quiet
from robot_layouts.simulation.sapien3.contacts import presses_on_object
from robots import CONTROL_MODES, TaskError
from tasks import TaskEnv
from tasks.episode import Episode

Floats = NDArray[np.float32]
History = Literal["fresh", "reused"]
HISTORIES: tuple[History, ...] = ("fresh", "reused")

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


class Side(Protocol):
    """N environments that are reset and stepped together.

    Attributes:
        num_envs: Number of environments N.
        action_dim: Numbers of one flat action A.
    """

    num_envs: int
    action_dim: int

    def reset(self, seeds: Sequence[int], env_ids: Sequence[int], *, rebuild: bool) -> Snapshot:
        """Begin episodes in some environments, with one seed each.

        Args:
            seeds: A seed for each of ``env_ids``.
            env_ids: Which environments.
            rebuild: Whether to build their scenes anew, so that PhysX forgets their past.

        Returns:
            One row for each of ``env_ids``.
        """
        ...

    def step(self, actions: Floats) -> Snapshot:
        """Advance every environment; actions (N, A), one row returned for each environment."""
        ...

    def touching(self) -> NDArray[np.bool_]:
        """Tell where a robot touched a movable object in the last physics step, shape (N,)."""
        ...


class OurSide:
    """A task of this library."""

    def __init__(self, env: TaskEnv) -> None:
        """Take a task that was just made."""
        self.env = env
        self.num_envs = env.num_envs
        self.action_dim = env.layout.action_dim

    def reset(self, seeds: Sequence[int], env_ids: Sequence[int], *, rebuild: bool) -> Snapshot:
        """Begin episodes; see `Side`."""
        obs, info = self.env.reset(
            seed=list(seeds), options={"reconfigure": True} if rebuild else None, env_ids=env_ids
        )
        return select(take(self.env, self.num_envs, obs, info), env_ids)

    def step(self, actions: Floats) -> Snapshot:
        """Advance every environment; see `Side`."""
        obs, reward, terminated, _, info = self.env.step(actions)
        return take(self.env, self.num_envs, obs, info, reward, terminated)

    def touching(self) -> NDArray[np.bool_]:
        """Tell where a robot touched a movable object; see `Side`."""
        return self.env.simulation.backend.touching()


def _robots(env: Any) -> list[Any]:
    """Return SAPIEN's articulations of the robots of a native environment."""
    return [agent.robot._objs[0] for agent in native_agents(env)]


class NativeSide:
    """Native environments, one after the other: on the CPU, each holds a single one."""

    def __init__(
        self,
        task_id: str,
        reward_mode: str | None = None,
        num_envs: int = 1,
        control_mode: str = CONTROL_MODES[0],
        *,
        picture_size: int | None = None,
        robot_uid: str | None = None,
    ) -> None:
        """Make the environments; raises what `parity.native.make_native` does."""
        self.envs = [
            make_native(
                task_id, reward_mode, control_mode, picture_size=picture_size, robot_uid=robot_uid
            )
            for _ in range(num_envs)
        ]
        self.num_envs = num_envs
        self.action_dim = native_action_dim(self.envs[0])

    def reset(self, seeds: Sequence[int], env_ids: Sequence[int], *, rebuild: bool) -> Snapshot:
        """Begin episodes; see `Side`."""
        rows: list[Snapshot] = []
        with quiet():
            for seed, env in zip(seeds, (self.envs[i] for i in env_ids), strict=True):
                rows.append(take(env, 1, *env.reset(seed=seed, options={"reconfigure": rebuild})))
        return stack(rows)

    def step(self, actions: Floats) -> Snapshot:
        """Advance every environment; see `Side`."""
        return stack(
            [self._step(env, action) for env, action in zip(self.envs, actions, strict=True)]
        )

    def touching(self) -> NDArray[np.bool_]:
        """Tell where a robot touched a movable object; see `Side`."""
        return np.array(
            [presses_on_object(env.scene.px.get_contacts(), _robots(env)) for env in self.envs]
        )

    def close(self) -> None:
        """Let the environments go."""
        for env in self.envs:
            env.close()

    @staticmethod
    def _step(env: Any, action: Floats) -> Snapshot:
        obs, reward, terminated, _, info = env.step(native_action(env, action))
        return take(env, 1, obs, info, reward, terminated)


@dataclass(frozen=True)
class FirstDifference:
    """Where two sides part.

    Attributes:
        step: Control step; 0 is the reset.
        quantity: One of `QUANTITIES`.
        entry: Object, robot or key that differs.
    """

    step: int
    quantity: str
    entry: str

    def __str__(self) -> str:
        """Say it in words."""
        where = "at the reset" if self.step == 0 else f"from step {self.step}"
        what = self.quantity if self.entry == self.quantity else f"{self.quantity} of {self.entry}"
        return f"{where} in {what}"


@dataclass
class EpisodeResult:
    """What the comparison of one episode found.

    Attributes:
        seed: Reset seed.
        steps: Control steps played.
        contact_steps: Steps after which a robot was touching a movable object, in native.
        native_success: Whether native reported success at any step.
        our_success: Whether the other side did.
        max_difference: Largest |Δ| by quantity, the reset included; 0.0 means equal bits.
        first_difference: Where the sides part, or None.
    """

    seed: int
    steps: int
    contact_steps: int = 0
    native_success: bool = False
    our_success: bool = False
    max_difference: dict[str, float] = field(default_factory=lambda: dict.fromkeys(QUANTITIES, 0.0))
    first_difference: FirstDifference | None = None

    @property
    def equal(self) -> bool:
        """Whether nothing differs."""
        return self.first_difference is None

    @property
    def agrees(self) -> bool:
        """Whether both sides succeeded, or neither."""
        return self.native_success == self.our_success


def compare(
    native: Side,
    ours: Side,
    episodes: Iterable[Episode],
    *,
    history: History = "fresh",
    on_step: Callable[[int], object] = lambda count: None,
) -> Generator[EpisodeResult]:
    """Play episodes on both sides and yield what each comparison found.

    Episodes are played as many at a time as there are environments. Both sides must have had the
    same past when this begins, unless ``history`` is ``"fresh"``.

    Args:
        native: The reference.
        ours: The side under test, with as many environments.
        episodes: What to play.
        history: ``"fresh"`` rebuilds the scenes before every episode, ``"reused"`` only resets
            them, so that PhysX remembers the episode before.
        on_step: Called after every step with the number of episodes that it advanced.

    Raises:
        TaskError: If the sides differ in size or an action does not fit.
    """
    if (native.num_envs, native.action_dim) != (ours.num_envs, ours.action_dim):
        raise TaskError(
            f"native has {native.num_envs} environment(s) with {native.action_dim} action numbers,"
            f" the other side {ours.num_envs} with {ours.action_dim}: they cannot be compared"
        )
    waiting = iter(episodes)
    while batch := list(islice(waiting, native.num_envs)):
        yield from _compare_batch(native, ours, batch, history == "fresh", on_step)


def _compare_batch(
    native: Side,
    ours: Side,
    batch: Sequence[Episode],
    rebuild: bool,
    on_step: Callable[[int], object],
) -> list[EpisodeResult]:
    results = [EpisodeResult(episode.seed, len(episode.actions)) for episode in batch]
    seeds, env_ids = [episode.seed for episode in batch], range(len(batch))
    first, second = (side.reset(seeds, env_ids, rebuild=rebuild) for side in (native, ours))
    _note_differences(0, dict(enumerate(results)), first, second)
    for step in range(1, max(result.steps for result in results) + 1):
        playing = {i: result for i, result in enumerate(results) if step <= result.steps}
        actions = np.zeros((native.num_envs, native.action_dim), np.float32)
        for i in playing:
            actions[i] = batch[i].actions[step - 1]
        first, second = native.step(actions), ours.step(actions)
        _note_differences(step, playing, first, second)
        touching = native.touching()
        for i, result in playing.items():
            result.contact_steps += bool(touching[i])
            result.native_success |= succeeds(first, i)
            result.our_success |= succeeds(second, i)
        on_step(len(playing))
    return results


def _note_differences(
    step: int, playing: Mapping[int, EpisodeResult], first: Snapshot, second: Snapshot
) -> None:
    for key in differing(first, second):
        a, b = first.get(key), second.get(key)
        for i, result in playing.items():
            if a is None or b is None or i >= len(a) or i >= len(b):
                delta = np.inf
            else:
                delta = largest_difference(a[i], b[i])
            if delta > 0:
                quantity, entry = key
                result.max_difference[quantity] = max(result.max_difference[quantity], delta)
                if result.first_difference is None:
                    result.first_difference = FirstDifference(step, quantity, entry)


def succeeds(snapshot: Snapshot, row: int = 0) -> bool:
    """Tell whether an environment reports success."""
    flags = snapshot.get(("info", "success"))
    return flags is not None and bool(np.all(flags[row]))


@dataclass(frozen=True)
class Run:
    """Episodes of one task, played one way.

    Attributes:
        task: Task id.
        source: Where the actions come from, in a few words.
        episodes: What to play.
        history: ``"fresh"`` or ``"reused"``.
        reward_mode: Reward mode of both sides.
        num_envs: How many environments play at once.
        control_mode: Control mode of both sides.
    """

    task: str
    source: str
    episodes: tuple[Episode, ...]
    history: History
    reward_mode: str
    num_envs: int = 1
    control_mode: str = CONTROL_MODES[0]

    @property
    def steps(self) -> int:
        """Control steps of all episodes together."""
        return sum(len(episode.actions) for episode in self.episodes)


@dataclass(frozen=True)
class RunResult:
    """What a run found.

    Attributes:
        run: What was played.
        episodes: What the comparison of each episode found, in order.
    """

    run: Run
    episodes: tuple[EpisodeResult, ...]

    @property
    def equal(self) -> bool:
        """Whether at least one episode was played and nothing differs in any."""
        return bool(self.episodes) and all(episode.equal for episode in self.episodes)

    @property
    def contact_steps(self) -> int:
        """Steps in which a robot was touching a movable object."""
        return sum(episode.contact_steps for episode in self.episodes)

    @property
    def max_difference(self) -> dict[str, float]:
        """Largest |Δ| by quantity over all episodes."""
        return {
            quantity: max((e.max_difference[quantity] for e in self.episodes), default=0.0)
            for quantity in QUANTITIES
        }

    @property
    def successes(self) -> tuple[int, int, int]:
        """Number of episodes in which native, our side, and both succeeded."""
        return (
            sum(episode.native_success for episode in self.episodes),
            sum(episode.our_success for episode in self.episodes),
            sum(episode.native_success and episode.our_success for episode in self.episodes),
        )


def play(runs: Sequence[Run], on_step: Callable[[Run, int], object]) -> list[RunResult]:
    """Play runs one after the other, each with environments of its own.

    Args:
        runs: What to play.
        on_step: Called after every step with the run and how many episodes it advanced.

    Raises:
        RobotLayoutsError: If a side cannot be made or an action does not fit.
    """
    return [_play_one(run, on_step) for run in runs]


def _play_one(run: Run, on_step: Callable[[Run, int], object]) -> RunResult:
    making: dict[str, Any] = {"reward_mode": run.reward_mode, "control_mode": run.control_mode}
    with (
        closing(tasks.make(run.task, num_envs=run.num_envs, **making)) as env,
        closing(NativeSide(env.task_id, num_envs=run.num_envs, **making)) as native,
    ):
        gc.freeze()  # native collects garbage at each rebuild, in 0.2 s unless frozen
        try:
            found = compare(
                native,
                OurSide(env),
                run.episodes,
                history=run.history,
                on_step=lambda count: on_step(run, count),
            )
            return RunResult(run, tuple(found))
        finally:
            gc.unfreeze()

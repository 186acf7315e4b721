"""Checks what a task is asked for, and what its methods return.

What methods return is checked in full when the task is made; names and shapes are ever after. A
wrong shape spreads as far as NaN does: rewards of shape (N, 1) become (N, N) in a loss.
"""

from __future__ import annotations

import operator
from collections.abc import Collection, Generator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, NoReturn, SupportsIndex

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

from robot_layouts.core.bounds import checked_flag, shown
from robot_layouts.simulation import State
from robot_layouts.simulation.maths import Array
from robots import TaskError, unknown_name_message
from tasks.arrays import array_of
from tasks.engine.outcome import ELAPSED, FAILED, SOLVED

RECONFIGURE = "reconfigure"  # option of a reset, and in its info: whether worlds are rebuilt
INSTRUCTION = "instruction"  # in info, of tasks that have several: what is to be done
SEED = "seed"  # in the info of interfaces: what the random streams began with
SUCCESS = "is_success"  # there, too: what other packages call success


def checked_ids(env_ids: Sequence[int] | None, num_envs: int) -> list[int]:
    """Return environment numbers as a list, all if None.

    Raises:
        TaskError: If they are no different numbers of environments.
    """
    if env_ids is None:
        return list(range(num_envs))
    if _has_flags(env_ids):
        raise TaskError(
            f"env_ids is {shown(env_ids)}; it takes numbers of environments, not a mask:"
            " numpy.flatnonzero(mask) gives them"
        )
    try:
        ids = [operator.index(i) for i in env_ids]
    except (TypeError, ValueError, RuntimeError):
        raise TaskError(f"env_ids is {shown(env_ids)}; it takes a sequence of integers") from None
    wrong = [i for i in ids if not 0 <= i < num_envs]
    if wrong or len(set(ids)) != len(ids):
        raise TaskError(f"env_ids {shown(ids)} must be different numbers from 0 to {num_envs - 1}")
    return ids


def checked_seeds(seed: int | Sequence[int | None] | None, ids: Sequence[int]) -> list[int | None]:
    """Return the seed of each environment in ``ids``; None where its streams run on.

    Raises:
        TaskError: If they are no seeds, or not as many as environments.
    """
    if seed is None:
        return [None] * len(ids)
    try:
        seeds = _integers(seed, ids)
    except (TypeError, ValueError, RuntimeError):
        raise TaskError(f"seed is {shown(seed)}; it takes an integer or a list of them") from None
    if len(seeds) != len(ids):
        raise TaskError(f"{len(seeds)} seeds for {len(ids)} environments")
    if not all(s is None or 0 <= s < 2**32 for s in seeds):
        raise TaskError(f"seeds {shown(seeds)} must lie from 0 to 2**32 - 1")
    return seeds


def checked_options(options: Mapping[str, Any] | None) -> Mapping[str, Any]:
    """Return the options of a reset; none if None.

    Options that are not ours pass: interfaces are given those of other packages, and ignore them.

    Raises:
        TaskError: If they are no mapping, or ``reconfigure`` is no truth value.
    """
    if options is None:
        return {}
    if not isinstance(options, Mapping):
        raise TaskError(
            f"options is {shown(options)}; it takes a mapping: {{{RECONFIGURE!r}: True}}"
        )
    checked_flag(f"the option {RECONFIGURE!r}", options.get(RECONFIGURE, False), TaskError)
    return options


def wants_rebuild(options: Mapping[str, Any] | None) -> bool:
    """Return whether the options of a reset ask for new worlds.

    Raises:
        TaskError: If they are invalid, or one does not exist.
    """
    known = own_options(options)
    for key in options or ():
        if key not in known:
            raise TaskError(unknown_name_message("reset option", key, known))
    return known[RECONFIGURE]


def own_options(options: Mapping[str, Any] | None) -> dict[str, bool]:
    """Return those options of a reset that tasks know; the others are left out.

    Raises:
        TaskError: See `checked_options`.
    """
    return {RECONFIGURE: bool(checked_options(options).get(RECONFIGURE, False))}


def check_info(task: str, info: Collection[str]) -> None:
    """Refuse keys of a task's ``evaluate()`` that info has already, of its own or of interfaces.

    Raises:
        TaskError: If there is one.
    """
    taken = [key for key in (RECONFIGURE, SEED, SUCCESS) if key in info]
    if taken:
        raise TaskError(
            f"{task}.evaluate() returned {', '.join(taken)}, which info already has; call it"
            " something else"
        )


def _integers(
    seed: SupportsIndex | Sequence[int | None] | NDArray[Any] | Tensor, ids: Sequence[int]
) -> list[int | None]:
    """Return one integer per environment, or several as they are given."""
    if isinstance(seed, (str, bytes)) or _has_flags(seed):
        raise TypeError(seed)
    if isinstance(seed, Sequence) or (isinstance(seed, (np.ndarray, Tensor)) and seed.ndim == 1):
        return [None if s is None else operator.index(s) for s in seed]
    return [operator.index(seed) + i for i in ids]  # pyright: ignore[reportArgumentType]


def _has_flags(values: Any) -> bool:
    """Whether values are truth values, which Python and torch take for the numbers 0 and 1."""
    if isinstance(values, (np.ndarray, Tensor)):
        return "bool" in str(values.dtype)
    if isinstance(values, (list, tuple)):
        return any(map(_has_flags, values))
    return isinstance(values, (bool, np.bool_))


# -- what methods return --------------------------------------------------------------------------


class ReturnedArrays:
    """What a method returns that gives arrays by name: always the same names, shapes and types.

    Attributes:
        method: The method in words, ``TwoArmTray.evaluate()``.
    """

    def __init__(
        self,
        method: str,
        num_envs: int,
        *,
        axes: int | None = None,
        judges: bool = False,
        open_ended: bool = False,
    ) -> None:
        """Take what is known before it is called.

        Args:
            method: The method in words.
            num_envs: Number of environments N.
            axes: How many axes each array may have; None for any number.
            judges: Whether it is `evaluate`, whose arrays include ``success``, of flags, and may
                include ``fail``.
            open_ended: Whether it may not include ``success``.
        """
        self.method = method
        self._num_envs, self._axes = num_envs, axes
        self._judges, self._open_ended = judges, open_ended
        self._names: list[str] | None = None  # as long as it was not called
        self._forms: list[tuple[np.dtype[Any], tuple[int, ...]]] = []

    def checked(self, values: Any) -> Mapping[str, NDArray[Any]]:
        """Return what was returned; it is looked at closely if it is not as at first.

        Raises:
            TaskError: If it is wrong; says what it must be.
        """
        if type(values) is dict and list(values) == self._names:
            try:  # arrays; all else is looked at
                for array, form in zip(values.values(), self._forms, strict=True):
                    if (array.dtype, array.shape) != form:
                        break
                else:
                    return values
            except AttributeError:
                pass
        return self._looked_at(values)

    def _looked_at(self, values: Any) -> dict[str, NDArray[Any]]:
        if not isinstance(values, Mapping):
            raise TaskError(
                f"{self.method} returned {_given(values)}; it must return a dict of arrays by name"
            )
        arrays = {name: self._array(name, value) for name, value in values.items()}
        if self._names is None:
            self._check_first(arrays)
            self._names = list(arrays)
            self._forms = [(x.dtype, x.shape) for x in arrays.values()]
        elif arrays.keys() != set(self._names):
            self._refuse_names(arrays, self._names)
        for name, (dtype, shape) in zip(self._names, self._forms, strict=True):
            array = arrays[name]
            if (array.dtype, array.shape) != (dtype, shape):
                raise TaskError(
                    f"{self.method} returned {name!r} as {_form(array)}; at first it was"
                    f" {dtype} of shape {shape}, and must stay that"
                )
        return arrays

    def _check_first(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        if not self._judges:
            return
        if self._open_ended and SOLVED in arrays:
            raise TaskError(
                f"{self.method} returned {SOLVED!r}, and the task says open_ended = True; drop one"
                " of the two"
            )
        if not self._open_ended and SOLVED not in arrays:
            raise TaskError(
                f"{self.method} returned no {SOLVED!r}, (N,) bool, which says where the task is"
                f" solved; it returned: {', '.join(arrays) or 'nothing'}. A task that is never"
                " solved says open_ended = True"
            )
        if ELAPSED in arrays:
            raise TaskError(
                f"{self.method} returned {ELAPSED}, which info already has; call it something else"
            )
        for name in {SOLVED, FAILED} & arrays.keys():
            if arrays[name].dtype != bool:
                raise TaskError(
                    f"{self.method} returned {name!r} as {_form(arrays[name])}; it must be bool,"
                    " as comparisons give it: distance <= 0.02"
                )

    def _refuse_names(self, arrays: Mapping[str, NDArray[Any]], names: Sequence[str]) -> NoReturn:
        more = [name for name in arrays if name not in names]
        less = [name for name in names if name not in arrays]
        changes = [
            f"{what} {', '.join(map(repr, changed))}"
            for what, changed in (("it has", more), ("it lacks", less))
            if changed
        ]
        raise TaskError(
            f"{self.method} returned other names than at first ({' and '.join(changes)}); it must"
            " return the same ones every time"
        )

    def _array(self, name: object, value: Any) -> NDArray[Any]:
        what = f"{self.method} returned {shown(name)} as"
        if not isinstance(name, str) or not name:
            raise TaskError(f"{self.method} returned the name {shown(name)}; names must be texts")
        most = 1 if self._judges and name in (SOLVED, FAILED) else self._axes
        shape = _shape_text(self._num_envs, most)
        array = _as_array(value, what, f"an array of shape {shape}")
        if not 1 <= array.ndim <= (most or array.ndim) or len(array) != self._num_envs:
            advice = _advice(array, self._num_envs)
            raise TaskError(f"{what} {_form(array)}; it must have shape {shape}{advice}")
        return array


class ReturnedReward:
    """What a method returns that gives rewards: always floating, (N,), and of one type.

    Attributes:
        dtype: Their type; None as long as there was none.
    """

    def __init__(self, method: str, num_envs: int, *, double: bool = False) -> None:
        """Take the method in words, the number of environments N, and what to make of rewards.

        Args:
            method: In words.
            num_envs: N.
            double: Whether rewards become float64; else float32.
        """
        self._method, self._num_envs = method, num_envs
        self._kept = np.float64 if double else np.float32
        self._shape = (num_envs,)
        self.dtype: np.dtype[Any] | None = None

    def checked(self, reward: Any) -> NDArray[Any]:
        """Return a reward as float32, or as float64 if it is to become that.

        Raises:
            TaskError: If it is not a valid reward; says what it must be.
        """
        if type(reward) is not np.ndarray or reward.dtype != self.dtype:
            reward = self._looked_at(reward)
        if reward.shape != self._shape:
            raise TaskError(
                f"{self._method} returned {_form(reward)}; it must have shape {self._shape}"
                f"{_advice(reward, self._num_envs)}"
            )
        return np.asarray(reward, self._kept)

    def _looked_at(self, reward: Any) -> NDArray[Any]:
        needed = f"a floating array of shape {self._shape}, one reward for each environment"
        array = _as_array(reward, f"{self._method} returned", needed)
        if array.dtype.kind != "f":
            raise TaskError(
                f"{self._method} returned {_form(array)}; it must be {needed}: tasks.maths.floats"
                " makes one of flags"
            )
        if self.dtype not in (None, array.dtype):
            raise TaskError(
                f"{self._method} returned {array.dtype}; at first it was {self.dtype}, and must"
                " stay that"
            )
        self.dtype = array.dtype
        return array


_EFFECTS = {
    "build": "it adds bodies to a world, world.add(…)",
    "sample": "it places bodies, world.set_pose(…)",
    "begin_episodes": "it sets what the task remembers, self.memory.…",
    "respond": "it moves bodies, self.simulation.place(…)",
    "reset_robots": "it stands robots, self.stand(world, …)",
}


def expect_nothing(task: object, method: str, returned: object) -> None:
    """Refuse that a method returns something, which would be ignored.

    Args:
        task: Whose method.
        method: Its name.
        returned: What it returned.

    Raises:
        TaskError: If that is not None.
    """
    if returned is not None:
        raise TaskError(
            f"{type(task).__name__}.{method}() returned {shown(returned)}, which has no effect;"
            f" {_EFFECTS[method]}, and returns nothing"
        )


@contextmanager
def unchanged(state: State, method: str) -> Generator[None]:
    """Look whether a method changes the state that it is given.

    Raises:
        TaskError: If it does: what comes after it would see another world than there is.
    """
    parts = (
        ("poses", state.all_poses),
        ("joint positions", state.joint_positions),
        ("joint velocities", state.joint_velocities),
    )
    before = [part.copy() for _, part in parts]
    yield
    for (name, part), earlier in zip(parts, before, strict=True):
        if not np.array_equal(part, earlier):
            raise TaskError(
                f"{method} changed the {name} of the state, which share its memory; change a copy:"
                " tasks.maths.copy(x)"
            )


def _as_array(value: Any, what: str, needed: str) -> NDArray[Any]:
    if not isinstance(value, (np.ndarray, np.generic, Tensor)):
        raise TaskError(f"{what} {_given(value)}; it must be {needed}")
    array = array_of(value, f"{what} what", TaskError)
    if array.dtype.kind not in "fiub":
        raise TaskError(f"{what} {_form(array)}; it must be {needed}, of numbers or flags")
    return array


def _shape_text(num_envs: int, most: int | None) -> str:
    match most:
        case 1:
            return f"({num_envs},)"
        case 2:
            return f"({num_envs},) or ({num_envs}, k)"
        case _:
            return f"({num_envs}, …)"


def _given(value: object) -> str:
    if isinstance(value, (np.ndarray, Tensor)):
        return f"an array, {value.dtype} of shape {tuple(value.shape)}"
    return f"a {type(value).__name__}" if isinstance(value, (list, tuple, dict)) else shown(value)


def _form(array: Array) -> str:
    if array.ndim == 0:
        return f"the single {array.dtype} {array}"
    return f"{array.dtype} of shape {array.shape}"


def _advice(array: Array, num_envs: int) -> str:
    """Return what to change, if that is plain."""
    if array.ndim == 0:
        return ", one for each environment: x[:, 2], not x[0, 2]; x.any(1), not x.any()"
    if array.ndim > 1 and array.shape[0] == num_envs and array.shape[-1] == 1:
        return "; [..., 0] leaves the last axis out"
    if array.shape[0] != num_envs:
        return f": the first axis counts the environments, of which there are {num_envs}"
    return ""

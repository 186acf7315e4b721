"""Checks what a task's class declares, before anything is built of it."""

from __future__ import annotations

import inspect
import warnings
from collections.abc import Callable, Iterator, Mapping
from difflib import get_close_matches
from functools import lru_cache
from types import FunctionType
from typing import Any

from layouts import Layout
from robot_layouts.core.bounds import (
    checked_flag,
    checked_number,
    checked_numbers,
    checked_whole,
    shown,
)
from robot_layouts.simulation import Camera, PhysicsSettings
from robots import TaskError
from tasks.engine.task import DENSE_MODES, Task
from tasks.language.bodies import Body, Surroundings
from tasks.language.stages import check_stages
from tasks.randomization.declaration import Randomization

HOOKS = {
    "design": ("rng",),
    "build": ("world",),
    "sample": ("world", "rng"),
    "evaluate": ("state",),
    "observe": ("state", "info"),
    "dense_reward": ("state", "action", "info"),
    "remember": ("state",),
    "begin_episodes": ("state", "env_ids"),
    "begin_step": (),
    "respond": ("state",),
    "reset_robots": ("world", "rng"),
}
"""What a class may define, and what it is called with."""

_ATTRIBUTES = tuple(name for name in Task.__annotations__ if not name.startswith("_"))
_TASKS_OWN = frozenset((*_ATTRIBUTES, *vars(Task)))
_STEPPING = ("__init__", "__new__", "reset", "step", "advance", "render", "close")
_ALIKE = 0.85  # of two names, 1 being the same; below it one is hardly meant for the other
_STEPS = 2**31 - 1

_NEEDED: dict[str, tuple[Callable[[Any], bool], str]] = {
    "layout": (
        lambda given: isinstance(given, Layout),
        "a layouts.Layout is needed, such as layouts.single({'arm': 'panda'})",
    ),
    "robot_counts": (
        lambda given: given is None or (isinstance(given, range) and bool(given)),
        "a range of 1 or more numbers is needed, such as range(2, 5) for two to four robots",
    ),
    "reward_modes": (
        lambda given: _is_row(given, str) and bool(given) and {*given} <= {*DENSE_MODES},
        f"a tuple of {', '.join(DENSE_MODES)} is needed, the default first",
    ),
    "physics": (
        lambda given: isinstance(given, PhysicsSettings | None),
        "tasks.PhysicsSettings or None is needed",
    ),
    "randomization": (
        lambda given: isinstance(given, Randomization | None),
        "a tasks.Randomization or None is needed",
    ),
    "sensed": (
        lambda given: _is_row(given, str),
        "a tuple of names is needed, such as ('*tcp_pose',) with its comma",
    ),
    "instruction": (
        lambda given: isinstance(given, str) or (_is_row(given, str) and bool(given)),
        "a sentence is needed, or a tuple of some that say the same",
    ),
    "varied": (
        lambda given: isinstance(given, Mapping),
        "axes of a tasks.Randomization are needed, such as {'mass': {'cube': Uniform(0.5, 2)}}",
    ),
    "cameras": (
        lambda given: _is_row(given, Camera, list),
        "a tuple of tasks.Camera is needed, such as (Camera((0.3, 0, 0.6), (0, 0, 0.1)),) with its"
        " comma",
    ),
    "viewpoint": (
        lambda given: _is_row(given, object, list) and len(given) == 2,
        "the camera's position and target are needed (m)",
    ),
    "table": (
        lambda given: isinstance(given, Surroundings),
        "a tasks.Surroundings is needed, such as tasks.Table(), and other bodies go by other names",
    ),
}
"""What an attribute must be: whether it is, and in words."""


def _is_row(given: Any, kind: type, *more: type) -> bool:
    """Return whether something is a tuple, or what else may be, of things of one kind."""
    return isinstance(given, (tuple, *more)) and all(isinstance(x, kind) for x in given)


@lru_cache(maxsize=1024)
def check_declaration(cls: type[Task]) -> None:
    """Refuse a task's class that cannot work.

    Args:
        cls: The class.

    Raises:
        TaskError: If something is missing or wrong; says what it must be.

    Warns:
        UserWarning: If it defines what nothing calls, under nearly the name of what is called.
    """
    task, known = cls.__name__, {name for base in cls.__mro__ for name in vars(base)}
    if "layout" not in known:
        raise TaskError(
            f"{task} sets no layout: which robots stand where, such as"
            f" layout = layouts.single({{'arm': 'panda'}}){_meant(cls, 'layout')}"
        )
    if "max_episode_steps" not in known:
        raise TaskError(
            f"{task} sets no max_episode_steps: after how many control steps an episode is"
            f" truncated, such as max_episode_steps = 100{_meant(cls, 'max_episode_steps')}"
        )
    if cls.evaluate is Task.evaluate:
        raise TaskError(
            f"{task} does not define evaluate(self, state), which says where it is solved:"
            f" {{'success': (N,) bool}}{_meant(cls, 'evaluate')}"
        )
    for name, arguments in HOOKS.items():
        _check_hook(cls, name, arguments)
    _check_attributes(cls)
    _check_bodies(cls)
    for name, value in _own(cls):
        if name in _STEPPING and isinstance(value, FunctionType):
            raise TaskError(
                f"{task} defines {name}, which nothing calls: tasks are stepped by tasks.TaskEnv,"
                f" and define {', '.join(HOOKS)}"
            )
    for name, hook in _nearly_hooks(cls):
        warnings.warn(
            f"{task} defines {name!r}, which nothing calls. Did you mean {hook!r}?", stacklevel=3
        )


def _check_hook(cls: type[Task], name: str, arguments: tuple[str, ...]) -> None:
    task, hook = cls.__name__, inspect.getattr_static(cls, name)
    if hook is vars(Task)[name]:
        return
    written = f"def {name}({', '.join(('self', *arguments))})"
    method = getattr(cls, name)
    if not callable(method):
        raise TaskError(f"{task}.{name} is {shown(method)}; it must be a method: {written}")
    given = arguments if isinstance(hook, (staticmethod, classmethod)) else ("self", *arguments)
    try:
        signature = inspect.signature(method)
    except (TypeError, ValueError):  # of something not written in Python
        return
    try:
        signature.bind(*given)
    except TypeError:
        raise TaskError(f"{task}.{name} takes {signature}; it is called as {written}") from None
    if inspect.iscoroutinefunction(method) or inspect.isgeneratorfunction(method):
        raise TaskError(f"{task}.{name} must return its result; it has async or yield")


def _check_attributes(cls: type[Task]) -> None:
    task = cls.__name__
    for name, (fits, needed) in _NEEDED.items():
        if not fits(given := getattr(cls, name)):
            raise TaskError(f"{task}.{name} is {shown(given)}; {needed}")
    if cls.robot_counts is not None and len(cls.layout.arms) not in cls.robot_counts:
        raise TaskError(
            f"{task}.layout has {len(cls.layout.arms)} robots, which are not in its robot_counts,"
            f" {cls.robot_counts}"
        )
    if cls.dense_reward is Task.dense_reward and {"dense", "normalized_dense"} & {
        *cls.reward_modes
    }:
        raise TaskError(
            f"{task}.reward_modes has {cls.reward_modes[0]!r}, but it does not define"
            f" dense_reward(self, state, action, info){_meant(cls, 'dense_reward')}"
        )
    check_stages(task, cls.stages)
    checked_whole(f"{task}.max_episode_steps", cls.max_episode_steps, 1, _STEPS, TaskError)
    checked_number(f"{task}.max_reward", cls.max_reward, 1e-6, 1e6, TaskError)
    checked_number(f"{task}.control_frequency", cls.control_frequency, 0.1, 1e5, TaskError, "Hz")
    checked_whole(f"{task}.first_seed", cls.first_seed, 0, 2**32 - 1, TaskError)
    checked_flag(f"{task}.rebuilds", cls.rebuilds, TaskError)
    checked_flag(f"{task}.double_rewards", cls.double_rewards, TaskError)
    checked_flag(f"{task}.open_ended", cls.open_ended, TaskError)
    for what, point in zip(("position", "target"), cls.viewpoint, strict=True):
        checked_numbers(f"{task}.viewpoint's {what}", point, 3, 1e6, TaskError, "m")


def _check_bodies(cls: type[Task]) -> None:
    task = cls.__name__
    for base in reversed(cls.__mro__):
        for name, value in vars(base).items():
            if isinstance(value, type) and issubclass(value, (Body, Surroundings)):
                raise TaskError(
                    f"{task}.{name} is the class {value.__name__}; a body is one that it makes:"
                    f" {name} = {value.__name__}(…)"
                )
    for name in cls.bodies:
        if name != "table" and name in _TASKS_OWN:
            raise TaskError(
                f"{task}.{name} is a body, but {name!r} is a name that every task has for something"
                " else; call it something else"
            )


def _own(cls: type) -> Iterator[tuple[str, Any]]:
    """Yield what a task's class has beyond what every task has."""
    for base in cls.__mro__:
        if not base.__module__.startswith("tasks.engine."):
            yield from vars(base).items()


def _meant(cls: type[Task], name: str) -> str:
    """Return the name of the class's own that was meant for ``name``, if there is one."""
    names = [own for own, _ in _own(cls) if not own.startswith("_") and own not in HOOKS]
    match = get_close_matches(name, names, 1, _ALIKE)
    return f". Is {match[0]!r} meant to be it?" if match else ""


def _nearly_hooks(cls: type[Task]) -> Iterator[tuple[str, str]]:
    """Yield methods that nothing of the class uses, and what each may have been meant for."""
    own = dict(_own(cls))
    missing = [name for name in (*HOOKS, *_ATTRIBUTES) if name not in own]
    used = {name for value in own.values() for name in _names_in(value)}
    for name, value in own.items():
        if name.startswith("_") or name in used or isinstance(value, Body):
            continue
        if name in _TASKS_OWN:
            continue
        if match := get_close_matches(name, missing, 1, _ALIKE):
            yield name, match[0]


def _names_in(value: object) -> tuple[str, ...]:
    function: Callable[..., Any] | object = getattr(value, "__func__", value)
    function = inspect.unwrap(function) if isinstance(function, FunctionType) else function
    return function.__code__.co_names if isinstance(function, FunctionType) else ()

"""A task in words and numbers, for people: one line of a list, or everything about it."""

from __future__ import annotations

import inspect
import json
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import degrees
from pathlib import Path
from typing import Any, cast

from rich import box
from rich.console import RenderableType
from rich.table import Table

from layouts import Layout
from robot_layouts.simulation import Camera
from robot_layouts.simulation.backend import CLONING
from robot_layouts.simulation.cameras import AnyCamera, field_of_view, lens_of, ridden
from robots import TaskError
from tasks.engine.cameras import cameras_of
from tasks.engine.env import MultiRobotTask, TaskEnv
from tasks.registry import full_name, get_task_class, make, origin, other_names

# Written by ``python -m parity compare --all --record``; in a checkout and in the wheel.
PARITY_RESULTS = Path(__file__).with_name("parity.json")
UNKNOWN = "–"
LONG = 42  # letters
OURS = "robot-layouts"  # where built-in tasks come from
OWN_SOURCE = f"{OURS}; geometry and rewards are its own"  # of those that follow no other's file

_SUCCESS = "Success:"
_SECTIONS = ("Attributes:", "Args:", "Note:", "Example:", "Examples:")  # of Google docstrings


@dataclass(frozen=True)
class TaskFacts:
    """What a list of tasks says about one.

    Attributes:
        task_id: Its id.
        robots: The robots of its default layout, in words.
        action_size: Numbers of one action.
        observation_size: Numbers of one flat observation; None if that is not known.
        max_episode_steps: Control steps until an episode is truncated.
        reward_modes: Its reward modes, the default first.
        origin: The package or module that it comes from.
    """

    task_id: str
    robots: str
    action_size: int
    observation_size: int | None
    max_episode_steps: int
    reward_modes: tuple[str, ...]
    origin: str = OURS


@dataclass(frozen=True)
class Docstring:
    """What a task's docstring says.

    Attributes:
        summary: Its first paragraph.
        randomization: What is drawn at a reset; empty if it does not say.
        success: When it is done, without the word "Success:"; empty if it does not say.
    """

    summary: str
    randomization: str
    success: str


def facts(task_id: str) -> TaskFacts:
    """Return the facts about a task; makes one environment, to count its observation.

    Raises:
        UnknownNameError: If there is no such task.
        AssetError: If robot files cannot be found.
    """
    env = make(task_id)
    try:
        return replace(declared_facts(task_id), observation_size=observation_size(env))
    finally:
        env.close()


def declared_facts(task_id: str, observation_size: int | None = None) -> TaskFacts:
    """Return what a task's class says by itself; needs no robot files.

    Args:
        task_id: Its id or another of its names.
        observation_size: What is known about it from elsewhere.

    Raises:
        UnknownNameError: If there is no such task.
    """
    cls = get_task_class(task_id)
    return TaskFacts(
        cls.task_id,
        robots_text(cls.layout),
        cls.layout.action_dim,
        observation_size,
        cls.max_episode_steps,
        cls.reward_modes,
        origin(cls.task_id) or OURS,
    )


def robots_text(layout: Layout) -> str:
    """Return a layout's robots in words, in order: ``2 × panda_wristcam``.

    How many they are, if that is long and there are several.
    """
    counts = Counter(placement.robot.name for placement in layout.values())
    words = " + ".join(f"{n} × {name}" if n > 1 else name for name, n in counts.items())
    if len(words) <= LONG or len(layout) == 1:
        return words
    return f"{len(layout)} robots of {len(counts)} kinds"


def parity_verdicts(path: Path = PARITY_RESULTS) -> dict[str, str]:
    """Return task id → ``"bitwise"`` or ``"differs"``, as it was last recorded; empty if never.

    Raises:
        TaskError: If the record cannot be read.
    """
    equal = _recorded(path, "equal")
    return {task: "bitwise" if same else "differs" for task, same in equal.items()}


def recorded_sizes(path: Path = PARITY_RESULTS) -> dict[str, int]:
    """Return task id → numbers of its observation, as they were last recorded; empty if never.

    Raises:
        TaskError: If the record cannot be read.
    """
    return _recorded(path, "observation_size")


def _recorded(path: Path, key: str) -> dict[str, Any]:
    if not path.is_file():
        return {}
    try:
        entries: dict[str, Any] = json.loads(path.read_text())["tasks"]
        return {task: entry[key] for task, entry in entries.items()}
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise TaskError(f"{path} is not a record of comparisons: {error!r}") from error


def list_table(tasks: Iterable[TaskFacts], verdicts: dict[str, str]) -> Table:
    """Return one row per task.

    Args:
        tasks: Their facts.
        verdicts: Task id → verdict of the comparison with native.
    """
    columns = ("task", "robots", "action", "obs", "steps", "rewards", "parity", "from")
    rows = _table(*columns, numbers=(2, 3, 4))
    for task in tasks:
        rows.add_row(
            task.task_id,
            task.robots,
            str(task.action_size),
            UNKNOWN if task.observation_size is None else str(task.observation_size),
            str(task.max_episode_steps),
            short_modes(task.reward_modes),
            verdicts.get(task.task_id, UNKNOWN),
            task.origin,
        )
    return rows


def short_modes(modes: Sequence[str]) -> str:
    """Return reward modes in few words: ``norm`` for ``normalized_dense``."""
    return " ".join(mode.replace("normalized_dense", "norm") for mode in modes)


def read_docstring(cls: type[MultiRobotTask]) -> Docstring:
    """Return the parts of a task's own docstring, each on one line."""
    paragraphs = inspect.cleandoc(cls.__doc__ or "").split("\n\n")
    prose = [" ".join(p.split()) for p in paragraphs if not p.lstrip().startswith(_SECTIONS)]
    first, *others = prose or [""]
    summary, _, success = (part.strip() for part in first.partition(_SUCCESS))
    drawn: list[str] = []
    for paragraph in others:
        before, _, after = (part.strip() for part in paragraph.partition(_SUCCESS))
        drawn.append(before)
        success = success or after
    return Docstring(summary, "\n".join(filter(None, drawn)), success)


def instruction_of(cls: type[MultiRobotTask], seed: int = 0) -> str:
    """Return what robots are told to do in the episode of a seed, in a sentence."""
    if isinstance(cls.instruction, tuple):
        return cls.instruction[seed % len(cls.instruction)]
    return cls.instruction or read_docstring(cls).summary


def describe(env: TaskEnv) -> Iterator[RenderableType]:
    """Yield everything there is to know about a task, as lines and tables to print.

    Args:
        env: The task, with flat observations.
    """
    cls = env.task_class
    text = read_docstring(cls)
    yield f"{cls.task_id}: {text.summary}\n"
    rows = Table(box=None, show_header=False, padding=(0, 2, 0, 0))
    if env.scenario.simulator != CLONING:
        rows.add_row("simulator", env.scenario.simulator)
    for name, value in (
        ("randomization", text.randomization),
        ("success", text.success),
        ("episode", f"{env.max_episode_steps} steps, {env.scenario.control_frequency:g} per s"),
        ("reward modes", ", ".join([f"{cls.reward_modes[0]} (default)", *cls.reward_modes[1:]])),
        ("source", source_of(cls)),
        ("other names", ", ".join([*_full_name(cls), *other_names(cls)])),
        ("from", origin(cls.task_id) or OURS),
        ("parity", _parity(env)),
    ):
        rows.add_row(name, value or UNKNOWN)
    phrasings = cls.instruction if isinstance(cls.instruction, tuple) else ()
    for i, phrasing in enumerate(phrasings):
        rows.add_row("" if i else "instruction", phrasing)
    if cls.stages:
        scores = ", ".join(f"{name} {score:g}" for name, score in cls.stages.items())
        rows.add_row("stages", scores)
    yield rows
    if cls.fits():
        yield f"\nFits its robots: {fit_text(env)}"
    yield f"\nLayout: {env.layout}\n"
    yield action_sentence(env.layout)
    yield action_table(env.layout)
    yield f"Observation, {observation_size(env)} numbers"
    yield observation_table(env.observation_slices, env.observer.senses)
    yield "Cameras, with obs_mode='rgb' or 'rgbd'; with images, only sensed parts are observed"
    yield camera_table(cameras_of(env.layout, env.task.cameras))


def source_of(cls: type[MultiRobotTask]) -> str:
    """Return which file a task follows, or whose it is; empty if that is not known."""
    return cls.source or ("" if origin(cls.task_id) else OWN_SOURCE)


def _parity(env: TaskEnv) -> str:
    verdict, simulator = parity_verdicts().get(env.task_id, ""), env.scenario.simulator
    if verdict and simulator != CLONING:
        return f"none: with simulator {simulator!r} it is the same task with other physics"
    return verdict


def fit_text(env: TaskEnv) -> str:
    """Return in words how a task's sizes and places fit the robots that it was made with."""
    fit = env.task.fit
    if fit.as_declared:
        return "these are its own; every length is as declared"
    return (
        f"every length is {fit.scale:.2f} times as declared, and its frame lies at"
        f" ({fit.x:.2f}, {fit.y:.2f}) m, turned by {degrees(fit.yaw):.0f}°"
    )


def _full_name(cls: type[MultiRobotTask]) -> list[str]:
    name = full_name(cls)
    return [] if name == cls.task_id else [name]


def observation_size(env: TaskEnv) -> int:
    """Return how many numbers the flat observation of a task has."""
    return max((part.stop for part in env.observation_slices.values()), default=0)


def action_sentence(layout: Layout) -> str:
    """Return how action numbers are to be read."""
    robots = (placement.robot for placement in layout.values())
    if all(number.normalised for robot in robots for number in robot.describe_action()):
        return "Action, each number from -1 to 1; numbers beyond are clipped"
    return "Action, joint positions in their units, not clipped; grippers from -1 to 1, clipped"


def action_table(layout: Layout) -> Table:
    """Return one row per action number: whose it is, and what its extremes do."""
    rows = _table("#", "robot", "number", "lowest", "highest", "unit", numbers=(0, 3, 4))
    for place, part in layout.action_split.items():
        for number in layout.arm(place).robot.describe_action():
            sign = "+" if number.relative else ""
            rows.add_row(
                str(part.start + number.index),
                place,
                number.name,
                f"{number.lower:{sign}g}",
                f"{number.upper:{sign}g}",
                number.unit,
            )
    return rows


def observation_table(slices: dict[str, slice], senses: Callable[[str], bool]) -> Table:
    """Return one row per named entry of the flat observation.

    Args:
        slices: Where each entry stands.
        senses: Whether real robots sense an entry, so that it is observed together with images.
    """
    rows = _table("entry", "slice", "size", "sensed", numbers=(1, 2))
    for name, part in slices.items():
        size, joints = str(part.stop - part.start), name.endswith((".qpos", ".qvel"))
        sensed = "yes" if joints or senses(name) else "no"
        rows.add_row(name, f"{part.start}:{part.stop}", size, sensed)
    return rows


def camera_table(cameras: Mapping[str, AnyCamera]) -> Table:
    """Return one row per camera: where it is, and how large and wide its images are."""
    rows = _table("camera", "place", "pixels", "view", numbers=(2, 3))
    for name, camera in cameras.items():
        if on := ridden(camera):
            place = f"on {on[0]}, link {on[1]}"
        else:
            place = _standing(cast("Camera", camera))
        lens, view = lens_of(camera), degrees(field_of_view(camera))
        rows.add_row(name, place, f"{lens.width} × {lens.height}", f"{view:.0f}°")
    return rows


def _standing(camera: Camera) -> str:
    way = f"turned by {_point(camera.quaternion)}" if camera.quaternion else ""
    return f"at {_point(camera.eye)}, {way or f'towards {_point(camera.target or ())} m'}"


def _point(place: Sequence[float]) -> str:
    return f"({', '.join(f'{x:g}' for x in place)})"


def _table(*columns: str, numbers: Sequence[int]) -> Table:
    rows = Table(box=box.SIMPLE_HEAD, pad_edge=False, collapse_padding=True)
    for i, column in enumerate(columns):
        rows.add_column(column, justify="right" if i in numbers else "left", no_wrap=True)
    return rows

"""A suite: which episodes are played of which tasks, in which layouts; it names itself by hash.

It is a YAML file, read with all that it includes, and written so that it needs no other.
"""

from __future__ import annotations

import json
import os
import re
import sys
from collections import Counter
from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from hashlib import sha256
from inspect import signature
from os import PathLike
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Any

import yaml

from layouts import Layout
from layouts.presets import PRESETS
from layouts.yaml_format import to_yaml
from robot_layouts.core.bounds import shown
from robot_layouts.core.writing import write_whole
from robot_layouts.data.playing.executor import checked_seeds
from robot_layouts.data.reading.json_files import spans_of
from robot_layouts.data.reading.provenance import descriptor_digest
from robots import LayoutError, RobotDescriptor, RobotLayoutsError, TaskError, UnknownNameError
from robots.named import robot_in_file
from robots.registry import ROBOTS
from robots.urdf.summary import asset_fingerprint
from tasks import MultiRobotTask
from tasks.engine.places import built_layout
from tasks.randomization.declaration import Randomization, read_data
from tasks.registry import full_name, get_task_class, make_scenario

if TYPE_CHECKING:
    from tasks.engine.scenario import MakingFields


FORMAT = 1
SHORT = 12  # digits of a hash that tell suites apart

MOST_SEEDS = 100_000  # of a case; a receipt of as many episodes can still be read

_SPAN = re.compile(r"(\d{1,10})(?:\s*-\s*(\d{1,10}))?")
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.+-]{0,99}")
SHIPPED = {"standard": Path(__file__).with_name("standard.yaml")}
"""Suites that come with the library, by name."""

SHARED = ("seeds", "control_mode", "obs_mode", "randomization")  # for all tasks, or for one
TOP = ("name", *SHARED, "policies", "tasks")
ENTRY = ("task", "name", *SHARED, "layout", "layouts")
OTHERS = "others"  # in a mapping of policies: every task that is not named
OWN = "own"  # the task's own layout

_HOW = f"{OWN!r}, a file, a preset ({{preset: ring, robots: …}}), or frames and robots"
_LINE = re.compile(r"^line \d+: ")  # of a text that is in no file


def read_seeds(value: Any) -> tuple[int, ...]:
    """Return the seeds that a value names, smallest first.

    Args:
        value: A whole number, a text such as ``"0-99"`` or ``"0-9, 20"``, or a list of these.

    Raises:
        TaskError: If it names none, or one twice, or more than `MOST_SEEDS`.
    """
    spans: list[range] = []
    for one in list(value) if isinstance(value, (list, tuple, range)) else [value]:
        whole = int(one) if isinstance(one, float) and one.is_integer() else one  # as files have it
        for part in str(whole).split(","):
            match = _SPAN.fullmatch(part.strip())
            if match is None:
                raise TaskError(f"seeds is {shown(value)}; it takes 0-99, 7, or a list of such")
            first, last = int(match[1]), int(match[2] or match[1])
            if last < first:
                raise TaskError(f"seeds {first}-{last} end before they begin; write {last}-{first}")
            spans.append(range(first, last + 1))
    count = sum(map(len, spans))
    if not count:
        raise TaskError(f"seeds is {shown(value)}; one or more are needed, such as 0-99")
    if count > MOST_SEEDS:
        raise TaskError(f"seeds are {count:,}; {MOST_SEEDS:,} are most")
    return tuple(sorted(checked_seeds([seed for span in spans for seed in span])))


def write_seeds(seeds: Sequence[int]) -> str:
    """Return sorted seeds as the text that `read_seeds` reads."""
    spans = spans_of(seeds)
    return ", ".join(f"{a}-{b}" if b > a else str(a) for a, b in spans)


@dataclass(frozen=True)
class Case:
    """Episodes of one task, all in one layout.

    Attributes:
        task: Id of the task, ``module:Id`` of one of your own.
        seeds: Which episodes: a number, ``"0-99"``, or a sequence; kept as whole numbers, sorted.
        name: What it is called in tables, and its receipt on the disk; the task's id if left out.
        layout: Other places for the robots; None for the task's own.
        control_mode: As `tasks.make` takes it.
        obs_mode: As `tasks.make` takes it.
        randomization: What varies from episode to episode, or None.
    """

    task: str
    seeds: tuple[int, ...]
    name: str = ""
    layout: Layout | None = None
    control_mode: str | Mapping[str, str] | None = None
    obs_mode: str = "state"
    randomization: Randomization | None = None

    def __post_init__(self) -> None:
        """Refuse what cannot be made.

        Raises:
            UnknownNameError: If there is no such task.
            TaskError: If seeds, name or modes are invalid, or the task cannot be played in the
                layout.
        """
        cls = get_task_class(self.task)
        object.__setattr__(self, "task", full_name(cls))
        object.__setattr__(self, "seeds", read_seeds(self.seeds))
        object.__setattr__(self, "name", checked_name("a case", self.name or cls.task_id))
        scenario = make_scenario(cls, **self.making)
        scenario.check(cls.reward_modes)
        built_layout(cls, scenario)  # refuses a layout that lacks the task's places

    @property
    def making(self) -> MakingFields:
        """What `tasks.make` takes besides the task."""
        return {
            "layout": self.layout,
            "control_mode": self.control_mode,
            "obs_mode": self.obs_mode,
            "randomization": self.randomization,
        }

    def to_json(self) -> dict[str, Any]:
        """Return all that decides its episodes as plain data; layouts with their content."""
        varied, modes = self.randomization, self.control_mode
        return {
            "name": self.name,
            "task": self.task,
            "seeds": write_seeds(self.seeds),
            "layout": None if self.layout is None else to_yaml(self.layout, _content),
            "control_mode": dict(modes) if isinstance(modes, Mapping) else modes,
            "obs_mode": self.obs_mode,
            "randomization": None if varied is None else varied.to_json(),
        }


@dataclass(frozen=True)
class Suite:
    """Cases that are played and judged together.

    Attributes:
        name: What it is called.
        cases: One or more, each with a name of its own.
        policies: Who plays, by task, where the one who runs it does not say: ``module:name`` or
            ``"expert"``. It is no part of the hash.
    """

    name: str
    cases: tuple[Case, ...]
    policies: Mapping[str, str] = field(default_factory=dict[str, str])

    def __post_init__(self) -> None:
        """Refuse a suite that has no cases, or two of one name.

        Raises:
            TaskError: If so.
        """
        checked_name("a suite", self.name)
        if not self.cases:
            raise TaskError(f"the suite {self.name} is empty; it needs one task or more")
        name, count = Counter(case.name for case in self.cases).most_common(1)[0]
        if count > 1:
            raise TaskError(f"two cases are called {name}; give one of them another 'name'")

    @property
    def hash(self) -> str:
        """SHA-256, in hex, over what is played: the cases in any order, with their layouts."""
        cases = sorted((case.to_json() for case in self.cases), key=lambda case: case["name"])
        return sha256(json.dumps([FORMAT, cases], sort_keys=True).encode()).hexdigest()

    @property
    def id(self) -> str:
        """The beginning of the hash, which papers can name."""
        return self.hash[:SHORT]

    @property
    def episodes(self) -> int:
        """How many episodes it has."""
        return sum(len(case.seeds) for case in self.cases)

    def __str__(self) -> str:
        """Show a line for each case."""
        head = f"{self.name} {self.id}: {self.episodes:,} episodes, {len(self.cases)} cases"
        return "\n".join([head, *(f"  {_line(case)}" for case in self.cases)])


@contextmanager
def naming(case: Case) -> Generator[None]:
    """Let every error of this library say in which case it happened."""
    try:
        yield
    except RobotLayoutsError as error:
        error.args = (f"{case.name}: {error}", *error.args[1:])
        raise


def checked_name(what: str, name: Any) -> str:
    """Return a name that can be that of a file.

    Raises:
        TaskError: If it cannot.
    """
    if not (isinstance(name, str) and _NAME.fullmatch(name)):
        raise TaskError(
            f"the name of {what} is {shown(name)}; it takes up to 100 letters, digits and _.+-,"
            " a letter or digit first"
        )
    return name


def _line(case: Case) -> str:
    about = [f"seeds {write_seeds(case.seeds)}"]
    about += [] if case.name == case.task else [case.task]
    about += [] if case.layout is None else [f"layout of {', '.join(case.layout)}"]
    about += [] if case.control_mode is None else [str(case.control_mode)]
    about += [] if case.obs_mode == "state" else [f"observes {case.obs_mode}"]
    about += [] if case.randomization is None else ["randomized"]
    return f"{case.name}: {'; '.join(about)}"


def _content(robot: RobotDescriptor) -> str:
    """Return what a robot is, in a word: its name if it is listed, or else what it is made of."""
    if robot.name in ROBOTS and ROBOTS[robot.name] == robot:
        return robot.name
    return f"{robot.name} {descriptor_digest(robot)} {asset_fingerprint(robot.urdf)}"


def load_suite(path: str | PathLike[str], *, import_tasks: bool = False) -> Suite:
    """Return a suite.

    Args:
        path: A YAML file, or the name of a suite that comes with the library: ``"standard"``.
        import_tasks: Whether to import the modules of the tasks that it names as ``module:Id``.
            Otherwise these have to be imported already, so that another person's file runs no
            code.

    Raises:
        UnknownNameError: If it is neither.
        TaskError: If the file cannot be read, describes no suite, or names a task whose module has
            not been imported; the message names the file.
    """
    file = SHIPPED.get(str(path), Path(path))
    if file.suffix.lower() not in (".yaml", ".yml"):
        raise UnknownNameError("suite", str(path), SHIPPED, "Or give a file ending in .yaml.")
    data = read_data(file, "suite")
    try:
        return _suite(data, file.parent, import_tasks)
    except RobotLayoutsError as error:
        raise TaskError(f"{file}: {error}") from error


def save_suite(suite: Suite, path: str | PathLike[str]) -> None:
    """Write a suite with all that it includes to one YAML file, whole or not at all.

    `load_suite` returns one of the same hash.

    Raises:
        UnwritableFileError: If it cannot be written (also an ``OSError``).
    """
    data: dict[str, Any] = {"name": suite.name}
    if suite.policies:
        data["policies"] = dict(suite.policies)
    data["tasks"] = [_entry(case, Path(path).parent) for case in suite.cases]
    text = yaml.safe_dump(data, sort_keys=False, default_flow_style=None, allow_unicode=True)
    write_whole(path, f"# suite {suite.id}\n{text}")


def _suite(data: Any, folder: Path, import_tasks: bool) -> Suite:
    top = checked_mapping(data, "a suite", TOP)
    name = checked_name("a suite", top.get("name"))
    entries = top.get("tasks")
    if not isinstance(entries, list) or not entries:
        raise TaskError(f"the suite {name} is empty; it needs 'tasks', a list of one or more")
    shared = {key: top[key] for key in SHARED if key in top}
    cases = [
        case
        for number, entry in enumerate(entries, 1)
        for case in _cases(entry, shared, folder, number, import_tasks)
    ]
    return Suite(name, tuple(cases), _policies(top.get("policies", {}), import_tasks))


def _policies(given: Any, import_tasks: bool) -> dict[str, str]:
    """Return who plays, as written; tasks are looked up when it is played."""
    found = checked_mapping(given, "policies")
    for task, policy in found.items():
        if not isinstance(policy, str):
            raise TaskError(f"the policy of {task} is {shown(policy)}; it must be MODULE:NAME")
        if task != OTHERS:
            _task_class(task, import_tasks)
    return dict(found)


def _task_class(name: str, import_tasks: bool) -> type[MultiRobotTask]:
    """Return the class of a task that a suite names; see `load_suite`."""
    module = name.rpartition(":")[0]
    if module and module not in sys.modules and not import_tasks:
        raise TaskError(
            f"nothing installed lists {name}, and a file does not choose which code runs; if you"
            f" trust its module, type: --task {quote(name)} (in Python, import it first)"
        )
    return get_task_class(name)


def _cases(
    entry: Any, shared: Mapping[str, Any], folder: Path, number: int, import_tasks: bool
) -> Sequence[Case]:
    """Return the cases of an entry: one for each of its layouts."""
    named = entry.get("task") if isinstance(entry, Mapping) else entry
    try:
        own = {"task": entry} if isinstance(entry, str) else entry
        about = {**shared, **checked_mapping(own, "an entry", ENTRY)}
        for key in ("task", "seeds"):
            if key not in about:
                raise TaskError(f"{key!r} is missing; it needs a task, and seeds unless all share")
        cls = _task_class(str(about["task"]), import_tasks)
        return [
            Case(
                about["task"],
                about["seeds"],
                name,
                read_layout(layout, folder),
                about.get("control_mode"),
                about.get("obs_mode", "state"),
                read_randomization(about.get("randomization"), folder),
            )
            for name, layout in _places(about, str(about.get("name") or cls.task_id))
        ]
    except RobotLayoutsError as error:
        which = f" ({named})" if isinstance(named, str) else ""
        raise TaskError(f"task {number}{which}: {error}") from error


def _places(about: Mapping[str, Any], name: str) -> list[tuple[str, Any]]:
    """Return the name and the layout of each case of an entry."""
    if "layouts" not in about:
        return [(name, about.get("layout", OWN))]
    if "layout" in about:
        raise TaskError("it has 'layout' and 'layouts'; the latter holds several, by name")
    several = checked_mapping(about["layouts"], "layouts")
    if not several:
        raise TaskError(f"layouts is empty; leave it out for the task's {OWN}")
    return [(name if key == OWN else f"{name}.{key}", value) for key, value in several.items()]


def _entry(case: Case, folder: Path) -> dict[str, Any]:
    """Return a case as an entry that includes everything."""
    about = {key: value for key, value in case.to_json().items() if value is not None}
    if case.layout is not None:
        about["layout"] = written_layout(case.layout, folder)
    return about


def checked_mapping(value: Any, what: str, keys: Sequence[str] | None = None) -> Mapping[str, Any]:
    """Return a mapping that has no other keys.

    Raises:
        TaskError: If it is no mapping.
        UnknownNameError: If it has another key.
    """
    if not isinstance(value, Mapping):
        raise TaskError(f"{what} is {shown(value)}; it takes a mapping (key: value)")
    for key in value:
        if keys is not None and key not in keys:
            raise UnknownNameError(f"key of {what}", key, keys)
    return value


def read_layout(value: Any, folder: Path) -> Layout | None:
    """Return the layout that a value describes; None for the task's own.

    Args:
        value: ``"own"``, a file, a preset's name with its arguments, or a layout written out.
        folder: What a file's name is relative to, and below which files are read.

    Raises:
        LayoutError: If it describes none.
        TaskError: If it is a file somewhere else.
        UnknownNameError: If a name in it is unknown.
    """
    if value == OWN:
        return None
    if isinstance(value, str):
        return Layout.load(file_below(folder, value))
    if isinstance(value, Mapping) and "preset" in value:
        return _preset(value, folder)
    if isinstance(value, Mapping) and "robots" in value:
        try:
            text = yaml.safe_dump({**value, "version": 1}, sort_keys=False)
            return Layout.from_yaml(text, folder)
        except LayoutError as error:
            raise LayoutError(_LINE.sub("", str(error))) from error
    raise LayoutError(f"a layout is {shown(value)}; it takes {_HOW}")


def read_robots(value: Any, folder: Path) -> Any:
    """Return the robots that a file names, by place or one for all; what is no word stays.

    Raises:
        RobotLayoutsError: See `robots.named.robot_in_file`.
    """
    if isinstance(value, Mapping):
        return {place: _robot(robot, str(place), folder) for place, robot in value.items()}
    return _robot(value, "every place", folder)


def _robot(word: Any, place: str, folder: Path) -> Any:
    return robot_in_file(word, place, folder) if isinstance(word, str) else word


def written_layout(layout: Layout, folder: Path) -> dict[str, Any]:
    """Return a layout written out, as `read_layout` reads it from a file in a folder.

    Raises:
        LayoutError: See `layouts.Layout.to_yaml`.
    """
    data = yaml.load(layout.to_yaml(folder), _SuiteLoader)
    del data["version"]
    return data


def read_randomization(value: Any, folder: Path) -> Randomization | None:
    """Return what varies: a file's, or what a mapping describes; None if it is None.

    Raises:
        TaskError: If it is invalid.
        UnknownNameError: If there is no such axis.
    """
    if value is None:
        return None
    if isinstance(value, str):
        return Randomization.load(file_below(folder, value))
    if not isinstance(value, Mapping):
        raise TaskError(f"randomization is {shown(value)}; it takes a file, or axes by name")
    return Randomization.from_json(value)


def file_below(folder: Path, name: str) -> Path:
    """Return the path of a file below a folder; another person's file reads no other.

    Raises:
        TaskError: If it is not below it, links followed.
    """
    with suppress(ValueError):  # a name that no file has
        if Path(os.path.realpath(folder / name)).is_relative_to(os.path.realpath(folder)):
            return folder / name
    raise TaskError(
        f"{shown(name)} is no file below the folder of what names it, which includes no others;"
        " copy it there"
    )


class _SuiteLoader(yaml.SafeLoader):
    """Reads the numbers of `Layout.to_yaml`, and all else as texts."""

    yaml_implicit_resolvers = {
        first: [(tag, pattern) for tag, pattern in resolvers if tag.endswith(":float")]
        for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
    }


def _preset(value: Mapping[str, Any], folder: Path) -> Layout:
    preset = str(value["preset"])
    options = {
        # A file's numbers are all read as floats.
        key: int(given) if isinstance(given, float) and given.is_integer() else given
        for key, given in value.items()
        if key != "preset"
    }
    if "robots" in options:
        options["robots"] = read_robots(options["robots"], folder)
    place = PRESETS[preset]
    takes = signature(place).parameters
    for name in options:
        if name not in takes:
            raise UnknownNameError(f"argument of {preset}", name, takes)
    for name, one in takes.items():
        if one.default is one.empty and name not in options:
            raise LayoutError(f"{preset} needs {name!r}")
    layout = place(**options)
    if not isinstance(layout, Layout):
        raise LayoutError(f"the preset {preset} returned {shown(layout)}, no Layout")
    return layout

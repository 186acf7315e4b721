"""A suite: which episodes are played of which tasks, in which layouts; it names itself by hash."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from hashlib import sha256
from typing import TYPE_CHECKING, Any

from layouts import Layout
from layouts.yaml_format import to_yaml
from robot_layouts.core.bounds import shown
from robot_layouts.data.playing.seeds import checked_seeds
from robot_layouts.data.reading.guessed_robots import descriptor_digest
from robot_layouts.data.reading.manifest import spans_of
from robots import RobotDescriptor, RobotLayoutsError, TaskError
from robots.fingerprint import asset_fingerprint
from robots.registry import ROBOTS
from tasks.engine.places import built_layout
from tasks.randomization.declaration import Randomization
from tasks.registry import full_name, get_task_class, make_scenario

if TYPE_CHECKING:
    from tasks.engine.scenario import MakingFields

FORMAT = 1
SHORT = 12  # digits of a hash that tell suites apart

MOST_SEEDS = 100_000  # of a case; a receipt of as many episodes can still be read

_SPAN = re.compile(r"(\d{1,10})(?:\s*-\s*(\d{1,10}))?")
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.+-]{0,99}")


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

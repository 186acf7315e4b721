"""What the gallery says that takes robot files or time to find: ``measurements/gallery.json``."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated, Any, TypedDict

from robots import RobotLayoutsError
from robots.common.files import parse_json
from robots.common.schema import check, check_fields, within
from robots.common.writing import write_whole

RECORD = Path(__file__).parents[1] / "gallery.json"
COMMAND = "python -m measurements.gallery --measure"

Whole = Annotated[int, within(0, 1e9)]


class GalleryError(RobotLayoutsError, ValueError):
    """A record that cannot be read, or lacks what a page shows."""


@dataclass(frozen=True)
class Joint:
    """A joint that moves, as the URDF has it.

    Attributes:
        name: Its name.
        type: ``revolute``, ``continuous`` or ``prismatic``.
        unit: Of its position: ``rad`` or ``m``.
        lower: Lower limit (rad or m), or None if it has none.
        upper: Upper limit (rad or m), or None if it has none.
        effort: Largest effort (N·m or N), or None.
        velocity: Largest speed (rad/s or m/s), or None.
        mimics: Joint that it follows in the URDF, or None.
    """

    name: str
    type: str
    unit: str
    lower: float | None = None
    upper: float | None = None
    effort: float | None = None
    velocity: float | None = None
    mimics: str | None = None

    def __post_init__(self) -> None:
        """Refuse what no joint can be."""
        check_fields(self, GalleryError)


@dataclass(frozen=True)
class RobotRecord:
    """What the files of a robot say.

    Attributes:
        urdf_sha256: SHA-256 of the URDF, in hex.
        joints: Its joints that move, in the URDF's order.
    """

    urdf_sha256: str
    joints: tuple[Joint, ...]


@dataclass(frozen=True)
class Entry:
    """A part of a flat observation.

    Attributes:
        name: Its name.
        size: How many numbers it has.
        sensed: Whether it is observed together with images, too.
    """

    name: str
    size: Whole
    sensed: bool

    def __post_init__(self) -> None:
        """Refuse what no entry can be."""
        check_fields(self, GalleryError)


@dataclass(frozen=True)
class ExpertRecord:
    """How the expert of a task did in the episodes of the first seeds, from 0.

    Attributes:
        episodes: How many it played.
        failed: Seed → why, for those that it did not solve.
        steps: Control steps of each, in the order of the seeds.
        versions: Of what it was measured with, by package.
    """

    episodes: Whole
    failed: Mapping[str, str]
    steps: tuple[Whole, ...]
    versions: Mapping[str, str]

    def __post_init__(self) -> None:
        """Refuse what cannot be."""
        check_fields(self, GalleryError)
        if len(self.steps) != self.episodes:
            raise GalleryError(f"{self.episodes} episodes have steps of {len(self.steps)}")

    @property
    def solved(self) -> int:
        """How many episodes it solved."""
        return self.episodes - len(self.failed)

    @property
    def solved_steps(self) -> list[int]:
        """Control steps of the episodes that it solved."""
        return [n for seed, n in enumerate(self.steps) if str(seed) not in self.failed]

    @property
    def first_solved(self) -> int:
        """The first seed that it solved.

        Raises:
            GalleryError: If it solved none.
        """
        for seed in range(self.episodes):
            if str(seed) not in self.failed:
                return seed
        raise GalleryError("the expert solved no episode; there is nothing to show")


@dataclass(frozen=True)
class TaskRecord:
    """What it takes worlds to know of a task.

    Attributes:
        observation: The parts of its flat observation, in order.
        expert: How its expert did.
    """

    observation: tuple[Entry, ...]
    expert: ExpertRecord


class _RobotJson(TypedDict):
    urdf_sha256: str
    joints: Sequence[Mapping[str, Any]]


@dataclass
class Record:
    """Everything that was measured for the gallery.

    Attributes:
        robots: By name.
        tasks: By id.
    """

    robots: dict[str, RobotRecord] = field(default_factory=dict)
    tasks: dict[str, TaskRecord] = field(default_factory=dict)

    @classmethod
    def read(cls, path: Path = RECORD) -> Record:
        """Return the record in a file.

        Raises:
            GalleryError: If it cannot be read, or holds none.
        """
        try:
            content: Any = parse_json(path.read_text(encoding="utf-8"))
            robots = check(content["robots"], Mapping[str, _RobotJson], "robots", GalleryError)
            return cls(
                {name: _robot(found) for name, found in robots.items()},
                {name: _task(found) for name, found in content["tasks"].items()},
            )
        except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
            raise GalleryError(f"cannot read {path}: {error}; `{COMMAND}` writes it") from error

    def write(self, path: Path = RECORD) -> None:
        """Write it to a file, by name.

        Raises:
            UnwritableFileError: If it cannot be written.
        """
        lines = ["{", ' "robots": {', *_entries(self.robots), " },", ' "tasks": {']
        lines += [*_entries(self.tasks), " }", "}"]
        write_whole(path, "\n".join(lines) + "\n")

    def robot(self, name: str) -> RobotRecord:
        """Return what was read of a robot.

        Raises:
            GalleryError: If nothing was.
        """
        return _find(self.robots, "robot", name)

    def task(self, name: str) -> TaskRecord:
        """Return what was measured of a task.

        Raises:
            GalleryError: If nothing was.
        """
        return _find(self.tasks, "task", name)


def _find(entries: Mapping[str, Any], kind: str, name: str) -> Any:
    if name not in entries:
        raise GalleryError(f"the record has no {kind} {name!r}; run `{COMMAND} {name}`")
    return entries[name]


def _robot(found: _RobotJson) -> RobotRecord:
    return RobotRecord(found["urdf_sha256"], tuple(Joint(**joint) for joint in found["joints"]))


def _task(found: Mapping[str, Any]) -> TaskRecord:
    entries = tuple(Entry(**entry) for entry in found["observation"])
    return TaskRecord(entries, ExpertRecord(**found["expert"]))


def _entries(entries: Mapping[str, RobotRecord | TaskRecord]) -> list[str]:
    """Return one line per list or mapping inside each entry, so that changes can be read."""
    lines: list[str] = []
    for number, name in enumerate(sorted(entries)):
        comma = "," if number < len(entries) - 1 else ""
        lines += [f"  {json.dumps(name)}: {{", *_fields(asdict(entries[name])), f"  }}{comma}"]
    return lines


def _fields(entry: Mapping[str, Any]) -> list[str]:
    lines: list[str] = []
    for number, (name, value) in enumerate(entry.items()):
        comma = "," if number < len(entry) - 1 else ""
        if isinstance(value, tuple):
            parts = [{k: v for k, v in part.items() if v is not None} for part in value]
            inner = ",\n".join(f"    {json.dumps(part, ensure_ascii=False)}" for part in parts)
            lines += [f"   {json.dumps(name)}: [", inner, f"   ]{comma}"]
        else:
            text = json.dumps(value, ensure_ascii=False)
            lines.append(f"   {json.dumps(name)}: {text}{comma}")
    return lines

"""``python -m benchmarks gallery``: a page for every task and every robot, from the code.

Pages hold what descriptors, task classes and records say, and show the pictures that there are.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from functools import cache
from hashlib import sha256
from importlib import import_module
from pathlib import Path
from statistics import median
from typing import Any

from rich.table import Table
from tqdm import tqdm

import tasks
from benchmarks.bench.measurement import number_text
from benchmarks.bench.report import Report, read_report
from benchmarks.gallery.pictures import Artist, can_be_drawn, files_of, is_optional, speed
from benchmarks.records import (
    DOCS,
    Record,
    RecordError,
    read_record,
    render,
    table,
    versions_of,
    write_record,
)
from benchmarks.robots.judge import EXPECTED, Expected, expected_of, read_expectations
from layouts import Layout
from layouts.preview import action_text, decimal, facing_text
from parity.results import number_text as difference_text
from parity.results import read_results
from robot_layouts.core.writing import write_whole
from robot_layouts.data import evaluate
from robot_layouts.experts import list_experts
from robots import (
    CONTROL_MODES,
    AssetError,
    RobotDescriptor,
    RobotLayoutsError,
    RobotRegistry,
    UnknownNameError,
)
from robots.assets.store import size
from robots.registry import CATALOGUE as ROBOTS
from robots.urdf.reading import read_model
from robots.urdf.summary import read_urdf
from tasks import MultiRobotTask, get_task_class
from tasks.description import (
    action_sentence,
    action_table,
    camera_table,
    observation_table,
    read_docstring,
    source_of,
)
from tasks.engine.cameras import cameras_of
from tasks.registry import CATALOGUE as TASKS
from tasks.registry import other_names

FOLDER, RECORD = DOCS / "gallery", DOCS / "gallery.json"
WRITE = "python -m benchmarks gallery"
EPISODES = 25  # that each expert plays, of the first seeds
PACKAGES = ("robot-layouts", "sapien", "torch", "numpy")
RATES = ("step", "reset", "vector")  # benchmarks by task that compare with native
KINDS = {
    "arm": "Robots of one arm",
    "several arms": "Robots of two arms",
    "humanoid": "Humanoids",
    "hand": "Hands",
}


def gallery(
    names: Sequence[str] = (),
    *,
    check: bool = False,
    measure: bool = False,
    pictures: bool = False,
) -> int:
    """Write a page for every task and every robot, from the code and what was measured.

    Exit code: 0; 1 if a page is not what would be written, or robot files cannot be found.

    Args:
        names: Tasks and robots to measure or draw (all).
        check: Write nothing; say which pages are stale.
        measure: First read robot files and let experts play, in minutes.
        pictures: First draw robots and film experts, in minutes.

    Raises:
        RobotLayoutsError: If something cannot be read, written or drawn.
    """
    choices = [*ROBOTS, *TASKS]
    for name in names:
        if name not in choices:
            raise UnknownNameError("task or robot of the gallery", name, choices)
    if names and not (measure or pictures):
        raise RecordError("names are taken by --measure and --pictures; pages are all written")
    if check:
        found = list(complaints(_read(), FOLDER))
        for complaint in found:
            print(complaint, file=sys.stderr)
        return int(bool(found))
    complete = True
    if measure:
        complete = _each(names or choices, _measurer())
    if pictures:
        complete &= _each(names or choices, Artist(_read(), FOLDER).draw)
    pages = all_pages(_read(), FOLDER)
    for path, text in pages.items():
        write_whole(FOLDER / path, text)
    for path in _pages_there(FOLDER) - set(pages):
        (FOLDER / path).unlink()
    print(f"{FOLDER}: {len(pages)} pages")
    return 0 if complete else 1


def _read() -> Record:
    return read_record(RECORD, robots={}, tasks={})


def _each(names: Sequence[str], do: Callable[[str], object]) -> bool:
    """Do something for each name; those whose files cannot be found are left out, and said."""
    complete = True
    for name in tqdm(names, disable=None):
        try:
            do(name)
        except AssetError as error:
            complete = False
            print(f"{name} is left out: {str(error).splitlines()[0]}", file=sys.stderr)
    return complete


def _measurer() -> Callable[[str], None]:
    record = _read()

    def measure(name: str) -> None:
        kind, entry = ("robots", read_robot(name)) if name in ROBOTS else ("tasks", play_task(name))
        record[kind] = dict(sorted({**record[kind], name: entry}.items()))
        write_record(RECORD, record)

    return measure


def read_robot(name: str) -> Record:
    """Return what the files of a robot say: the URDF's SHA-256, and its joints that move.

    Raises:
        AssetError: If its files cannot be found.
    """
    urdf = RobotRegistry.load(name).urdf.locate()
    fields = ("name", "type", "unit", "lower", "upper", "effort", "velocity", "mimics")
    joints = [
        {field: value for field in fields if (value := getattr(joint, field)) is not None}
        for joint in read_model(read_urdf(urdf), urdf.name).moving
    ]
    return {"urdf_sha256": sha256(urdf.read_bytes()).hexdigest(), "joints": joints}


def play_task(task_id: str, episodes: int = EPISODES) -> Record:
    """Return the parts of a task's observation, and how its expert does with the first seeds.

    Args:
        task_id: Its id.
        episodes: How many seeds.

    Raises:
        AssetError: If robot files cannot be found.
    """
    env = tasks.make(task_id)
    observation = [
        {
            "name": name,
            "size": part.stop - part.start,
            "sensed": name.endswith((".qpos", ".qvel")) or env.observer.senses(name),
        }
        for name, part in env.observation_slices.items()
    ]
    env.close()
    if task_id not in list_experts():
        return {"observation": observation, "expert": None}
    found = evaluate("expert", task_id, range(episodes), workers=0)
    failed = {
        str(seed): found.reasons.get(seed, "") or "not solved at the last step"
        for seed, success in found.successes.items()
        if not success
    }
    expert = {
        "episodes": episodes,
        "failed": failed,
        "steps": list(found.lengths.values()),
        "versions": versions_of(*PACKAGES),
    }
    return {"observation": observation, "expert": expert}


def all_pages(record: Record, folder: Path) -> dict[str, str]:
    """Return every page by its path in the gallery's folder.

    Args:
        record: What was measured.
        folder: The gallery's, for the pictures that are in it.

    Raises:
        RecordError: If the record lacks a task or a robot, or another record cannot be read.
    """
    for kind, names in (("robots", ROBOTS), ("tasks", TASKS)):
        if lost := [name for name in names if name not in record[kind]]:
            missing = " ".join(lost)
            raise RecordError(
                f"the record has no {kind} {missing}; run `{WRITE} --measure {missing}`"
            )
    compared, bench = read_results(), read_report()
    classes = {task_id: get_task_class(task_id) for task_id in TASKS}
    robots = {name: RobotRegistry.load(name) for name in ROBOTS}
    shared: dict[str, Any] = {
        "pictures": _media(folder),
        "compared": compared,
        "record": record,
        "quoted": lambda names: ", ".join(f"`{name}`" for name in names),
        "robots_of": robots_of,
        "summary": _summary,
        "task_summary": lambda cls: read_docstring(cls).summary,
        "solved": solved,
    }
    clones = [cls for cls in classes.values() if cls.native_id]
    own = [cls for cls in classes.values() if not cls.native_id]
    kinds = {title: [r for r in robots.values() if _kind(r) == k] for k, title in KINDS.items()}
    sections = {"Tasks of our own": own, "Tasks that clone ManiSkill's": clones}
    pages = {"index.md": render("gallery_index", sections=sections, kinds=kinds, **shared)}
    for task_id, cls in classes.items():
        about = _task(cls, record["tasks"][task_id], robots, bench)
        pages[f"tasks/{task_id}.md"] = render(
            "gallery_task", cls=cls, source=source_of(cls), **about, **shared
        )
    for name, robot in robots.items():
        about = _robot(robot, record["robots"][name]["joints"], classes)
        pages[f"robots/{name}.md"] = render("gallery_robot", robot=robot, **about, **shared)
    return pages


def complaints(record: Record, folder: Path) -> Iterator[str]:
    """Yield what is stale or missing, and the command that fixes it.

    Raises:
        RecordError: If the record lacks a task or a robot.
    """
    pages = all_pages(record, folder)
    for path, text in pages.items():
        if not (folder / path).is_file():
            yield f"{path} is missing; run `{WRITE}`"
        elif (folder / path).read_text(encoding="utf-8") != text:
            yield f"{path} is stale; run `{WRITE}`"
    for path in sorted(_pages_there(folder) - set(pages)):
        yield f"{path} is of no task or robot; run `{WRITE}`"
    pictures = {f"media/tasks/{name}.webp": name for name in TASKS}
    pictures |= {f"media/robots/{name}.webp": name for name in ROBOTS}
    there = _media(folder)
    for path in sorted(pictures.keys() - there):
        yield f"{path} is missing; run `{WRITE} --pictures {pictures[path]}`"
    for path in sorted(there - pictures.keys()):
        yield f"{path} is of no task or robot; remove it"
    for name in ROBOTS:
        package, urdf = files_of(RobotRegistry.load(name))
        if package.file(urdf).sha256 != record["robots"][name]["urdf_sha256"]:
            yield f"the URDF of {name} has changed; run `{WRITE} --measure {name}`"


def _pages_there(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*.md")}


def _media(folder: Path) -> set[str]:
    media = (path for path in (folder / "media").rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix() for path in media}


def _summary(robot: str) -> str:
    """Return what the module of a robot says of it in its first line."""
    module = import_module(ROBOTS[robot].partition(":")[0])
    return (module.__doc__ or "").splitlines()[0]


def _kind(robot: RobotDescriptor) -> str:
    """Return what a robot is, one of `KINDS`."""
    package, urdf = files_of(robot)
    inside = f"{package.origin.folder}/{urdf}".partition("/robots/")[2]
    known = expected_of(f"{package.origin.distribution}/{inside}", _expectations()).kind
    if known in ("humanoid", "hand"):
        return known
    return "several arms" if robot.limbs else "arm"


@cache
def _expectations() -> dict[str, Expected]:
    return read_expectations(EXPECTED)


def robots_of(layout: Layout, up: str = "../") -> str:
    """Return a layout's robots in words, with links: ``2 × panda``."""
    counts = Counter(placement.robot.name for placement in layout.values())
    return " + ".join(
        f"{f'{n} × ' if n > 1 else ''}[{name}]({up}robots/{name}.md)" for name, n in counts.items()
    )


def solved(expert: Mapping[str, Any] | None) -> list[int]:
    """Return the seeds that an expert solved, in order; none if there is no expert."""
    if expert is None:
        return []
    return [seed for seed in range(expert["episodes"]) if str(seed) not in expert["failed"]]


def _task(
    cls: type[MultiRobotTask],
    measured: Mapping[str, Any],
    robots: Mapping[str, RobotDescriptor],
    bench: Report,
) -> dict[str, Any]:
    """Return what a task's page says besides its class and the records."""
    layout, expert, slices, start = cls.layout, measured["expert"], dict[str, slice](), 0
    for entry in measured["observation"]:
        slices[entry["name"]] = slice(start, start + entry["size"])
        start += entry["size"]
    sensed = {entry["name"] for entry in measured["observation"] if entry["sensed"]}
    steps = [expert["steps"][seed] for seed in solved(expert)] if expert else []
    rates = [m for m in map(bench.find, RATES) if m.variable == "task" and cls.task_id in m.values]
    return {
        "text": read_docstring(cls),
        "expert": expert,
        "steps": steps,
        "median": median,
        "observation_size": start,
        "frequency": cls.scenario.control_frequency,
        "times": speed(steps[0] if steps else 1, cls.scenario.control_frequency),
        "other_names": other_names(cls),
        "action_text": action_text,
        "base_text": lambda placement: ", ".join(map(decimal, placement.base_position)),
        "facing_text": facing_text,
        "like": _like(next(iter(layout.values())).robot, robots),
        "needs": list(_needs(cls)),
        "how_to_act": action_sentence(layout).removeprefix("Action, "),
        "action": _printed(action_table(layout), code=(1, 2)),
        "observation": _printed(observation_table(slices, sensed.__contains__), code=(0, 1)),
        "cameras": _printed(camera_table(cameras_of(layout, cls.cameras)), code=(0,)),
        "dense": " ".join((cls.dense_reward.__doc__ or "").split()),
        "modes": {mode: _action_size(layout, mode) for mode in CONTROL_MODES},
        "difference": difference_text,
        "rates": rates,
        "series": list(dict.fromkeys(name for m in rates for name in m.samples)),
        "cost": lambda m, name: (
            number_text(m.median(name, cls.task_id)) if name in m.samples else "–"
        ),
        "conditions": bench.conditions(),
    }


def _action_size(layout: Layout, mode: str) -> str:
    try:
        return str(layout.in_control_mode(mode).action_dim)
    except RobotLayoutsError:
        return "–"


def _needs(cls: type[MultiRobotTask]) -> Iterator[str]:
    """Yield what robots must have to stand there, a sentence for each place."""
    for name, needs in cls.needs.items():
        wanted = [
            *(["fingers that grasp"] if needs.fingers else []),
            *([f"a gripper that opens {needs.opening:g} m"] if needs.opening else []),
            *([f"a reach of {needs.reach:g} m"] if needs.reach else []),
            *(["a TCP that is a link"] if needs.tcp_is_link else []),
        ]
        who = "Every robot" if name == "*" else f"The robot at `{name}`"
        yield f"{who} needs {' and '.join(wanted)}."


def _like(robot: RobotDescriptor, robots: Mapping[str, RobotDescriptor]) -> str:
    """Return the name of a robot of as many numbers, with fingers if this one has some.

    Of those, one is taken whose files are at hand, and that can be drawn.
    """
    package = files_of(robot)[0]
    alike = [
        other
        for other in robots.values()
        if other.name != robot.name
        and other.action_dim == robot.action_dim
        and bool(other.fingers) == bool(robot.fingers)
    ]
    return min(
        alike, key=lambda o: (files_of(o)[0] != package, is_optional(o), not can_be_drawn(o))
    ).name


def _robot(
    robot: RobotDescriptor,
    joints: Sequence[Mapping[str, Any]],
    classes: Mapping[str, type[MultiRobotTask]],
) -> dict[str, Any]:
    """Return what a robot's page says besides its descriptor."""
    package, urdf = files_of(robot)
    groups = robot.action_split.groups
    fingers = [robot.fingers, *(limb.fingers for limb in robot.limbs.values())]
    physics = package.needed(urdf, pictures=False)
    drawing = [file for file in package.needed(urdf, pictures=True) if file not in physics]
    modes, refused = _modes(robot)
    return {
        "held": sum(len(group.joints) for group in groups.values() if group.held),
        "tcp": _tcp,
        "fingers": dict.fromkeys(link for own in fingers if own for link in own.links),
        "tasks": [
            task_id
            for task_id, cls in classes.items()
            if any(placement.robot.name == robot.name for placement in cls.layout.values())
        ],
        "joints": joints,
        "drivers": {joint: (name, g.held) for name, g in groups.items() for joint in g.joints},
        "amount": lambda value: f"{value:{',.0f' if value >= 1e4 else '.4g'}}",
        "modes": modes,
        "refused": refused,
        "posture": lambda qpos: ", ".join(f"{round(value, 6) + 0.0:.4g}" for value in qpos),
        "origin": package.origin,
        "urdf": urdf,
        "drawn": can_be_drawn(robot),
        "optional": is_optional(robot),
        "physics_files": _amount(physics),
        "picture_files": _amount(drawing),
    }


def _tcp(robot: RobotDescriptor) -> str:
    place = f"`{robot.tcp_link}`"
    if robot.tcp_position_links:
        links = ", ".join(f"`{link}`" for link in robot.tcp_position_links)
        place = f"the middle of {links}, turned as `{robot.tcp_link}`"
    offset = ", ".join(f"{x:g}" for x in robot.tcp_offset) if any(robot.tcp_offset) else ""
    return f"{place}{f', ({offset}) m from it' if offset else ''}"


def _modes(robot: RobotDescriptor) -> tuple[list[tuple[str, int, str]], dict[str, list[str]]]:
    """Return a row for each control mode, and those that it does not offer, by the reason."""
    rows: list[tuple[str, int, str]] = []
    reasons: dict[str, list[str]] = {}
    for mode in robot.modes:
        try:
            numbers = robot.in_control_mode(mode).describe_action()
        except RobotLayoutsError as error:
            reason = str(error).partition(". ")[0].removeprefix(f"{robot.name}: ")
            reasons.setdefault(reason.replace(repr(mode), "each"), []).append(mode)
        else:
            units = Counter(number.unit for number in numbers)
            what = " + ".join(f"{count} × {unit}" for unit, count in units.items())
            rows.append((mode, len(numbers), what))
    return rows, reasons


def _amount(files: Sequence[Any]) -> str:
    return f"{len(files)} files, {size(sum(file.bytes for file in files))}" if files else ""


def _printed(rows: Table, code: Collection[int] = ()) -> str:
    """Return a table that is made to be printed; some columns are code."""
    cells = [[str(cell) for cell in column.cells] for column in rows.columns]
    quoted = [[f"`{c}`" for c in row] if i in code else row for i, row in enumerate(cells)]
    numbers = [i for i, column in enumerate(rows.columns) if column.justify == "right"]
    escaped = ([cell.replace("|", r"\|") for cell in row] for row in zip(*quoted, strict=True))
    return table([str(column.header) for column in rows.columns], escaped, numbers)

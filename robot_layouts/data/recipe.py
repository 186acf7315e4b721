"""A recipe: which recordings and exports a data set is, and what made them; a YAML file.

It says what `record` and `export` are given, and perhaps the SHA-256 of the files that came of it.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any

import yaml

from robot_layouts.core.bounds import shown
from robot_layouts.core.schema import FieldError
from robot_layouts.data.actors import EXPERT
from robot_layouts.data.export.dataset import Export, ExportOptions
from robot_layouts.data.playing.environment import versions
from robot_layouts.data.reading.json_files import FILE_SIZE, TrajectoryError, sized_file
from robot_layouts.data.reading.recorded_task import task_for
from robot_layouts.data.reading.recording import Recording, all_files
from robot_layouts.data.recording.recorder import checked_file_size
from robot_layouts.data.suite.suite import (
    checked_mapping,
    checked_name,
    file_below,
    read_layout,
    read_randomization,
    read_robots,
    read_seeds,
    write_seeds,
    written_layout,
)
from robots import RobotLayoutsError, TaskError, UnknownNameError
from robots.control_modes import plain_mode
from tasks import MultiRobotTask, TaskEnv, get_task_class
from tasks.engine.cameras import load_cameras, read_cameras
from tasks.randomization.declaration import SETTINGS, read_data
from tasks.registry import full_name, scenario_of

MADE_WITH = "robot-layouts", "sapien", "numpy", "torch", "mujoco"
PEOPLE = "policy", "takeover", "corrector"
_ASKED = ("robots", "bystanders", "control_mode", "obs_mode", "observations", "visuals")
_READ = ("layout", "randomization", "cameras", "sensor_configs", "camera_size", "file_size")
_MAKING = (*_ASKED, *_READ, "max_episode_steps", "reward_mode")
ENTRY = ("task", "seeds", *PEOPLE, *_MAKING, "exports", "files")
EXPORT = ("format", "cameras", "instruction", *ExportOptions.__dataclass_fields__)
_WHOLE = "max_episode_steps", "fps", "points"


@dataclass(frozen=True)
class RecordingRecipe:
    """How one recording is made.

    Attributes:
        name: Of its folder.
        task: Id of its task; ``module:Id`` for one of your own.
        seeds: Its episodes.
        how: Other arguments of `record`.
        exports: Arguments of `Export` by the name of the folder.
        files: SHA-256 of each file of the recording, by its name, as far as they are known.
    """

    name: str
    task: str
    seeds: tuple[int, ...]
    how: Mapping[str, Any]
    exports: Mapping[str, Mapping[str, Any]] = field(default_factory=dict[str, Any])
    files: Mapping[str, str] = field(default_factory=dict[str, str])

    def differing(self, folder: Path) -> list[str]:
        """Return the names of the files in a folder that are not those of the recipe."""
        found = sums(folder) if self.files else {}
        return sorted(n for n in {*self.files, *found} if self.files.get(n) != found.get(n))


@dataclass(frozen=True)
class Recipe:
    """Recordings that belong together.

    Attributes:
        recordings: One or more.
        made_with: Versions of packages with which they were made; empty if that is not known.
    """

    recordings: tuple[RecordingRecipe, ...]
    made_with: Mapping[str, str] = field(default_factory=dict[str, str])


def sums(recording: str | PathLike[str]) -> dict[str, str]:
    """Return the SHA-256 of each h5 file of a recording and of the json beside it, by name."""
    paths = [p for h5 in all_files(recording) for p in (h5, h5.with_suffix(".json"))]
    return {path.name: sized_file(path)["sha256"] for path in paths}


def load_recipe(path: str | PathLike[str], *, trust: bool = False) -> Recipe:
    """Return a recipe; every name and number in it has been tried.

    Args:
        path: A YAML file. Files that it names are relative to its folder, and below it.
        trust: Whether to import modules that it names, of tasks and of who acts. Otherwise it may
            name none, so that another person's file runs no code.

    Raises:
        TaskError: If it cannot be read, or something in it is invalid; the message names the file.
    """
    data, folder = read_data(path, "recipe"), Path(path).parent
    try:
        top = checked_mapping(data, "a recipe", ("recordings", "made_with"))
        entries = checked_mapping(top.get("recordings") or {}, "recordings")
        if not entries:
            raise TaskError("it needs 'recordings': a mapping of one or more, by name")
        made = tuple(_entry(str(name), given, folder, trust) for name, given in entries.items())
        _expect_apart(made)
        with_ = checked_mapping(top.get("made_with", {}), "made_with")
        return Recipe(made, {str(name): str(version) for name, version in with_.items()})
    except RobotLayoutsError as error:
        raise TaskError(f"{path}: {error}") from error


def _entry(name: str, given: Any, folder: Path, trust: bool) -> RecordingRecipe:
    checked_name("a recording", name)
    try:
        about = checked_mapping(given, "a recording", ENTRY)
        for key in ("task", "seeds"):
            if key not in about:
                raise TaskError(f"{key!r} is missing; a recording needs a task and seeds")
        people = {key: str(about[key]) for key in PEOPLE if key in about}
        task = str(about["task"])
        _expect_trust([task, *people.values()], trust)
        how = _making(about, folder)
        making = {n: v for n, v in how.items() if n not in ("observations", "file_size")}
        cls, scenario = scenario_of(task, **making)
        scenario.check(cls.reward_modes)
        exports = checked_mapping(about.get("exports", {}), "exports")
        return RecordingRecipe(
            name,
            full_name(cls),
            read_seeds(about["seeds"]),
            {**people, **how},
            {str(key): _export(str(key), value) for key, value in exports.items()},
            {str(k): str(v) for k, v in checked_mapping(about.get("files", {}), "files").items()},
        )
    except (FieldError, RobotLayoutsError) as error:
        raise TaskError(f"{name}: {error}") from error


def _expect_trust(names: list[str], trust: bool) -> None:
    """Refuse names of modules that were not imported; of an address, nothing is imported."""
    for name in names:
        module = name.rpartition(":")[0]
        if module and module not in sys.modules and not trust:
            raise TaskError(
                f"it names {name}, and a file does not choose which code runs; if you trust it,"
                " take --trust (in Python, trust=True)"
            )


def _making(about: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Return what an entry says besides task, seeds and people, as arguments of `record`."""
    how = {key: _whole(key, about[key]) for key in _MAKING if key in about}
    if "observations" in how:
        how["observations"] = _flag("observations", how["observations"])
    if "file_size" in how:
        how["file_size"] = checked_file_size(how["file_size"])
    if "robots" in how:
        how["robots"] = read_robots(how["robots"], folder)
    if "layout" in how:
        how["layout"] = read_layout(how["layout"], folder)
    if how.get("randomization") not in (None, *SETTINGS):
        how["randomization"] = read_randomization(how["randomization"], folder)
    if isinstance(how.get("cameras"), str):
        how |= load_cameras(file_below(folder, how["cameras"]))
    elif given := {key: how[key] for key in ("cameras", "sensor_configs") if key in how}:
        how |= read_cameras(given)
    if "camera_size" in how:
        how["camera_size"] = _size(how["camera_size"])
    return how


def _export(name: str, given: Any) -> dict[str, Any]:
    checked_name("an export", name)
    about = checked_mapping(given, "an export", EXPORT)
    if "format" not in about:
        raise TaskError(f"the export {name} needs a 'format'")
    options = {key: _whole(key, value) for key, value in about.items()}
    for key in ("video", "images", "depth", "include_failures"):
        if key in options:
            options[key] = _flag(key, options[key])
    if "size" in options:
        options["size"] = _size(options["size"])
    Export("", out=name, **options).check_options()
    return options


def _whole(name: str, value: Any) -> Any:
    """Return a value of a YAML file, whose numbers are floats, as the whole number that it is."""
    if name not in _WHOLE or not isinstance(value, float):
        return value
    if not value.is_integer():
        raise TaskError(f"{name} is {value:g}; it must be a whole number")
    return int(value)


def _flag(name: str, value: Any) -> bool:
    """Return a flag of a YAML file, whose words are texts."""
    words = {"true": True, "false": False}
    if str(value).lower() not in words:
        raise TaskError(f"{name} is {shown(value)}; it takes true or false")
    return words[str(value).lower()]


def _size(value: Any) -> tuple[int, int]:
    try:
        width, height = (int(number) for number in value)
        return width, height
    except (TypeError, ValueError):
        raise TaskError(f"a size is {shown(value)}; it takes [WIDTH, HEIGHT] in pixels") from None


def _expect_apart(recordings: tuple[RecordingRecipe, ...]) -> None:
    """Refuse two folders of one name."""
    taken = set[str]()
    for name in (n for one in recordings for n in (one.name, *one.exports)):
        if name in taken:
            raise TaskError(f"two folders would be called {name}; give one another name")
        taken.add(name)


def recipe_text(
    recording: str | PathLike[str], name: str, folder: Path, file_size: float = FILE_SIZE
) -> str:
    """Return the recipe of a recording, as `load_recipe` reads it.

    Args:
        recording: The recording: a folder, a file, or ``hub:OWNER/NAME``.
        name: Of the recording.
        folder: Where the recipe will be; paths of robots of your own are relative to it.
        file_size: Size at which a further file was begun (MB), which a recording does not say.

    Raises:
        TrajectoryError: If it cannot be read, or cannot be recorded again: a person acted, several
            did, or an episode has no seed.
    """
    with Recording(recording) as file:
        seeds = sorted(seed for seed in file.seeds if seed is not None)
        if not seeds or len(seeds) < len(file.seeds):
            raise TrajectoryError(f"{file.path} does not say the seeds of its episodes")
        entry: dict[str, Any] = {"seeds": write_seeds(seeds)}
        entry |= _people(file)
        with closing(task_for(file)) as task:
            entry = {"task": full_name(task.task_class), **entry, **_made(file, task, folder)}
    if file_size != FILE_SIZE:
        entry["file_size"] = file_size
    entry["files"] = sums(recording)
    data = {"made_with": versions(MADE_WITH), "recordings": {checked_name("it", name): entry}}
    return yaml.safe_dump(data, sort_keys=False, default_flow_style=None, allow_unicode=True)


def _people(file: Recording) -> dict[str, Any]:
    """Return who acted, unless that was the expert."""
    names = {str(source) for source in file.sources}
    if file.source_type == "scripted" and names == {"None"}:
        return {}
    source = file.sources[0]
    if source is None or len(names) > 1 or "actors" in source or "corrects" in source:
        raise TrajectoryError(
            f"{file.path} is of several who acted, or of unknown ones; a recipe names one, an"
            " expert or a policy"
        )
    if source["kind"] not in (EXPERT, "policy"):
        raise TrajectoryError(f"in {file.path} a {source['kind']} acted, who cannot be asked again")
    return {"policy": source["name"]}


def _made(file: Recording, task: TaskEnv, folder: Path) -> dict[str, Any]:
    """Return how the task of a recording was made, as far as it differs from its own."""
    cls: type[MultiRobotTask] = get_task_class(full_name(task.task_class))
    own = cls.scenario
    found: dict[str, Any] = {"control_mode": plain_mode(task.control_mode)}
    if task.scenario.layout != own.layout:
        found["layout"] = written_layout(task.scenario.layout, folder)
    if task.scenario.bystanders is not None:
        found["bystanders"] = task.scenario.bystanders
    if task.scenario.randomization:
        found["randomization"] = task.scenario.randomization.to_json()
    kwargs = file.env_kwargs
    if kwargs.get("obs_mode", "none") != "none":
        found["obs_mode"] = kwargs["obs_mode"]
    if kwargs.get("reward_mode") not in (None, cls.reward_modes[0]):
        found["reward_mode"] = kwargs["reward_mode"]
    if size := kwargs.get("sensor_configs"):
        found["camera_size"] = [size["width"], size["height"]]
    if file.max_episode_steps not in (None, cls.max_episode_steps):
        found["max_episode_steps"] = file.max_episode_steps
    return found | (file.pictures or {})


def unknown_recording(recipe: Recipe, name: str) -> UnknownNameError:
    """Return the error for a recording that a recipe lacks."""
    return UnknownNameError("recording of the recipe", name, [r.name for r in recipe.recordings])

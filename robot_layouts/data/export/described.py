"""What a folder of data is, of which task, robots and cameras, and the card that says so.

Numbers of a recording (actions, states, poses) are made of none of the robots' files. Pictures and
points show their meshes, so licences that forbid commercial use hold for these, too.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any, NamedTuple

from layouts.export.files import licences_of
from robot_layouts.core.files import read_json
from robot_layouts.core.pages import fragment
from robot_layouts.data.reading.hdf5 import Hdf5File, damage_errors
from robot_layouts.data.reading.hub import CERTIFICATE, HubError
from robot_layouts.data.reading.json_files import (
    FILE,
    MAX_JSON,
    TrajectoryError,
    describe_source,
    manifest_path,
    read_summary,
)
from robot_layouts.data.reading.recording import Recording, all_files
from robots import RobotRegistry, UnknownNameError, UnreadableFileError
from robots.assets.locator import SCENERY
from robots.assets.manifest import load_manifest
from robots.control_modes import written_mode
from tasks import get_task_class, list_tasks
from tasks.language.bodies import packages_of

LEROBOT, ROBOMIMIC = "meta/info.json", ("low_dim.hdf5", "image.hdf5")
ORIGIN = "meta/recording.json"  # of a LeRobot export
_NO_PICTURES = ("none", "state", "state_dict")  # observation modes without
UNKNOWN = "unknown"
_FREE_OF_CHARGE, _ALIKE = "BY-NC", "BY-NC-SA"


@dataclass(frozen=True)
class Described:
    """A data set.

    Attributes:
        form: ``"recording"``, ``"LeRobot"`` or ``"robomimic"``.
        files: Its files, by their paths inside the folder.
        task_id: Id of its task.
        control_mode: What its actions ask for, of all arms or by arm.
        layout: What `describe_layout` wrote, by place; empty where the data does not say it.
        episodes: How many there are.
        steps: Control steps of all of them; None where only the episodes say it.
        sources: Who acted, in words.
        pictures: What it holds that shows meshes, in words: cameras, or ``"observations (rgb)"``.
        version: Of a LeRobot dataset's format.
    """

    form: str
    files: dict[str, Path]
    task_id: str
    control_mode: str | Mapping[str, str]
    layout: Mapping[str, Mapping[str, Any]]
    episodes: int
    steps: int | None
    sources: tuple[str, ...]
    pictures: tuple[str, ...]
    version: str | None = None


def describe(folder: Path) -> Described:
    """Return what a folder holds.

    Raises:
        HubError: If it is no data set of this library, or a recording that is not finished.
        TrajectoryError: If it cannot be read.
    """
    if (folder / FILE).is_file():
        return _recording(folder)
    try:
        if (folder / LEROBOT).is_file():
            return _lerobot(folder)
        for name in ROBOMIMIC:
            if (folder / name).is_file():
                return _robomimic(folder, folder / name)
    except (UnreadableFileError, KeyError, TypeError) as error:
        what = f"it lacks {error}" if isinstance(error, KeyError) else str(error)
        raise TrajectoryError(f"{folder} is no export of this library: {what}") from error
    known = ", ".join((FILE, LEROBOT, *ROBOMIMIC))
    raise HubError(f"{folder} holds neither a recording nor an export; one of {known} is missing")


def _recording(folder: Path) -> Described:
    first, parts = folder / FILE, (folder / FILE).with_suffix(".parts")
    if parts.is_dir() and any(parts.iterdir()):
        raise HubError(f"{folder} is not finished: {parts.name} holds episodes; record the rest")
    h5 = all_files(folder)
    beside = manifest_path(first), folder / CERTIFICATE
    paths = [p for file in h5 for p in (file, file.with_suffix(".json"))]
    paths += [path for path in beside if path.is_file()]
    entries = [(entry, summary) for summary in map(read_summary, h5) for entry in summary.episodes]
    with Recording(folder) as file:
        observed = str(file.env_kwargs.get("obs_mode") or "none")
        return Described(
            form="recording",
            files={path.name: path for path in paths},
            task_id=file.task_id,
            control_mode=file.control_mode,
            layout=file.layout or {},
            episodes=len(file),
            steps=sum(entry.steps or 0 for entry, _ in entries),
            sources=tuple(dict.fromkeys(describe_source(*one) for one in entries)),
            pictures=() if observed in _NO_PICTURES else (f"observations ({observed})",),
        )


def _lerobot(folder: Path) -> Described:
    info, origin = read_json(folder / LEROBOT, MAX_JSON), read_json(folder / ORIGIN, MAX_JSON)
    features: dict[str, Any] = info["features"]
    shown = [name for name, about in features.items() if about["dtype"] in ("video", "image")]
    return Described(
        form="LeRobot",
        **_exported(folder, origin),
        episodes=info["total_episodes"],
        steps=info["total_frames"],
        pictures=tuple(name.rpartition("observation.images.")[2] for name in shown),
        version=info["codebase_version"],
    )


def _robomimic(folder: Path, path: Path) -> Described:
    with (
        damage_errors(lambda why: TrajectoryError(f"{path} is no export of this library: {why}")),
        Hdf5File(path) as file,
    ):
        origin = json.loads((file.texts("data", ("recording",)) or {})["recording"])
        shapes = file.shapes("data")
        lengths = [shape[0] for name, shape in shapes.items() if name.endswith("/actions")]
        observed = file.shapes("data/demo_0/obs")
        seen = [name for name, shape in observed.items() if len(shape) == 4 or "points_" in name]
    return Described(
        form="robomimic",
        **_exported(folder, origin),
        episodes=len(lengths),
        steps=sum(lengths),
        pictures=tuple(seen),
    )


def _exported(folder: Path, origin: Mapping[str, Any]) -> dict[str, Any]:
    """Return what an export says of the recording that it was made of."""
    return {
        "files": {path.relative_to(folder).as_posix(): path for path in _everything(folder)},
        "task_id": origin["task_id"],
        "control_mode": origin["control_mode"],
        "layout": origin["layout"] or {},
        "sources": tuple(f"{actor['kind']} {actor['name']}" for actor in origin.get("actors", ()))
        or (origin["source_type"] or "unknown",),
    }


def _everything(folder: Path) -> Iterator[Path]:
    """Yield the files of a folder, without hidden ones and the card of another copy."""
    for path in sorted(folder.rglob("*")):
        inside = path.relative_to(folder)
        hidden = any(part.startswith(".") for part in inside.parts)
        if path.is_file() and not hidden and inside.as_posix() != "README.md":
            yield path


class UsedFiles(NamedTuple):
    """Files that a data set was made with.

    Attributes:
        name: What they are of.
        licence: Its short name; `UNKNOWN` if they are the user's own.
        words: What it asks for.
    """

    name: str
    licence: str = UNKNOWN
    words: str = "its author's; not known here"


def parts_of(data: Described) -> list[UsedFiles]:
    """Return the files of robots and things that a data set was made with, and their licences."""
    found: list[UsedFiles] = []
    for place, about in data.layout.items():
        name = f"{about['robot']} ({place})"
        try:
            robot = RobotRegistry.load(about["robot"])
        except UnknownNameError:
            found.append(UsedFiles(name))
        else:
            found += [UsedFiles(name, *licence) for licence in licences_of(robot)]
    if not data.layout:
        found.append(UsedFiles("its robots, which the data does not name"))
    if data.task_id not in list_tasks():
        found.append(UsedFiles(f"things of the task {data.task_id}"))
    if data.pictures:
        found.append(_of_package("table and floor", SCENERY))
        found += [_of_package(f"bodies of {data.task_id}", name) for name in _packages(data)]
    return found


def _packages(data: Described) -> list[str]:
    """Return the packages of the manifest that bodies of a data set's task are made of."""
    if data.task_id not in list_tasks():
        return []
    return sorted(packages_of(get_task_class(data.task_id).bodies.values()))


def _of_package(what: str, package: str) -> UsedFiles:
    origin = load_manifest().package(package).origin
    return UsedFiles(what, origin.licence, f"{origin.licence} ({origin.licence_note})")


def licence_for(data: Described, wanted: str | None) -> str | None:
    """Return the licence under which a data set is shared, as the Hub writes it; None if not said.

    Args:
        data: The data set.
        wanted: What its author wants.

    Raises:
        HubError: If the licences of what its pictures show forbid that, or are not known.
    """
    if not data.pictures:
        return wanted
    shown = parts_of(data)
    what = f"the pictures of this data set ({', '.join(data.pictures)}) show"
    unknown = [part.name for part in shown if part.licence == UNKNOWN]
    if unknown and wanted is None:
        raise HubError(
            f"{what} {' and '.join(unknown)}, whose licence is not known here; if you may share"
            " them, say under which licence with --licence"
        )
    bound = [part for part in shown if _FREE_OF_CHARGE in part.licence]
    alike = any(_ALIKE in part.licence for part in bound)
    needed = "cc-by-nc-sa-4.0" if alike else "cc-by-nc-4.0"
    given = (wanted or needed).lower()
    if bound and ("nc" not in given.split("-") or (alike and given != needed)):
        listed = ", ".join(f"{part.name}, {part.licence}" for part in bound)
        raise HubError(
            f"{what} {listed}: they may not be shared under {wanted}, but under {needed}; leave"
            " --licence out, or export without pictures"
        )
    return given


def card(data: Described, name: str, licence: str | None) -> str:
    """Return the card of a data set, as the Hub's README.md.

    Args:
        data: The data set.
        name: ``OWNER/NAME`` there.
        licence: See `licence_for`.
    """
    mode = data.control_mode
    text = fragment(
        "robot_layouts.data.export/card.md.jinja",
        data=data,
        name=name,
        licence=licence,
        control_mode=mode if isinstance(mode, str) else written_mode(mode),
        version=metadata.version("robot-layouts"),
        listed=data.task_id in list_tasks(),
        certified=any(file.startswith("certificate") for file in data.files),
        numbers=lambda values: ", ".join(f"{number:.4g}" for number in values),
        parts=dict.fromkeys(parts_of(data)),
    )
    return str(text)

"""Motions as files: JSON that says all there is to know, and is read with suspicion."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from kinematics.rotations import Floats
from layouts import Layout
from motion.model.obstacles import Held, Obstacle, Track
from motion.output.protocol import TimedMotion
from robots import RobotLayoutsError, UnreadableFileError
from robots.common.bounds import FAR, checked_number, shown
from robots.common.errors import MotionError, unknown_name_message
from robots.common.files import read_json
from robots.common.writing import write_whole

FORMAT, VERSION = "robot-layouts motion", 1
MAX_BYTES = 1 << 28
ENDING = ".json"
UNITS = "s, m, rad; m/s and rad/s; m/s² and rad/s²; null is no limit; poses are 4 × 4 matrices"
KEYS = (
    "format",
    "version",
    "units",
    "layout",
    "joints",
    "times",
    "positions",
    "velocities",
    "obstacles",
    "held",
    "table",
    "clearance",
    "largest_velocities",
    "largest_accelerations",
)

_T = TypeVar("_T")


def save_motion(motion: TimedMotion, path: str | PathLike[str]) -> Path:
    """Write a motion to a file, whole or not at all; see `motion.Motion.save`."""
    target = Path(path)
    if target.suffix.lower() != ENDING:
        raise MotionError(f"cannot save a motion as {target.name!r}; the name must end in {ENDING}")
    document = {
        "format": FORMAT,
        "version": VERSION,
        "units": UNITS,
        "layout": motion.layout.to_yaml(target.parent),
        "joints": {name: list(p.robot.joints) for name, p in motion.layout.items()},
        "times": motion.times.tolist(),
        "positions": _lists(motion.positions),
        "velocities": _lists(motion.velocities),
        "obstacles": [_obstacle(obstacle) for obstacle in motion.obstacles],
        "held": [
            {"place": held.place, "obstacle": _obstacle(held.obstacle)} for held in motion.held
        ],
        "table": None if motion.table is None else list(motion.table),
        "clearance": motion.clearance,
        "largest_velocities": _limits(motion.largest_velocities),
        "largest_accelerations": _limits(motion.largest_accelerations),
    }
    lines = [f"{json.dumps(key)}: {json.dumps(value)}" for key, value in document.items()]
    write_whole(target, "{\n" + ",\n".join(lines) + "\n}\n")
    return target


def load_motion(path: str | PathLike[str], make: Callable[..., _T]) -> _T:
    """Return the motion in a file; see `motion.Motion.load`.

    Args:
        path: The file.
        make: Makes a motion of its fields.
    """
    try:
        return make(**_fields(read_json(path, MAX_BYTES), Path(path).parent))
    except UnreadableFileError as error:
        raise MotionError(str(error)) from error
    except RobotLayoutsError as error:
        raise MotionError(f"{Path(path)}: {error}") from error


def _fields(document: Any, folder: Path) -> dict[str, Any]:
    _expect_document(document)
    layout = Layout.from_yaml(_text("layout", document["layout"]), folder)
    _expect_joints(layout, _mapping("joints", document["joints"]))
    by_robot = ("positions", "velocities", "largest_velocities", "largest_accelerations")
    table = document["table"]
    return {
        "layout": layout,
        "times": _numbers("times", document["times"]),
        **{name: _arrays(name, document[name], layout) for name in by_robot},
        "obstacles": tuple(_each("obstacles", document["obstacles"], _read_obstacle)),
        "held": tuple(_each("held", document["held"], _read_held)),
        "table": None if table is None else tuple(_numbers("table", table, 4).tolist()),
        "clearance": checked_number("clearance", document["clearance"], 0.0, FAR, MotionError, "m"),
    }


def _expect_document(document: Any) -> None:
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        raise MotionError(f"it is no motion: its format is not {FORMAT!r}")
    if document.get("version") != VERSION:
        raise MotionError(
            f"its version is {shown(document.get('version'))}; this library reads {VERSION}"
        )
    for key in document:
        if key not in KEYS:
            raise MotionError(unknown_name_message("key of a motion", key, KEYS))
    missing = [key for key in KEYS if key not in document]
    if missing:
        raise MotionError(f"it lacks {', '.join(missing)}")


def _expect_joints(layout: Layout, joints: Mapping[str, Any]) -> None:
    for name, placement in layout.items():
        if joints.get(name) != list(placement.robot.joints):
            raise MotionError(
                f"its robot {name!r} has the joints {shown(joints.get(name))}; a"
                f" {placement.robot.name} has {', '.join(placement.robot.joints)}"
            )


def _lists(arrays: Mapping[str, Floats]) -> dict[str, Any]:
    return {name: array.tolist() for name, array in arrays.items()}


def _limits(arrays: Mapping[str, Floats]) -> dict[str, Any]:
    return {
        name: [x if np.isfinite(x) else None for x in array.tolist()]
        for name, array in arrays.items()
    }


def _obstacle(obstacle: Obstacle) -> dict[str, Any]:
    pose = obstacle.pose
    where: dict[str, Any] = (
        {"track": {"times": pose.times.tolist(), "poses": pose.poses.tolist()}}
        if isinstance(pose, Track)
        else {"pose": pose.tolist()}
    )
    return {"name": obstacle.name, "shapes": [s.tolist() for s in obstacle.shapes], **where}


def _read_obstacle(value: Any) -> Obstacle:
    given = _mapping("an obstacle", value)
    shapes = [_numbers("a shape", shape) for shape in _each("shapes", given.get("shapes"), _same)]
    if any(shape.ndim != 2 or shape.shape[1] != 3 for shape in shapes):
        raise MotionError("a shape is a list of corners, each x, y, z")
    if "track" in given:
        track = _mapping("a track", given["track"])
        rows = (_numbers(f"{key} of a track", track.get(key)) for key in ("times", "poses"))
        return Obstacle(given.get("name", ""), tuple(shapes), Track(*rows))
    pose = _numbers("the pose of an obstacle", given.get("pose"))
    return Obstacle(given.get("name", ""), tuple(shapes), pose)


def _read_held(value: Any) -> Held:
    given = _mapping("what is held", value)
    return Held(_text("a place", given.get("place")), _read_obstacle(given.get("obstacle")))


def _arrays(what: str, value: Any, layout: Layout) -> dict[str, Floats]:
    given = _mapping(what, value)
    limits = what.startswith("largest")
    read = {name: _without_null(rows) if limits else rows for name, rows in given.items()}
    return {name: _numbers(f"{what} of {name}", rows) for name, rows in read.items()}


def _without_null(value: Any) -> Any:
    return [np.inf if x is None else x for x in value] if isinstance(value, list) else value


def _numbers(what: str, value: Any, count: int | None = None) -> Floats:
    try:
        array = np.array(value)
    except ValueError:  # rows of different lengths
        array = np.array(None)
    if array.dtype.kind not in "if":
        raise MotionError(f"{what} is {shown(value)}; it must be numbers, in rows of one length")
    if count is not None and array.shape != (count,):
        raise MotionError(f"{what} is {shown(value)}; it must be {count} numbers")
    return array.astype(float)


def _mapping(what: str, value: Any) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise MotionError(f"{what} is {shown(value)}; it must be an object")
    return value


def _text(what: str, value: Any) -> str:
    if not isinstance(value, str):
        raise MotionError(f"{what} is {shown(value)}; it must be a text")
    return value


def _each(what: str, value: Any, read: Callable[[Any], _T]) -> Sequence[_T]:
    if not isinstance(value, list):
        raise MotionError(f"{what} is {shown(value)}; it must be a list")
    return [read(item) for item in value]


def _same(value: Any) -> Any:
    return value

"""Motions as files: JSON, read with suspicion; tables and ROS 2 trajectories for other programs.

The JSON says all there is to know of a motion, from which it is made again.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Mapping, Sequence
from io import StringIO
from os import PathLike
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

import numpy as np
import yaml
from typing_extensions import NotRequired, TypedDict

from layouts import Layout
from layouts.export.cell import ExportedCell
from layouts.export.ros2.groups import PlanningGroup, PlanningGroups, RosNames
from robot_layouts.core.bounds import FAR, checked_number, shown
from robot_layouts.core.errors import MotionError, unknown_name_message
from robot_layouts.core.files import read_json
from robot_layouts.core.schema import AnyText, check, exactly, length, within
from robot_layouts.core.writing import write_new, write_whole
from robot_layouts.kinematics.rotations import Floats
from robot_layouts.motion.model.obstacles import Held, Obstacle, Track
from robot_layouts.motion.timed_motion import TimedMotion
from robots import RobotLayoutsError, UnreadableFileError

FORMAT, VERSION = "robot-layouts motion", 1
MAX_BYTES = 1 << 28
ENDING = ".json"
UNITS = "s, m, rad; m/s and rad/s; m/s² and rad/s²; null is no limit; poses are 4 × 4 matrices"
_Rows = list[list[float]]
_NANOSECONDS = 10**9
_SLOWEST, _FASTEST = 1e-3, 1e6  # Hz


class _Track(TypedDict):
    times: list[float]
    poses: list[_Rows]


class _Obstacle(TypedDict):
    name: AnyText
    shapes: list[list[Annotated[list[float], length(3)]]]
    pose: NotRequired[_Rows]
    track: NotRequired[_Track]


class _Held(TypedDict):
    place: AnyText
    obstacle: _Obstacle


class _Motion(TypedDict):
    format: Annotated[str, exactly(FORMAT)]
    version: Literal[1]
    units: AnyText
    layout: AnyText
    joints: dict[str, list[AnyText]]
    times: list[float]
    positions: dict[str, _Rows]
    velocities: dict[str, _Rows]
    obstacles: list[_Obstacle]
    held: list[_Held]
    table: Annotated[list[float], length(4)] | None
    clearance: Annotated[float, within(0.0, FAR, "m")]
    largest_velocities: dict[str, list[float | None]]
    largest_accelerations: dict[str, list[float | None]]


_T = TypeVar("_T")


def save_motion(motion: TimedMotion, path: str | PathLike[str]) -> Path:
    """Write a motion to a file, whole or not at all; see `robot_layouts.motion.Motion.save`."""
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
    """Return the motion in a file; see `robot_layouts.motion.Motion.load`.

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
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        raise MotionError(f"it is no motion: its format is not {FORMAT!r}")
    for key in document:
        if key not in _Motion.__annotations__:
            raise MotionError(unknown_name_message("key of a motion", key, _Motion.__annotations__))
    document = check(document, _Motion, "", MotionError)
    layout = Layout.from_yaml(document["layout"], folder)
    _expect_joints(layout, document["joints"])
    rows = ("positions", "velocities", "largest_velocities", "largest_accelerations")
    table = document["table"]
    return {
        "layout": layout,
        "times": np.array(document["times"], float),
        **{
            name: {k: _array(f"{name} of {k}", v) for k, v in document[name].items()}
            for name in rows
        },
        "obstacles": tuple(map(_read_obstacle, document["obstacles"])),
        "held": tuple(Held(h["place"], _read_obstacle(h["obstacle"])) for h in document["held"]),
        "table": None if table is None else tuple(map(float, table)),
        "clearance": float(document["clearance"]),
    }


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


def _read_obstacle(given: _Obstacle) -> Obstacle:
    shapes = tuple(np.array(shape, float).reshape(-1, 3) for shape in given["shapes"])
    if (track := given.get("track")) is not None:
        poses = _array("poses of a track", track["poses"])
        return Obstacle(given["name"], shapes, Track(np.array(track["times"], float), poses))
    if "pose" not in given:
        raise MotionError(f"the obstacle {given['name']!r} has neither a pose nor a track")
    return Obstacle(given["name"], shapes, _array("the pose of an obstacle", given["pose"]))


def _array(what: str, rows: Sequence[Any]) -> Floats:
    """Return numbers as an array; null, where there is no limit, is infinite."""
    try:
        return np.array([np.inf if row is None else row for row in rows], float)
    except ValueError:
        raise MotionError(f"{what} has rows of different lengths") from None


def to_csv(
    motion: TimedMotion, folder: str | PathLike[str], frequency: float | None = None
) -> list[Path]:
    """Write a table for each robot; see `robot_layouts.motion.Motion.to_csv`."""
    times = moments(motion, frequency)
    positions, velocities = motion.sample(times), motion.velocity(times)
    texts: dict[str, str] = {}
    for name, placement in motion.layout.items():
        joints = placement.robot.joints
        text = StringIO()
        table = csv.writer(text, lineterminator="\n")
        table.writerow(["time", *joints, *(f"{joint}.velocity" for joint in joints)])
        rows = np.hstack([times[:, None], positions[name], velocities[name]])
        table.writerows([repr(x) for x in row] for row in rows.tolist())
        texts[f"{name}.csv"] = text.getvalue()
    return write_new(Path(folder), texts)


def to_ros2(
    motion: TimedMotion, folder: str | PathLike[str], frequency: float | None = None
) -> list[Path]:
    """Write a trajectory for each controller; see `robot_layouts.motion.Motion.to_ros2`."""
    times = moments(motion, frequency)
    cell = ExportedCell.read(motion.layout, visuals=False)
    names = RosNames(cell)
    groups = PlanningGroups(cell, names)
    positions, velocities = motion.sample(times), motion.velocity(times)
    texts: dict[str, str] = {}
    for group in groups.own:
        columns = _columns(motion, group)
        if columns is None:
            continue
        rows = [table[group.place][:, columns] for table in (positions, velocities)]
        trajectory = _trajectory(groups.joints(group), times, *rows)
        texts[f"{group.controller}.yaml"] = yaml.safe_dump(
            trajectory, sort_keys=False, default_flow_style=None, width=10**6
        )
    return write_new(Path(folder), texts)


def moments(motion: TimedMotion, frequency: float | None) -> Floats:
    """Return the times of the knots, or as many per second, the motion's end included, (n,) (s).

    Raises:
        MotionError: If the frequency is invalid.
    """
    if frequency is None:
        return motion.times
    hertz = checked_number("frequency", frequency, _SLOWEST, _FASTEST, MotionError, "Hz")
    times = np.arange(0.0, motion.duration, 1 / hertz)
    return np.append(times, motion.duration)


def _columns(motion: TimedMotion, group: PlanningGroup) -> list[int] | None:
    """Return where the joints of a group are among its robot's; None if one is not driven."""
    joints = motion.layout[group.place].robot.joints
    known = all(joint in joints for joint in group.driven)
    return [joints.index(joint) for joint in group.driven] if known and group.driven else None


def _trajectory(
    joints: list[str], times: Floats, positions: Floats, velocities: Floats
) -> dict[str, Any]:
    """Return a ``trajectory_msgs/msg/JointTrajectory``."""
    return {
        "header": {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""},
        "joint_names": joints,
        "points": [
            {
                "positions": where,
                "velocities": speeds,
                "accelerations": [],
                "effort": [],
                "time_from_start": _duration(time),
            }
            for time, where, speeds in zip(
                times.tolist(), positions.tolist(), velocities.tolist(), strict=True
            )
        ],
    }


def _duration(seconds: float) -> dict[str, int]:
    whole, rest = divmod(round(seconds * _NANOSECONDS), _NANOSECONDS)
    return {"sec": whole, "nanosec": rest}

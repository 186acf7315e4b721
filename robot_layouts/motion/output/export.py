"""Motions for other programs: tables of numbers, and trajectories of ROS 2's controllers."""

from __future__ import annotations

import csv
from io import StringIO
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from layouts.export.cell import ExportedCell
from layouts.export.ros2.groups import PlanningGroup, PlanningGroups, RosNames
from robot_layouts.core.bounds import checked_number
from robot_layouts.core.errors import MotionError
from robot_layouts.core.new_files import write_new
from robot_layouts.kinematics.rotations import Floats
from robot_layouts.motion.output.protocol import TimedMotion

_NANOSECONDS = 10**9
_SLOWEST, _FASTEST = 1e-3, 1e6  # Hz


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

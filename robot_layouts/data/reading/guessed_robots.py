"""Robots that were guessed from a user's own URDF or MJCF: how a recording names them."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import TypedDict

from layouts import Layout
from robot_layouts.core.files import read_regular
from robot_layouts.core.schema import AnyText
from robot_layouts.data.reading.summary import TrajectoryError
from robots import (
    LocalMjcf,
    LocalUrdf,
    NativeAgent,
    RobotDescriptor,
    RobotRegistry,
    UnreadableFileError,
)
from robots.mjcf.locator import is_mjcf
from robots.urdf.cleaning.cleaning import is_template
from robots.urdf.summary import MAX_URDF_BYTES

# Fields that digests of 0.2.0 lack, with their defaults.
NEWER_FIELDS = {"no_floor_contact": (), "native_agent": NativeAgent()}
_NEWER_IN_GROUPS = ", approximate_ik=False"  # as it is written in a joint group


class _Guessed(TypedDict):
    urdf: AnyText
    sha256: AnyText
    descriptor: AnyText


GUESSED = dict[str, _Guessed] | None


def describe_guessed(layout: Layout) -> dict[str, dict[str, str]]:
    """Return, by place, the URDF of each robot that no registry knows, and what is made of it.

    Each has ``urdf``, the file's absolute path, its ``sha256``, and ``descriptor``, a SHA-256 over
    the descriptor's other fields. Robots that are registered, or made of several files, are not
    among them.

    Raises:
        UnreadableFileError: If a URDF cannot be read.
    """
    return {
        place: {
            "urdf": str(path),
            "sha256": _checksum(path),
            "descriptor": descriptor_digest(placement.robot),
        }
        for place, placement in layout.items()
        if (path := _own_file(placement.robot)) is not None
    }


def guess_again(place: str, recorded: Mapping[str, str], name: str) -> RobotDescriptor:
    """Return the robot of a recording, guessed from the same file.

    The file is parsed only if it has the recorded checksum, so that a recording of somebody else
    makes nothing of other files. A xacro template is not expanded: it is a program.

    Args:
        place: Its place.
        recorded: What `describe_guessed` returned of it.
        name: Its name.

    Raises:
        TrajectoryError: If the file, or what is guessed from it, is another one, or a template.
    """
    path = Path(recorded["urdf"])
    helps = f"name the robot, with --robots {place}=… or robots={{{place!r}: …}}"
    try:
        contents = read_regular(path, MAX_URDF_BYTES)
    except UnreadableFileError as error:
        raise TrajectoryError(
            f"the robot of {place!r} was guessed from {path}, which cannot be read"
            f" ({error.strerror}); {helps}"
        ) from error
    if hashlib.sha256(contents).hexdigest() != recorded["sha256"]:
        raise TrajectoryError(
            f"the robot of {place!r} was guessed from {path}, which has changed since; {helps}"
        )
    if not is_mjcf(path) and is_template(contents, str(path)):
        raise TrajectoryError(
            f"the robot of {place!r} was guessed from {path}, a xacro template, which is a"
            f" program and does not run because a file names it; {helps}"
        )
    robot = RobotDescriptor.from_urdf(path, name, quiet=True)
    if descriptor_digest(robot) != recorded["descriptor"]:
        raise TrajectoryError(
            f"the robot of {place!r} is not what is guessed from {path} now, with this version of"
            f" the library and these packages, or fields of it were given; {helps}"
        )
    return robot


def _own_file(robot: RobotDescriptor) -> Path | None:
    if not isinstance(robot.urdf, LocalUrdf | LocalMjcf):
        return None
    if robot.name in RobotRegistry.names() and RobotRegistry.load(robot.name) == robot:
        return None
    path = Path(robot.urdf.path).expanduser().absolute()
    if is_mjcf(path) != isinstance(robot.urdf, LocalMjcf):
        return None  # which its path alone does not tell
    return path if path.is_file() else None  # and no template with arguments


def _checksum(path: Path) -> str:
    return hashlib.sha256(read_regular(path, MAX_URDF_BYTES)).hexdigest()


def descriptor_digest(robot: RobotDescriptor) -> str:
    """Return a SHA-256, in hex, over all fields of a descriptor but where its files are.

    Newer fields count where they differ from their defaults, so that older digests stay.
    """
    counted = [f.name for f in fields(robot) if f.compare and f.name != "urdf"]
    values = {name: getattr(robot, name) for name in counted}
    for name, default in NEWER_FIELDS.items():
        if values[name] == default:
            del values[name]
    values["keyframes"] = dict(robot.keyframes)
    written = repr(values).replace(_NEWER_IN_GROUPS, "")
    return hashlib.sha256(written.encode()).hexdigest()

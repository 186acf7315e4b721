"""An MJCF as a robot of this library: a URDF in the local copy of robot files, and hints."""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from robot_layouts.core.paths import default_root
from robot_layouts.kinematics.rotations import Floats
from robots.assets.assembled import write_folder
from robots.guessing.hints import Hints
from robots.mjcf.couplings import Couplings, find_couplings
from robots.mjcf.reading import (
    MjcfText,
    Model,
    compiled,
    in_radians,
    name_of,
    read_mjcf,
    says_angles,
)
from robots.mjcf.robot import HINGE, MjcfRobot, dry_friction, find_drives, find_efforts, find_robot
from robots.mjcf.to_urdf import excluded, write_urdf

FORM = 2  # of what is made of an MJCF; counted up whenever that changes
SOURCE = "the MJCF"
KEPT = 8  # robots that are kept in memory


@dataclass(frozen=True)
class Converted:
    """A robot that an MJCF describes.

    Attributes:
        name: What the MJCF calls it.
        xml: Its URDF.
        meshes: Contents of meshes, by file name beside the URDF.
        hints: What the MJCF knows and a URDF does not say.
        frames: Pose of each body's frame in its link's, by link, (4, 4) (m).
    """

    name: str
    xml: bytes
    meshes: dict[str, bytes]
    hints: Hints
    frames: dict[str, Floats]


def convert(path: Path) -> Converted:
    """Return the robot that an MJCF describes; the same contents are converted once.

    Args:
        path: Absolute path.

    Raises:
        AssetError: If the MJCF or a file of it cannot be read, MuJoCo refuses it, or it has what
            no URDF can have.
        DescriptorError: If nothing moves in it.
        MissingPackageError: If MuJoCo is not installed.
    """
    return _convert(path, read_mjcf(path))


def locate(path: Path) -> Path:
    """Return the URDF of an MJCF, in a folder that is named by what it was made of.

    Args:
        path: Absolute path of the MJCF.

    Raises:
        AssetError: As `convert`.
        DescriptorError: As `convert`.
        MissingPackageError: If it has to be converted, and MuJoCo is not installed.
        UnwritableFileError: If the folder cannot be written.
    """
    text = read_mjcf(path)
    key = f"{FORM} {path.stem} {text.digest}"
    folder = default_root() / "mjcf" / hashlib.sha256(key.encode()).hexdigest()[:16]
    urdf = folder / f"{path.stem}.urdf"
    if not urdf.is_file():
        made = _convert(path, text)
        write_folder(folder, {**made.meshes, urdf.name: made.xml})
    return urdf


@lru_cache(maxsize=KEPT)
def _convert(path: Path, text: MjcfText) -> Converted:
    model, repaired = compiled(text, path)
    robot = find_robot(model, path)
    if doubts := _doubts(robot, text):
        model, repaired = compiled(in_radians(text), path)
        robot = find_robot(model, path)
    couplings = find_couplings(robot, path)
    urdf = write_urdf(robot, couplings, find_efforts(robot), text.name)
    rubbing = dry_friction(robot)
    notes = [*doubts, *repaired, *robot.notes, *couplings.notes, *urdf.notes]
    if rubbing:
        notes.append(
            f"dry friction of {', '.join(rubbing)} is left out: PhysX has none in N·m or N"
        )
    hints = Hints(
        source=SOURCE,
        postures=_postures(model, robot, couplings),
        first_is_home=True,
        allowed=excluded(robot),
        drives=find_drives(robot),
        frames_at_joints=True,
        reasons=tuple(f"MJCF: {note}" for note in notes),
    )
    return Converted(text.name, urdf.xml, urdf.meshes, hints, urdf.frames)


def _doubts(robot: MjcfRobot, text: MjcfText) -> list[str]:
    """Return that angles are taken for radians, if the ranges look like it and nothing is said."""
    model = robot.model
    hinges = [j for j in robot.moving if model.jnt_type[j] == HINGE and model.jnt_limited[j]]
    widest = max((float(np.ptp(model.jnt_range[joint])) for joint in hinges), default=math.inf)
    if widest >= math.radians(2 * math.pi) or says_angles(text):
        return []
    return [
        f"angles are taken for radians, as no hinge would turn by more than"
        f' {math.degrees(widest):.2g}° otherwise; <compiler angle="degree"/> in the MJCF keeps them'
    ]


def _postures(model: Model, robot: MjcfRobot, couplings: Couplings) -> dict[str, dict[str, float]]:
    """Return where the joints are in each keyframe (rad, m)."""
    postures: dict[str, dict[str, float]] = {}
    for key in range(model.nkey):
        name = name_of(model, "key", key) or f"key{key}"
        postures[name] = {
            robot.names[joint]: float(model.key_qpos[key, model.jnt_qposadr[joint]])
            for joint in robot.moving
            if joint not in couplings.fixed
        }
    return {name: at for name, at in postures.items() if np.isfinite(list(at.values())).all()}

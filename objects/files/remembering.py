"""What was made of a file, kept in the local copy: the next process only reads it."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import asdict, fields, replace
from hashlib import sha256
from pathlib import Path
from typing import Any

from objects.descriptor import Grasp, NamedPoint
from objects.family import Made
from objects.joints import Joint
from objects.shapes import SIZED, Finish, Friction, Mesh, Shape
from robot_layouts.core.errors import AssetError
from robot_layouts.core.files import read_text
from robot_layouts.core.paths import default_root
from robots.assets.assembled import write_folder

VERSION = 3  # of what is made of files; another one makes them anew
FOLDER, THING = "objects", "object.json"
_LARGEST = 1 << 26  # bytes
_KINDS = {kind.__name__: kind for kind in SIZED}

Files = Mapping[str, bytes]
"""Contents by name, which the shapes of a thing refer to."""


def remembered(
    contents: bytes, options: object, folder: Path | None, make: Callable[[], tuple[Made, Files]]
) -> Made:
    """Return what is made of a file; it is made once, and then read from the local copy.

    Args:
        contents: Of the file.
        options: How it is to be made, as something whose text says all.
        folder: Where the files are that its shapes name; None for those that `make` gives.
        make: Makes it, with files that belong to it.

    Raises:
        AssetError: If what the local copy has of it is damaged.
        UnwritableFileError: If it cannot be written.
    """
    text = f"{VERSION} {sha256(contents).hexdigest()} {options!r}"
    place = default_root() / FOLDER / sha256(text.encode()).hexdigest()[:20]
    kept = place / THING
    if not kept.is_file():
        made, files = make()
        write_folder(place, {**files, THING: json.dumps(_plain(made)).encode()})
    try:
        return _made(json.loads(read_text(kept, _LARGEST)), folder or place)
    except (ValueError, KeyError, TypeError) as error:
        raise AssetError(f"{kept} is damaged ({error}); delete the folder that it is in") from error


def _plain(made: Made) -> dict[str, Any]:
    return {
        "parts": [_plain_shape(part) for part in made.parts],
        "joints": [
            {**vars(joint), "parts": [_plain_shape(part) for part in joint.parts]}
            for joint in made.joints
        ],
        "rests": dict(made.rests),
        "points": {name: asdict(point) for name, point in made.points.items()},
        "grasps": [list(vars(grasp).values()) for grasp in made.grasps],
    }


def _plain_shape(shape: Shape) -> dict[str, Any]:
    usual = {field.name: field.default for field in fields(shape)}
    given = {name: value for name, value in vars(shape).items() if value != usual[name]}
    for name in ("friction", "finish"):
        if name in given:
            given[name] = asdict(given[name])
    return {"kind": type(shape).__name__, **given}


def _made(plain: dict[str, Any], folder: Path) -> Made:
    return Made(
        parts=[_shape(part, folder) for part in plain["parts"]],
        joints=[_joint(joint, folder) for joint in plain["joints"]],
        rests={name: tuple(turn) for name, turn in plain["rests"].items()},
        points={name: NamedPoint(**point) for name, point in plain["points"].items()},
        grasps=[Grasp(*grasp) for grasp in plain["grasps"]],
    )


def _joint(plain: dict[str, Any], folder: Path) -> Joint:
    given: dict[str, Any] = {**plain, "parts": tuple(_shape(p, folder) for p in plain["parts"])}
    return Joint(**given)


def _shape(plain: dict[str, Any], folder: Path) -> Shape:
    given = dict(plain)
    kind = _KINDS[given.pop("kind")]
    for name, made_of in (("friction", Friction), ("finish", Finish)):
        if name in given:
            given[name] = made_of(**given[name])
    shape = kind(**given)
    return replace(shape, file=folder / shape.path) if isinstance(shape, Mesh) else shape

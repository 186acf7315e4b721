"""The packages of this library, the folders that play episodes, and packages that hide one."""

from __future__ import annotations

from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path

PACKAGES = ("robots", "objects", "layouts", "tasks", "robot_layouts")

PLAYING = (
    "robot_layouts/core",
    "robot_layouts/kinematics",
    "robots",
    "objects",
    "layouts",
    "robot_layouts/motion",
    "robot_layouts/simulation",
    "tasks",
    "robot_layouts/experts",
    "robot_layouts/data/playing",
)
"""What has a part in an episode; the rest of `robot_layouts.data` only writes things down."""

_HOME = Path(__file__).resolve().parents[2]


def expect_own(*rooms: str) -> None:
    """Refuse packages that hide those of this library, as files in the present folder may do.

    Raises:
        ImportError: If there is one; says where it is, and what helps.
    """
    for room in rooms:
        spec = None
        with suppress(ValueError):  # of a module that Python runs as a script
            spec = find_spec(room)
        origin = None if spec is None else spec.origin
        if origin is not None and Path(origin).resolve().parent != _HOME / room:
            raise ImportError(
                f"{origin} hides the package {room!r} of robot-layouts, which is in {_HOME}. Rename"
                " it, or keep its folder off Python's path: `python -m` puts the present folder"
                " first there, a script its own; commands called as `robot-layouts …` do neither",
                name=room,
                path=origin,
            )

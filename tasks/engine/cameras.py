"""Which cameras a task has, what they are called, and cameras that take larger pictures."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from layouts import Layout
from robot_layouts.core.bounds import checked_whole, shown
from robot_layouts.simulation.scene.cameras import AnyCamera, Camera, RobotCamera, camera_name
from robots import TaskError
from tasks.native.format import observation_keys

Size = tuple[int, int]
"""Width and height of a picture (pixels)."""

_MOST_PIXELS = 16384  # of a side, as of `robot_layouts.simulation.Camera`


def cameras_of(layout: Layout, cameras: Iterable[Camera]) -> dict[str, AnyCamera]:
    """Return every camera of a task under native's name: its own first, then each robot's.

    Raises:
        TaskError: If two have the same name.
    """
    found: dict[str, AnyCamera] = {}
    for camera in cameras:
        if camera.name in found:
            raise TaskError(f"two cameras are called {camera.name!r}; names must differ")
        found[camera.name] = camera
    for robot, key in observation_keys(layout).items():
        for mount in layout[robot].robot.cameras:
            name = mount.name if key is None else f"{key}-{mount.name}"
            if name in found:
                raise TaskError(
                    f"a camera of the task and one of the robot {robot!r} are called {name!r};"
                    " give the task's another name"
                )
            found[name] = RobotCamera(robot, mount)
    return found


def resized(camera: AnyCamera, size: Size | None) -> AnyCamera:
    """Return a camera that takes pictures of another size; its view is as high as before."""
    if size is None:
        return camera
    width, height = size
    if isinstance(camera, RobotCamera):
        return replace(camera, mount=replace(camera.mount, width=width, height=height))
    return replace(camera, width=width, height=height)


def checked_size(what: str, value: Any) -> Size:
    """Return a size of pictures.

    Raises:
        TaskError: If it is not a size.
    """
    if not isinstance(value, Sequence) or isinstance(value, str) or len(value) != 2:
        raise TaskError(f"{what} is {shown(value)}; width and height (pixels) are needed")
    width, height = (checked_whole(what, side, 1, _MOST_PIXELS, TaskError) for side in value)
    return width, height


def by_place(cameras: Mapping[str, AnyCamera]) -> dict[str, AnyCamera]:
    """Return cameras by their names by place, in the same order.

    Args:
        cameras: Camera by its name in observations.

    Raises:
        TaskError: If two are called the same then.
    """
    names = list(map(camera_name, cameras.values()))
    expect_apart(names)
    return dict(zip(names, cameras.values(), strict=True))


def expect_apart(names: Iterable[str]) -> None:
    """Refuse names of which two are the same.

    Raises:
        TaskError: If so.
    """
    seen = set[str]()
    for name in names:
        if name in seen:
            raise TaskError(
                f"pictures of two cameras would both be called {name!r}; give one of the cameras"
                " another name"
            )
        seen.add(name)

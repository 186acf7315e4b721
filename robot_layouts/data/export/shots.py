"""Which pictures an export holds of every moment: whose, how large, with depth or without."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot_layouts.simulation.cameras import AnyCamera, RobotCamera
from robot_layouts.simulation.rendering import SIZE
from robots import TaskError, UnknownNameError
from tasks import TaskEnv
from tasks.engine.cameras import (
    Size,
    by_place,
    cameras_of,
    configured,
    expect_apart,
    resized,
)
from tasks.engine.columns import OVERVIEW, Viewpoint, overview

ALL = "all"  # every camera of the task and its robots
RGB, DEPTH = "rgb", "depth"

Picture = NDArray[Any]  # uint8 (colours) or int16 (mm)


@dataclass(frozen=True)
class PictureChannel:
    """One picture of every moment.

    Attributes:
        camera: Whose, by place: ``base_camera``, ``left.hand_camera``, ``overview``.
        texture: ``"rgb"``, or ``"depth"`` (mm).
        width: Pixels.
        height: Pixels.
    """

    camera: str
    texture: str
    width: int
    height: int

    @property
    def shape(self) -> tuple[int, int, int]:
        """Height, width, and 3 colours, or 1 distance."""
        return self.height, self.width, 3 if self.texture == RGB else 1

    @property
    def dtype(self) -> type[np.generic]:
        """Type of a pixel's numbers."""
        return np.uint8 if self.texture == RGB else np.int16


Frame = Mapping[PictureChannel, Picture]
"""All pictures of one moment."""


@dataclass(frozen=True)
class Shots:
    """What is drawn of every moment.

    Attributes:
        cameras: Those of the task and its robots that are drawn, by place, as large as they are to
            be.
        viewpoint: From where the overview is drawn, which people look at; None if it is not.
        depth: Whether the cameras tell of depth, too.
    """

    cameras: Mapping[str, AnyCamera]
    viewpoint: Viewpoint | None = None
    depth: bool = False

    @property
    def textures(self) -> tuple[str, ...]:
        """What the cameras record."""
        return (RGB, DEPTH) if self.depth else (RGB,)

    @property
    def channels(self) -> list[PictureChannel]:
        """Every picture of a moment, in the order of the dataset."""
        whole = [PictureChannel(OVERVIEW, RGB, SIZE, SIZE)] if self.viewpoint else []
        return whole + [
            PictureChannel(name, texture, *size_of(camera))
            for name, camera in self.cameras.items()
            for texture in self.textures
        ]


def choose_shots(
    task: TaskEnv,
    names: Sequence[str],
    *,
    size: Size | None = None,
    depth: bool = False,
) -> Shots:
    """Return what is drawn of a task.

    Args:
        task: The task.
        names: Cameras by place, ``"overview"``, or ``"all"`` for those of the task and its robots.
        size: Width and height of their pictures (pixels); None: each camera's own. That of the
            overview stays.
        depth: Whether they tell of depth, too.

    Raises:
        UnknownNameError: If there is no such camera.
        TaskError: If no camera is left to be drawn, two are called the same, or a name cannot be
            that of a file.
    """
    cameras = cameras_of(task.layout, task.scenario.cameras or task.cameras)
    known = by_place(configured(cameras, task.scenario.sensor_configs or {}, "sensor_configs"))
    expect_apart([*known, OVERVIEW])
    _expect_file_names(known)
    for name in names:
        if name not in (*known, ALL, OVERVIEW):
            raise UnknownNameError("camera", name, (ALL, OVERVIEW, *known))
    chosen = {
        name: resized(camera, size)
        for name, camera in known.items()
        if ALL in names or name in names
    }
    if not chosen and (OVERVIEW not in names or depth or size is not None):
        raise TaskError(
            "no camera is drawn whose size or depth could be chosen: the overview has neither"
            if OVERVIEW in names
            else f"{task.task_id} with these robots has no camera; {OVERVIEW!r} shows all of it"
        )
    view = overview(task.layout) or task.viewpoint
    return Shots(chosen, view if OVERVIEW in names else None, depth)


def size_of(camera: AnyCamera) -> Size:
    """Return width and height of what a camera sees (pixels)."""
    lens = camera.mount if isinstance(camera, RobotCamera) else camera
    return lens.width, lens.height


def _expect_file_names(names: Iterable[str]) -> None:
    for name in names:
        if not name or "/" in name or "\0" in name:
            raise TaskError(
                f"a camera is called {name!r}; exports name files by it, so it takes no '/'"
            )

"""One picture of several draws of a task: what varies from episode to episode, to be looked at."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from robot_layouts.core.bounds import checked_whole
from robot_layouts.core.importing import optional
from robot_layouts.core.writing import written_whole
from robot_layouts.simulation.cameras import AnyCamera, Camera, camera_name, lens_of
from robot_layouts.simulation.rendering import FIELD_OF_VIEW
from robots import TaskError, UnknownNameError
from tasks.engine.cameras import cameras_of, configured, resized
from tasks.engine.env import TaskEnv

SUPPORTED = (".png", ".jpg", ".webp")
ACROSS = 4  # pictures
_HEIGHT = 256  # pixels of each
_GAP = 4  # pixels between two
_MOST = 400  # draws in one picture
_PAPER = 255  # white

Picture = NDArray[np.uint8]


def draws(
    task: TaskEnv,
    count: int = 12,
    *,
    seed: int = 0,
    camera: str | None = None,
    progress: Callable[[int], None] = lambda done: None,
) -> Picture:
    """Return how the episodes of as many seeds begin, side by side, four to a row.

    Args:
        task: Made with ``render_mode="rgb_array"``, with one environment.
        count: How many.
        seed: Seed of the first; that of each further one is larger by 1.
        camera: Name of the camera that sees them: one of the task's own, or one of a robot's after
            its place, such as ``left.hand_camera``. None takes the first one that varies, or if
            none does, the place from which people see the task.
        progress: Called with the number of those that are drawn.

    Returns:
        Shape (H, W, 3).

    Raises:
        TaskError: If the task draws no pictures or has several environments, or a number makes no
            sense.
        UnknownNameError: If there is no such camera.
    """
    checked_whole("draws", count, 1, _MOST, TaskError)
    if task.num_envs != 1 or not task.scenario.draws:
        raise TaskError(
            "a preview is of a task made with 1 environment and render_mode='rgb_array'"
        )
    seen_by = _camera(task, camera)
    pictures: list[Picture] = []
    for i in range(count):
        task.reset(seed + i)
        (view,) = task.simulation.look(0, {"preview": seen_by}, ("rgb",), markers=True)
        pictures.append(view.images["rgb"].astype(np.uint8))
        progress(i + 1)
    return _grid(pictures)


def save(picture: Picture, path: str | os.PathLike[str]) -> Path:
    """Save a picture, whole or not at all.

    Args:
        picture: Shape (H, W, 3).
        path: Where to; the ending chooses the format (.png, .jpg or .webp).

    Raises:
        TaskError: If the format is none of these.
        MissingPackageError: If Pillow is not installed.
        UnwritableFileError: If it cannot be written.
    """
    target = expect_format(path)
    from PIL import Image

    with written_whole(target) as unfinished:
        Image.fromarray(picture).save(unfinished, target.suffix[1:].lower().replace("jpg", "jpeg"))
    return target


def expect_format(path: str | os.PathLike[str]) -> Path:
    """Refuse a path that `save` cannot write a picture to, before anything is drawn; see there."""
    target = Path(path)
    if target.suffix.lower() not in SUPPORTED:
        raise TaskError(f"{target} must end in one of {', '.join(SUPPORTED)}")
    optional("PIL", "a preview needs Pillow", "preview")
    return target


def _camera(task: TaskEnv, name: str | None) -> AnyCamera:
    """Return the camera that a name means; see `draws`."""
    cameras = cameras_of(task.layout, task.scenario.cameras or task.cameras)
    cameras = configured(cameras, task.scenario.sensor_configs or {}, "sensor_configs")
    known = {camera_name(camera): camera for camera in cameras.values()}
    if name is not None and name not in known:
        raise UnknownNameError(f"camera of {task.task_class.__name__}", name, known)
    varied = (task.drawn() or {}).get("cameras", ())
    chosen = next((n for n in known if n in varied), None) if name is None else name
    if chosen is None:
        return Camera(*task.task.viewpoint, "preview", _HEIGHT, _HEIGHT, FIELD_OF_VIEW)
    return _enlarged(known[chosen])


def _enlarged(camera: AnyCamera) -> AnyCamera:
    """Return a camera with pictures as high as those of a preview, and as wide for their height."""
    lens = lens_of(camera)
    return resized(camera, (round(lens.width * _HEIGHT / lens.height), _HEIGHT))


def _grid(pictures: list[Picture]) -> Picture:
    height, width, _ = pictures[0].shape
    rows = -(-len(pictures) // ACROSS)
    across = min(ACROSS, len(pictures))
    size = rows * (height + _GAP) - _GAP, across * (width + _GAP) - _GAP, 3
    grid = np.full(size, _PAPER, np.uint8)
    for i, picture in enumerate(pictures):
        row, column = divmod(i, ACROSS)
        top, left = row * (height + _GAP), column * (width + _GAP)
        grid[top : top + height, left : left + width] = picture
    return grid

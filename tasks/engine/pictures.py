"""What cameras take of a task: the latest of every environment, as points, and for people."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from numpy.typing import NDArray

from robot_layouts.simulation import Simulation
from robot_layouts.simulation.cameras import AnyCamera

if TYPE_CHECKING:
    from robot_layouts.simulation.rendering import Observers, View

Pictures = NDArray[np.uint8]  # (N, H, W, 3)

POINTS = ("rgb", "position", "segmentation")
"""What points are made of."""

_MATRICES = ("extrinsic_cv", "cam2world_gl", "intrinsic_cv")


class CameraRig:
    """The latest images of every environment; only those that changed are drawn again.

    Attributes:
        stale: The environments that changed since they were drawn.
    """

    def __init__(
        self,
        simulation: Simulation,
        cameras: Mapping[str, AnyCamera],
        textures: Sequence[str],
    ) -> None:
        """Remember what to look with; nothing is drawn yet."""
        from robot_layouts.simulation.rendering import (
            Observers,  # loaded with the first picture
        )

        self._observers: Observers = Observers(simulation, cameras, textures)
        self._rows: list[dict[str, View]] = [{}] * simulation.num_envs
        self.stale = set(range(simulation.num_envs))

    def look(self) -> dict[str, Any]:
        """Return matrices and images by camera, of all environments."""
        begun = {env: self._observers.begin(env) for env in sorted(self.stale)}
        for env, finish in begun.items():
            self._rows[env] = finish()
        self.stale.clear()
        names = list(self._rows[0])
        return {
            "sensor_param": {
                name: {m: _stacked(getattr(row[name], m) for row in self._rows) for m in _MATRICES}
                for name in names
            },
            "sensor_data": {
                name: {
                    texture: _stacked(row[name].images[texture] for row in self._rows)
                    for texture in self._rows[0][name].images
                }
                for name in names
            },
        }


def _stacked(rows: Iterable[NDArray[Any]]) -> NDArray[Any]:
    return np.stack(list(rows))


def as_points(look: Mapping[str, Any]) -> dict[str, Any]:
    """Return what cameras see as points in the world frame, in native's form.

    Args:
        look: What `CameraRig.look` returned of `POINTS`.

    Returns:
        ``sensor_param`` as it was, an empty ``sensor_data``, and ``pointcloud``, with a row for
        each pixel of all cameras, one camera after the other: ``xyzw`` (N, P, 4) float32 (m; the
        last is 0 where nothing is seen, so that the row is not moved by where the camera is),
        ``rgb`` (N, P, 3) uint8, ``segmentation`` (N, P, 1) int16.
    """
    images = look["sensor_data"]
    cameras = [(look["sensor_param"][name]["cam2world_gl"], images[name]) for name in images]
    points = [_points(own["position"], own["segmentation"], pose) for pose, own in cameras]
    flat = {
        texture: [own[texture].reshape(len(own[texture]), -1, k) for _, own in cameras]
        for texture, k in (("rgb", 3), ("segmentation", 1))
    }
    cloud = {"xyzw": points, **flat}
    joined = {name: np.concatenate(rows, 1) for name, rows in cloud.items()}
    return {"sensor_param": look["sensor_param"], "sensor_data": {}, "pointcloud": joined}


def _points(
    position: NDArray[Any], segmentation: NDArray[Any], cam2world: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Return pixels in the world frame; by torch, and world by world, as native has them."""
    metres = np.float32(position) / np.float32(1000)
    homogeneous = np.concatenate([metres, np.float32(segmentation != 0)], -1)
    worlds = zip(homogeneous, cam2world, strict=True)
    return _stacked(
        (torch.from_numpy(x).reshape(1, -1, 4) @ torch.from_numpy(pose)[None].mT)[0].numpy()
        for x, pose in worlds
    )


# -- for people ------------------------------------------------------------------------------


SHOWN = ("rgb", "depth", "position", "segmentation")
"""What `as_picture` shows."""


def as_picture(texture: str, images: NDArray[Any]) -> Pictures:
    """Return images in colours, as native shows them: what is near is dark.

    Args:
        texture: What they tell of each pixel, one of `SHOWN`.
        images: (N, H, W, k).
    """
    match texture:
        case "rgb":
            return images
        case "segmentation":
            return (images.astype(np.int64) * _LABELS).astype(np.uint8)
        case _:
            depth = images if texture == "depth" else -images[..., 2:]
            with np.errstate(divide="ignore", invalid="ignore"):
                share = np.float32(depth) / np.float32(depth.max((1, 2, 3), keepdims=True))
            grey = (np.nan_to_num(share).clip(0, 1) * np.float32(255)).astype(np.uint8)
            return grey.repeat(3, -1)


_LABELS = np.array([11, 61, 127])  # of red, green and blue, per number: mani_skill 3.0.1


def tiled(pictures: Sequence[Pictures]) -> Pictures:
    """Return pictures side by side, higher ones first, and below each other where there is room.

    Args:
        pictures: At least one, (N, H, W, 3) each; heights and widths may differ.
    """
    first, *others = sorted(pictures, key=lambda picture: -picture.shape[1])
    columns = [[first]]
    for picture in others:
        height = sum(above.shape[1] for above in columns[-1]) + picture.shape[1]
        if height <= first.shape[1] and picture.shape[2] == columns[-1][0].shape[2]:
            columns[-1].append(picture)
        else:
            columns.append([picture])
    whole = [np.concatenate(column, 1) for column in columns]
    lacking = [(0, first.shape[1] - column.shape[1]) for column in whole]
    padded = [
        np.pad(column, ((0, 0), rows, (0, 0), (0, 0)))
        for column, rows in zip(whole, lacking, strict=True)
    ]
    return np.concatenate(padded, 2)

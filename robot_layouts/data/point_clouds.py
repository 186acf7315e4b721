"""Points as networks take them: of all cameras, in one frame, from a box, so many each time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from robot_layouts.core.bounds import checked_whole, shown
from robot_layouts.kinematics.rotations import Floats, rotation_of
from robots import TaskError

Box: TypeAlias = Sequence[Sequence[float]]
"""The lowest and the highest corner, each x, y, z (m)."""

Cloud: TypeAlias = dict[str, NDArray[Any]]

_COLOURS = "rgb", "segmentation"  # what points have besides a place, where it is observed


def point_cloud(
    observation: Any,
    points: int,
    *,
    box: Box | None = None,
    frame: ArrayLike | None = None,
    seed: int = 0,
) -> Cloud:
    """Return a fixed number of points of what the cameras of an observation see.

    The points of all cameras are put into one frame, those outside of the box are left out, and
    the seed draws from the others: each at most once, or all of them as often as is needed. Each
    row follows from this row of the observation and the seed alone, with the same bits each time.

    Args:
        observation: Of an environment, or of an episode as `Recording.observations` returns it, in
            the mode ``pointcloud``, or in one with ``position`` or ``depth``. Arrays or tensors,
            (…, H, W, k) or (…, P, k).
        points: How many points K.
        box: Which part of the frame is kept; None: all of it.
        frame: Pose of the frame in the world, (7,) or (…, 7): position (m), quaternion wxyz, such
            as that of a robot's base; None: the world.
        seed: What draws the points.

    Returns:
        ``xyz`` (…, K, 3) float32 (m); ``rgb`` (…, K, 3) uint8 and ``segmentation`` (…, K, 1) int16
        if they are observed; ``count`` (…) int64: how many points there were to draw from. Where
        there were none, all numbers are 0.

    Raises:
        TaskError: If no points are observed, or an argument is invalid.
    """
    checked_whole("points", points, 1, None, TaskError)
    checked_whole("seed", seed, 0, None, TaskError)
    corners = None if box is None else _checked_box(box)
    clouds = world_points(observation)
    lead = clouds["xyz"].shape[:-2]
    poses = None if frame is None else np.broadcast_to(_checked_frame(frame, lead), (*lead, 7))
    rows = [
        _drawn(
            {name: values[row] for name, values in clouds.items()},
            points,
            corners,
            None if poses is None else poses[row],
            seed,
        )
        for row in np.ndindex(lead)
    ]
    return {
        name: np.stack([row[name] for row in rows]).reshape((*lead, *rows[0][name].shape))
        for name in rows[0]
    }


def world_points(observation: Any) -> Cloud:
    """Return all points that cameras see, in the world frame, one camera after the other.

    Args:
        observation: See `point_cloud`.

    Returns:
        ``xyz`` (…, P, 3) (m), ``seen`` (…, P) bool: False where a pixel shows nothing; and ``rgb``
        (…, P, 3), ``segmentation`` (…, P, 1) if they are observed.

    Raises:
        TaskError: If no points are observed.
    """
    if not isinstance(observation, Mapping):
        raise TaskError("this observation is one flat array, and no points are in it; see obs_mode")
    if "pointcloud" in observation:
        found = {name: np.asarray(values) for name, values in observation["pointcloud"].items()}
        xyzw = found.pop("xyzw")
        return {"xyz": xyzw[..., :3], "seen": xyzw[..., 3] != 0, **found}
    cameras = observation.get("sensor_data") or {}
    parameters = observation.get("sensor_param") or {}
    clouds = [
        _of_camera(images, parameters[name])
        for name, images in cameras.items()
        if "position" in images or "depth" in images
    ]
    if not clouds or len(clouds) < len(cameras):
        raise TaskError(
            "not all cameras of this observation see points; observe in obs_mode 'pointcloud', or"
            f" with 'position' or 'depth', such as 'rgb+depth'. It has {', '.join(observation)}"
        )
    return {
        name: np.concatenate([cloud[name] for cloud in clouds], -2 if name != "seen" else -1)
        for name in clouds[0]
    }


def _of_camera(images: Mapping[str, Any], parameters: Mapping[str, Any]) -> Cloud:
    """Return what one camera sees, in the world frame."""
    own = {name: np.asarray(image) for name, image in images.items()}
    if "position" in own:
        metres = own["position"].astype(float) / 1000  # from mm
        seen = metres[..., 2] < 0  # the camera looks along -z
        pose = np.asarray(parameters["cam2world_gl"], float)
    else:
        depth = own["depth"][..., 0].astype(float) / 1000
        metres, seen = _from_depth(depth, np.asarray(parameters["intrinsic_cv"], float)), depth > 0
        pose = _inverse(np.asarray(parameters["extrinsic_cv"], float))
    if "segmentation" in own:
        seen = own["segmentation"][..., 0] != 0
    lead = seen.shape[:-2]
    cloud = {
        "xyz": _moved(metres.reshape(*lead, -1, 3), pose[..., :3, :3], pose[..., :3, 3]),
        "seen": seen.reshape(*lead, -1),
    }
    return cloud | {n: own[n].reshape(*lead, -1, own[n].shape[-1]) for n in _COLOURS if n in own}


def _from_depth(depth: Floats, intrinsic: Floats) -> Floats:
    """Return pixels in the frame of a camera that looks along z, y down, (…, H, W, 3)."""
    height, width = depth.shape[-2:]
    matrix = intrinsic[..., None, None, :, :]
    x = (np.arange(width) + 0.5 - matrix[..., 0, 2]) / matrix[..., 0, 0] * depth
    y = (np.arange(height)[:, None] + 0.5 - matrix[..., 1, 2]) / matrix[..., 1, 1] * depth
    return np.stack([x, y, depth], -1)


def _inverse(extrinsic: Floats) -> Floats:
    """Return the inverses of rigid motions, (…, 3, 4)."""
    turned = np.swapaxes(extrinsic[..., :3], -1, -2)
    moved = -(turned * extrinsic[..., None, :, 3]).sum(-1)
    return np.concatenate([turned, moved[..., None]], -1)


def _moved(points: Floats, rotation: Floats, position: Floats) -> Floats:
    """Return points after a turn and a shift; number by number, so that rows do not matter."""
    x, y, z = (points[..., i, None] for i in range(3))
    turn = rotation[..., None, :, :]
    return x * turn[..., 0] + y * turn[..., 1] + z * turn[..., 2] + position[..., None, :]


def _drawn(
    cloud: Cloud, points: int, corners: Floats | None, pose: Floats | None, seed: int
) -> Cloud:
    """Return points of one row."""
    xyz, seen = cloud.pop("xyz"), cloud.pop("seen")
    if pose is not None:
        turn = rotation_of(pose[3:])
        xyz = _moved(xyz.astype(float) - pose[:3], turn.T, np.zeros(3))
    if corners is not None:
        seen = seen & ((xyz >= corners[0]) & (xyz <= corners[1])).all(-1)
    found = np.flatnonzero(seen)
    # By sorting plain numbers, which is what least changes from one version of NumPy to another.
    order = np.argsort(np.random.default_rng(seed).random(len(found)), kind="stable")
    chosen = np.resize(found[order], points) if len(found) else np.zeros(points, int)
    kept = {"xyz": xyz.astype(np.float32), **cloud}
    drawn = {name: values[chosen] * bool(len(found)) for name, values in kept.items()}
    return drawn | {"count": np.array(len(found))}


def _checked_box(box: Box) -> Floats:
    corners = np.asarray(box, float)
    if corners.shape != (2, 3) or not (corners[0] < corners[1]).all():
        raise TaskError(
            f"box is {shown(box)}; it must be its lowest and its highest corner, each x, y, z (m),"
            " such as ((0, -0.5, 0), (1, 0.5, 1))"
        )
    return corners


def _checked_frame(frame: ArrayLike, lead: tuple[int, ...]) -> Floats:
    poses = np.asarray(frame, float)
    fits = poses.shape in ((7,), (*lead, 7))
    if not fits or not np.allclose(np.linalg.norm(poses[..., 3:], axis=-1), 1, atol=1e-3):
        raise TaskError(
            f"frame has shape {poses.shape}; it must be a pose, (7,), or one for each row,"
            f" {(*lead, 7)}: position (m) and a quaternion wxyz of length 1"
        )
    return poses

"""What worlds on a device look like: the state that tasks judge, of torch's tensors there."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from torch import Tensor

from layouts import Layout
from robot_layouts.simulation.backend import Built, Readout
from robot_layouts.simulation.grasps import thresholds
from robot_layouts.simulation.maths import like
from robot_layouts.simulation.readout import MeanFrame, Moment, Places, ReadoutIndex
from robot_layouts.simulation.state import State, remembered, within
from robots import Fingers


class DeviceIndex(ReadoutIndex):
    """Where everything stands in a device's tensors: what would be lists are tensors there.

    A list of places is copied to a device whenever it is used, and the program waits for that.

    Attributes:
        means: What `mean_frames` is otherwise, which is empty.
        native: For each robot `loaded_order`, as a tensor.
    """

    def __init__(self, layout: Layout, built: Built, device: torch.device) -> None:
        """Index worlds that were built alike."""
        super().__init__(layout, built)
        self.means: list[MeanFrame] = self.mean_frames
        self.mean_frames = []
        self._device = device
        self._ways: dict[int, tuple[Tensor, Tensor, Tensor]] = {}

        def placed(places: Any) -> Any:
            return torch.tensor(places, device=device) if isinstance(places, list) else places

        for own in (self.joints, self.arm_joints):
            own.update({name: placed(places) for name, places in own.items()})
        for name, gripper in self.grippers.items():
            if gripper is not None:
                places, widest = gripper
                self.grippers[name] = placed(places), widest
        self.native: Places[Tensor | None] = Places("robot of this layout")
        self.native.update({name: placed(order) for name, order in self.loaded_order.items()})

    def ways(self) -> tuple[Tensor, Tensor, Tensor]:
        """Return last and first frame of every pair, (K,) each, and 0 where the way is flat.

        The last is (K, 1), and 1 for pairs whose distance is not seen from above.
        """
        count = self.pairs.frames.shape[1]
        if count not in self._ways:
            ends, starts = torch.from_numpy(self.pairs.frames.copy()).to(self._device)
            upward = torch.ones(count, 1)
            upward[self.pairs.planar] = 0.0
            self._ways[count] = ends, starts, upward.to(self._device)
        return self._ways[count]


class DeviceState(State):
    """A read-out of N worlds on a device; its numbers are float32 tensors there.

    Nothing of it waits for the device.
    """

    __slots__ = ()
    _index: DeviceIndex

    def __init__(self, readout: Readout, index: DeviceIndex, moment: Moment) -> None:
        """Take what was read; see `State`."""
        super().__init__(readout, index, moment)
        if index.means:
            between = [_between(self.all_poses, mean) for mean in index.means]
            self.all_poses = torch.cat((self.all_poses, torch.stack(between)))

    @remembered
    def rotation(self, body: str) -> Any:
        """Rotation matrix of a body, shape (N, 3, 3); its columns are the body's axes."""
        turns: Any = self.quaternion(body)
        return rotation_matrix(turns)

    def native_joints(self, robot: str) -> list[Any]:
        """Joint positions and velocities of a robot in native's order, which is SAPIEN's."""
        rows: list[Any] = [self.qpos(robot), self.qvel(robot)]
        order = self._index.native[robot]
        return rows if order is None else [row[:, order] for row in rows]

    @remembered
    def is_grasping(self, robot: str, body: str, max_angle: float | None = None) -> Any:
        """Whether a robot's two fingers hold a body, shape (N,) bool; see `State`."""
        fingers = self._index.fingers[robot]
        if fingers is None:
            super().is_grasping(robot, body)  # warns
            return self.full(False)
        return self.is_held(
            robot, body, fingers if max_angle is None else within(fingers, max_angle)
        )

    @remembered
    def is_held(self, robot: str, body: str, fingers: Fingers) -> Any:
        """Whether two links of a robot hold a body, shape (N,) bool; see `State`."""
        forces = [self.contact_force(robot, link, body) for link in fingers.links]
        turns = [self.link_pose(robot, link)[:, 3:] for link in fingers.links]
        return grasped(fingers, forces, turns)

    def _all_offsets(self, place: int) -> Any:
        """Offsets of all pairs that were ever asked for, (K, N, 3), at least up to ``place``."""
        if place >= len(self._offsets):
            ends, starts, upward = self._index.ways()
            poses: Any = self.all_poses
            ways = poses[ends, :, :3] - poses[starts, :, :3]
            ways[:, :, 2] *= upward
            self._offsets = ways
        return self._offsets


def rotation_matrix(quaternion: Tensor) -> Tensor:
    """Return the rotation matrices of quaternions, wxyz, (N, 4), of any length; (N, 3, 3)."""
    w, x, y, z = quaternion.unbind(-1)
    scale = 2.0 / (quaternion * quaternion).sum(-1)
    rows = (
        (1.0 - scale * (y * y + z * z), scale * (x * y - z * w), scale * (x * z + y * w)),
        (scale * (x * y + z * w), 1.0 - scale * (x * x + z * z), scale * (y * z - x * w)),
        (scale * (x * z - y * w), scale * (y * z + x * w), 1.0 - scale * (x * x + y * y)),
    )
    return torch.stack([torch.stack(row, -1) for row in rows], -2)


def grasped(fingers: Fingers, forces: Any, turns: Any) -> Tensor:
    """Tell whether two fingers hold a body, as `robot_layouts.simulation.grasps.grasped` does.

    Args:
        fingers: Which way they open, and the thresholds.
        forces: Force of the body on each finger, (N, 3) (N, world frame).
        turns: Orientation of each finger link, wxyz, (N, 4).
    """
    held: Any = True
    for limits, force, turn in zip(thresholds(fingers), forces, turns, strict=True):
        strength = torch.linalg.vector_norm(force, dim=1)
        opening = rotation_matrix(turn) @ like(force, limits.opening)
        straight = (opening * force).sum(1) >= limits.cosine * strength
        held = held & straight & (strength >= limits.force)
    return held


def _between(poses: Any, mean: MeanFrame) -> Tensor:
    """Return the poses of a frame that lies between or beside others, (N, 7)."""
    orientation, points, offset = mean
    turn: Any = poses[orientation, :, 3:]
    place: Any = sum(poses[point, :, :3] for point in points) / len(points)
    if any(offset):
        place = place + rotation_matrix(turn) @ like(turn, offset)
    return torch.cat((place, turn), 1)


def move_arrays(holder: object, device: torch.device) -> None:
    """Let the NumPy arrays that an object holds be tensors of a device."""
    vars(holder).update(
        {
            name: torch.from_numpy(np.ascontiguousarray(array)).to(device)
            for name, array in vars(holder).items()
            if isinstance(array, np.ndarray)
        }
    )


def beside(flags: Tensor, rows: Tensor) -> Tensor:
    """Return flags, (N,), in as many axes as rows have, (N, …)."""
    return flags.view(-1, *[1] * (rows.ndim - 1))

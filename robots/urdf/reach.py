"""Where the links of a URDF are, and how far from its base axis a link can get."""

from __future__ import annotations

import math
import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from robots.urdf.model import ModelJoint, UrdfModel
from robots.urdf.numbers import Vector3

Matrix = tuple[Vector3, Vector3, Vector3]

IDENTITY: Matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))

_STARTS = 8  # of the search for the largest distance; one is the joints' middle
_SWEEPS = 30  # over all joints
_ANGLES = 90  # tried per joint and sweep
_SMALLEST_GAIN = 1e-5  # m per sweep


@dataclass(frozen=True)
class Frame:
    """A rotation matrix, by rows, and a position (m)."""

    rotation: Matrix = IDENTITY
    position: Vector3 = (0.0, 0.0, 0.0)

    def __matmul__(self, other: Frame) -> Frame:
        """Return a frame that is given in this one."""
        columns = tuple(zip(*other.rotation, strict=True))
        rows = [tuple(_dot(row, column) for column in columns) for row in self.rotation]
        return Frame((rows[0], rows[1], rows[2]), self.place(other.position))  # type: ignore[arg-type]

    def place(self, point: Vector3) -> Vector3:
        """Return where a point of this frame is (m)."""
        x, y, z = (_dot(row, point) for row in self.rotation)
        a, b, c = self.position
        return (x + a, y + b, z + c)

    def of(self, point: Vector3) -> Vector3:
        """Return where a point of the surrounding frame is in this one (m)."""
        away = [there - here for there, here in zip(point, self.position, strict=True)]
        x, y, z = (_dot(column, away) for column in zip(*self.rotation, strict=True))
        return (x, y, z)


def link_frame(model: UrdfModel, link: str, qpos: Mapping[str, float]) -> Frame:
    """Return the frame of a link in that of the root link.

    Args:
        model: The robot.
        link: Link name.
        qpos: Joint positions by name (rad, m); joints not named are at 0.
    """
    frame = Frame()
    for joint in model.path_to(link):
        frame = frame @ _origin(joint) @ _motion(joint, qpos.get(joint.name, 0.0))
    return frame


def reach(
    model: UrdfModel, link: str, joints: Sequence[str], qpos: Mapping[str, float], point: Vector3
) -> float:
    """Return the largest distance found of a point from the root link's z axis (m).

    Args:
        model: The robot.
        link: Link that the point belongs to.
        joints: Joints that may move within their limits.
        qpos: Where the others stay (rad, m); 0 if not named.
        point: In the link's frame (m).
    """
    search = _Search(model, link, joints, qpos, point)
    generator = random.Random(0)  # the same answer every time
    starts = [[sum(joint.span) / 2 for joint in search.joints]]
    while len(starts) < _STARTS:
        starts.append([generator.uniform(*joint.span) for joint in search.joints])
    return max(search.climb(start) for start in starts)


class _Search:
    """Moves one joint after the other, from the tip to the base, to where the point is farthest."""

    def __init__(
        self,
        model: UrdfModel,
        link: str,
        joints: Sequence[str],
        qpos: Mapping[str, float],
        point: Vector3,
    ) -> None:
        """Fold the path into one fixed frame before each joint, and the point behind the last."""
        self.joints: list[ModelJoint] = []
        self._before: list[Frame] = []
        frame = Frame()
        for joint in model.path_to(link):
            frame = frame @ _origin(joint)
            if joint.name in joints:
                self.joints.append(joint)
                self._before.append(frame)
                frame = Frame()
            else:
                frame = frame @ _motion(joint, qpos.get(joint.name, 0.0))
        self._point = frame.place(point)

    def climb(self, qpos: list[float]) -> float:
        """Return the distance that is reached from a start (m)."""
        best = 0.0
        for _ in range(_SWEEPS):
            distance = self._sweep(qpos)
            if distance < best + _SMALLEST_GAIN:
                return max(best, distance)
            best = distance
        return best

    def _sweep(self, qpos: list[float]) -> float:
        frames = [Frame()]  # of each joint's own place, the joints before it moved
        for before, joint, position in zip(self._before, self.joints, qpos, strict=True):
            frames[-1] = frames[-1] @ before
            frames.append(frames[-1] @ _motion(joint, position))
        point = self._point
        for i in reversed(range(len(self.joints))):
            joint = self.joints[i]
            qpos[i] = _farthest(joint, frames[i], point, qpos[i])
            point = _motion(joint, qpos[i]).place(point)
            point = self._before[i].place(point)
        return math.hypot(point[0], point[1])


def _farthest(joint: ModelJoint, frame: Frame, point: Vector3, now: float) -> float:
    """Return the joint's position at which the point is farthest from the z axis."""
    low, high = joint.span
    tried = [now, *(low + (high - low) * i / _ANGLES for i in range(_ANGLES + 1))]

    def distance(position: float) -> float:
        x, y, _ = frame.place(_motion(joint, position).place(point))
        return math.hypot(x, y)

    return max(tried, key=distance)


def _origin(joint: ModelJoint) -> Frame:
    (a, b, c), (d, e, f) = (map(fn, joint.rpy) for fn in (math.cos, math.sin))
    rotation = (
        (c * b, c * e * d - f * a, c * e * a + f * d),
        (f * b, f * e * d + c * a, f * e * a - c * d),
        (-e, b * d, b * a),
    )
    return Frame(rotation, joint.xyz)


def _motion(joint: ModelJoint, position: float) -> Frame:
    x, y, z = joint.axis
    if joint.type == "fixed":
        return Frame()
    if joint.type == "prismatic":
        return Frame(position=(x * position, y * position, z * position))
    c, s = math.cos(position), math.sin(position)
    k = 1 - c
    rotation = (
        (c + x * x * k, x * y * k - z * s, x * z * k + y * s),
        (y * x * k + z * s, c + y * y * k, y * z * k - x * s),
        (z * x * k - y * s, z * y * k + x * s, c + z * z * k),
    )
    return Frame(rotation)


def _dot(a: Sequence[float], b: Sequence[float]) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]

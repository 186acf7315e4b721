"""How a flat body slides on a table when the round tip of a stick pushes its side.

Slow pushing with a tip that does not slip: the body turns and moves so that the point of contact
keeps up with the tip, and resists like an ellipsoid in force and torque.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from robot_layouts.kinematics.rotations import Floats

SUBSTEPS = 6  # of each stroke


@dataclass(frozen=True)
class Slide:
    """Where N bodies and the tips that push them are, some way along.

    Attributes:
        poses: x, y (m, world) and yaw (rad) of each body, (N, 3).
        contacts: Point (m) and outward normal of each contact, in the body's frame, (N, 4).
        squareness: Cosine of the angle between each tip's force and the side's normal, (N,).
    """

    poses: Floats
    contacts: Floats
    squareness: Floats


@dataclass(frozen=True)
class SlidingBody:
    """A flat body.

    Attributes:
        centre: Where a push does not turn it, in its frame (m).
        torque_arm: Its greatest friction torque over its greatest friction force (m).
        tip_radius: Radius of the stick's tip (m).
    """

    centre: tuple[float, float]
    torque_arm: float
    tip_radius: float

    def push(
        self, poses: Floats, contacts: Floats, directions: Floats, lengths: Floats
    ) -> Iterator[Slide]:
        """Push N bodies, each by one contact, in S strokes one after the other.

        Args:
            poses: x, y (m, world) and yaw (rad) of each body, (N, 3).
            contacts: Point (m) and outward normal of each contact, in the body's frame, (N, 4).
            directions: Of the tip from the inward normal, kept in the body's frame, (N, S) (rad).
            lengths: Way of the tip in each stroke, (N, S) (m).

        Yields:
            Where they are after each `SUBSTEPS`-th part of each stroke.
        """
        x, y, yaw = poses.T
        px, py = contacts[:, 0] - self.centre[0], contacts[:, 1] - self.centre[1]
        nx, ny = contacts[:, 2:].T
        arm2 = self.torque_arm**2
        for direction, length in zip(directions.T, lengths.T, strict=True):
            cosine, sine = np.cos(direction), np.sin(direction)
            ux, uy = sine * ny - cosine * nx, -sine * nx - cosine * ny
            part = length / SUBSTEPS
            for _ in range(SUBSTEPS):
                share = 1 / (arm2 + px * px + py * py)
                vx = ((arm2 + px * px) * ux + px * py * uy) * share
                vy = (px * py * ux + (arm2 + py * py) * uy) * share
                spin = (px * uy - py * ux) * share
                squareness = -(vx * nx + vy * ny) / np.hypot(vx, vy)
                ox, oy = vx + spin * self.centre[1], vy - spin * self.centre[0]
                cosine, sine = np.cos(yaw + spin * part / 2), np.sin(yaw + spin * part / 2)
                x = x + (cosine * ox - sine * oy) * part
                y = y + (sine * ox + cosine * oy) * part
                yaw = yaw + spin * part
                rolled = self.tip_radius * spin * part  # the tip does not turn with the body
                px, py = px + ny * rolled, py - nx * rolled
                moved = np.stack([x, y, yaw], 1)
                points = np.stack([px + self.centre[0], py + self.centre[1], nx, ny], 1)
                yield Slide(moved, points, squareness)

    def tips(self, poses: Floats, contacts: Floats, away: float = 0.0) -> Floats:
        """Return the middles of tips ``away`` (m) from N contacts, (N, 2) (m, world)."""
        distance = self.tip_radius + away
        return to_world(poses, contacts[:, :2] + distance * contacts[:, 2:])


def to_world(poses: Floats, points: Floats) -> Floats:
    """Return points (N, 2) in the frames of bodies at ``poses`` (N, 3) in the world (m)."""
    cosine, sine = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    px, py = points.T
    return poses[:, :2] + np.stack([cosine * px - sine * py, sine * px + cosine * py], 1)


def to_body(pose: Floats, points: Floats) -> Floats:
    """Return points (K, 2) (m, world) in the frame of a body at ``pose`` (3,)."""
    cosine, sine = np.cos(pose[2]), np.sin(pose[2])
    return (points - pose[:2]) @ np.array([[cosine, -sine], [sine, cosine]])

"""What pictures of a motion show: bodies, ways of TCPs, distances and speeds; and its page."""

from __future__ import annotations

import numpy as np

from layouts.viewer import ShownCell, ShownMotion, Thing
from layouts.visuals import Visual, coloured
from robot_layouts.kinematics.rotations import Floats, quaternion_of, transform
from robot_layouts.motion.certificate import largest_velocities
from robot_layouts.motion.collision.cell import Cell
from robot_layouts.motion.model.bodies import CellSolid
from robot_layouts.motion.model.obstacles import Held, Obstacle, Track
from robot_layouts.motion.timed_motion import TimedMotion
from robots.urdf.tcp import find_tcp


class Scenes:
    """A motion with all bodies of its cell."""

    def __init__(self, motion: TimedMotion) -> None:
        """Read the robots' files.

        Raises:
            AssetError: If they cannot be found or are invalid.
            MissingPackageError: If trimesh or python-fcl is not installed.
        """
        self.motion = motion
        self.cell = Cell(motion.layout, motion.obstacles, motion.held, motion.table)

    def states(self, times: Floats) -> Floats:
        """Return the joints of all robots at some times, (n, D) (rad, m)."""
        sampled = self.motion.sample(times)
        return np.concatenate([sampled[name] for name in self.cell.robots], axis=1)

    def standing(self) -> list[CellSolid]:
        """Return tables, and obstacles that do not move."""
        return [solid for solid in self.cell.solids if _stands(self.cell, solid)]

    def moving(self, time: float) -> list[tuple[CellSolid, Floats]]:
        """Return all other bodies at a time, with their corners, (n, 3) (m, world)."""
        cell, moments = self.cell, np.array([time])
        links = cell.poses(self.states(moments))[0]
        at = {link: links[i] for i, link in enumerate(cell.links)}
        found: list[tuple[CellSolid, Floats]] = []
        for solid in cell.solids:
            part, pose = cell.parts[solid.part], np.eye(4)
            if part.track is not None:
                pose = part.track.at(moments)[0]
            elif part.robot:
                pose = at[part.robot, cell.models[part.robot].kinematics.links[part.link]]
            if not _stands(cell, solid):
                found.append((solid, transform(pose @ solid.offset, solid.hull.corners)))
        return found

    def held_poses(self, held: Held, times: Floats) -> Floats:
        """Return where a body that an arm carries is at some times, (n, 4, 4) (m, world)."""
        robot, link = self.cell.tcp(held.place)
        at = self.cell.links.index((robot, self.cell.models[robot].kinematics.links[link]))
        return self.cell.poses(self.states(times))[:, at] @ held.obstacle.poses(None, len(times))

    def tcp_ways(self, times: Floats) -> dict[str, Floats]:
        """Return where the TCP of each arm is at some times, (n, 3) (m, world)."""
        poses = self.cell.poses(self.states(times))
        ways: dict[str, Floats] = {}
        for arm, placement in self.motion.layout.arms.items():
            owner = self.motion.layout.owner(arm)
            own = [i for i, (robot, _) in enumerate(self.cell.links) if robot == owner]
            tcp = find_tcp(placement.robot, self.cell.models[owner].kinematics)
            ways[arm] = tcp.places(poses[:, own])
        return ways

    def distances(self, times: Floats) -> tuple[Floats, tuple[str, ...]]:
        """Return how near robots come to each other and to what stands around.

        Returns:
            The least distance of a robot from another or an obstacle, (n,) (m); NaN if all is far.
            And the names of the two bodies that come nearest of all; none if all is far.
        """
        checker = self.cell.between_owners()
        contacts = [
            checker.nearest(state, time)
            for state, time in zip(self.states(times), times.tolist(), strict=True)
        ]
        least = np.array([np.nan if c is None else c.distance for c in contacts])
        contact = None if np.isnan(least).all() else contacts[int(np.nanargmin(least))]
        return least, () if contact is None else contact.names

    def speeds(self, times: Floats) -> dict[str, Floats]:
        """Return by robot the largest share that a joint uses of its largest velocity, (n,)."""
        fastest = largest_velocities(self.motion)
        return {
            name: (np.abs(rows) / fastest[name]).max(axis=1)
            for name, rows in self.motion.velocity(times).items()
        }


def _stands(cell: Cell, solid: CellSolid) -> bool:
    return not solid.mover and cell.parts[solid.part].track is None


HIDDEN = ("frames", "reach")  # they would hide the ways
MOMENTS = 30  # per second
WAY_POINTS = 25  # per second
OBSTACLE = (0.55, 0.55, 0.55, 1.0)
HELD = (0.95, 0.75, 0.2, 1.0)
TABLE = (0.87, 0.81, 0.72, 1.0)


def motion_cell(motion: TimedMotion, title: str) -> ShownCell:
    """Return what a page shows of a motion.

    Raises:
        AssetError: If a robot's files cannot be found or are invalid.
        MissingPackageError: If trimesh or python-fcl is not installed.
    """
    scenes = Scenes(motion)
    times = np.linspace(0, motion.duration, 1 + max(1, round(motion.duration * MOMENTS)))
    things: dict[str, Thing] = {}
    poses: dict[str, Floats] = {}
    for obstacle in motion.obstacles:
        rows = _rows(obstacle.poses(times, len(times)))
        things[obstacle.name] = Thing(_parts(obstacle, OBSTACLE), rows[0])
        if isinstance(obstacle.pose, Track):
            poses[obstacle.name] = rows
    for held in motion.held:
        rows = _rows(scenes.held_poses(held, times))
        things[held.obstacle.name] = Thing(_parts(held.obstacle, HELD), rows[0])
        poses[held.obstacle.name] = rows
    if motion.table is not None:
        things["(table)"] = Thing((_slab(*motion.table),), np.eye(7)[3])
    own = ShownMotion(float(times[1]), motion.sample(times), poses, name="Motion")
    return ShownCell(title, motion.layout, things, own, ways=_ways(scenes), hidden=HIDDEN)


def _ways(scenes: Scenes) -> dict[str, list[Floats]]:
    duration = scenes.motion.duration
    times = np.linspace(0, duration, 2 + round(duration * WAY_POINTS))
    ways: dict[str, list[Floats]] = {}
    for arm, way in scenes.tcp_ways(times).items():
        ways.setdefault(scenes.motion.layout.owner(arm), []).append(way)
    return ways


def _parts(obstacle: Obstacle, rgba: tuple[float, float, float, float]) -> tuple[Visual, ...]:
    import trimesh

    return tuple(coloured(trimesh.convex.convex_hull(shape), rgba) for shape in obstacle.shapes)


def _slab(x_min: float, y_min: float, x_max: float, y_max: float) -> Visual:
    """Return a table's top, just below z = 0."""
    import trimesh

    thickness = 0.02
    slab = trimesh.creation.box((x_max - x_min, y_max - y_min, thickness))
    slab.apply_translation(((x_min + x_max) / 2, (y_min + y_max) / 2, -thickness / 2 - 0.001))
    return coloured(slab, TABLE)


def _rows(poses: Floats) -> Floats:
    """Return poses, (n, 4, 4), as position (m) and quaternion (wxyz), (n, 7)."""
    return np.concatenate([poses[:, :3, 3], quaternion_of(poses[:, :3, :3])], axis=1)

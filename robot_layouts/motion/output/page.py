"""A motion as a page in the browser: robots, obstacles and ways, with a timeline."""

from __future__ import annotations

import numpy as np

from layouts.viewer import ShownCell, ShownMotion, Thing
from layouts.visuals import Visual, coloured
from robot_layouts.kinematics.rotations import Floats, quaternion_of
from robot_layouts.motion.model.obstacles import Obstacle, Track
from robot_layouts.motion.output.scenes import Scenes
from robot_layouts.motion.timed_motion import TimedMotion

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

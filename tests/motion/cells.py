"""Cells of mixed robots, states in them, and what FCL alone says about these."""

from __future__ import annotations

import fcl
import numpy as np

from layouts import Layout, Placement, ring
from robot_layouts.kinematics.rotations import Floats, pose_matrix
from robot_layouts.motion.collision.cell import Cell
from robot_layouts.motion.collision.checker import Checker
from robot_layouts.motion.model.bodies import Bodies
from robot_layouts.motion.model.obstacles import Track, box, cylinder, sphere
from robots import RobotDescriptor
from tests import three_links

AWAY = 50.0  # m


def pandas(count: int = 2, radius: float = 0.5, **more) -> Cell:
    return Cell(ring({f"arm_{i}": "panda" for i in range(count)}, radius=radius), **more)


def crowded() -> Cell:
    """Two Pandas and an SO-100 on a table, boxes that stand and move, one that is held."""
    layout = Layout(
        {
            "left": Placement("panda", (0.0, -0.45, 0.0), rpy=(0.0, 0.0, 1.6)),
            "small": Placement("so100", (0.35, 0.0, 0.0)),
            "right": Placement("panda", (0.0, 0.45, 0.0), rpy=(0.0, 0.0, -1.6)),
        }
    )
    path = [pose_matrix((x, 0.0, 0.3), (1.0, 0.0, 0.0, 0.0)) for x in (-0.6, 0.6)]
    things = [
        box("crate", (0.2, 0.1, 0.3), (-0.3, 0.1, 0.15), (0.8, 0.0, 0.0, 0.6)),
        sphere("ball", 0.08, (0.4, -0.3, 0.4)),
        cylinder("post", 0.03, 0.8, (-0.4, -0.3, 0.4)),
        box("cart", (0.15, 0.15, 0.15)).moved(Track(np.array([1.0, 3.0]), np.array(path))),
    ]
    bare = Cell(layout)
    hand = bare.poses(bare.start[None])[0, bare.links.index(("left", "panda_hand_tcp"))]
    stick = box("stick", (0.02, 0.02, 0.3)).moved(hand)
    held = bare.grasped("left", stick)
    return Cell(layout, things, [held], table=(-0.8, -0.8, 0.8, 0.8))


def guessed(folder) -> Cell:
    """A Panda, and an arm of which there is only a URDF, upside down."""
    path = three_links.save(folder, three_links.arm())
    robot = RobotDescriptor.from_urdf(path, quiet=True)
    return Cell(
        Layout(
            {
                "known": Placement("panda"),
                "guessed": Placement(robot, (0.4, 0.0, 0.5), rpy=(np.pi, 0.0, 0.3)),
            }
        )
    )


def driving() -> Cell:
    """A Fetch beside an xArm7, far away from the origin."""
    layout = Layout(
        {
            "fetch": Placement("fetch", (AWAY, AWAY, 0.0)),
            "arm": Placement("xarm7", (AWAY + 0.8, AWAY, 0.0), rpy=(0.0, 0.0, 3.1)),
        }
    )
    return Cell(layout, [box("wall", (0.1, 2.0, 2.0), (AWAY - 0.6, AWAY, 1.0))])


def dual() -> Cell:
    """A Baxter and a UR5, which meet."""
    return Cell(
        Layout(
            {
                "baxter": Placement("baxter", (0.0, 0.0, 0.93)),
                "arm": Placement("ur5", (0.9, 0.1, 0.5), rpy=(0.0, 0.0, 3.0)),
            }
        )
    )


def states(cell: Cell, count: int, seed: int = 0) -> tuple[Floats, Floats]:
    """Half of them anywhere within the limits, half near the start; and a time for each (s)."""
    random = np.random.default_rng(seed)
    near = cell.start + random.normal(0.0, 0.3, (count // 2, cell.size))
    low, high = np.clip(cell.limits, cell.start[:, None] - 3.0, cell.start[:, None] + 3.0).T
    anywhere = random.uniform(low, high, (count - count // 2, cell.size))
    return np.concatenate([near, anywhere]), random.uniform(0.0, 4.0, count)


def least_distances(checker: Checker, qpos: Floats, times: Floats) -> Floats:
    """Return for each pair in each state how far it is apart, by FCL alone; 0 if it overlaps."""
    cell = checker.cell
    bodies = [fcl.CollisionObject(solid.hull.geometry) for solid in cell.solids]
    found = np.empty((len(qpos), len(checker.pairs)))
    for row, poses in zip(found, solid_poses(cell, qpos, times), strict=True):
        for body, pose in zip(bodies, poses, strict=True):
            body.setTransform(fcl.Transform(pose[:3, :3], pose[:3, 3]))
        for i, (a, b) in enumerate(checker.pairs.tolist()):
            row[i] = fcl.distance(bodies[a], bodies[b])
    return np.maximum(found, 0.0)


def solid_poses(cell: Bodies, qpos: Floats, times: Floats) -> Floats:
    """Return where all solids are, by each robot's own tree, (n, solids, 4, 4)."""
    links = cell.poses(qpos)
    poses = np.empty((len(qpos), len(cell.solids), 4, 4))
    for i, solid in enumerate(cell.solids):
        part = cell.parts[solid.part]
        if part.track is not None:
            at = part.track.at(times)
        elif part.robot:
            link = cell.models[part.robot].kinematics.links[part.link]
            at = links[:, cell.links.index((part.robot, link))]
        else:
            at = np.eye(4)
        poses[:, i] = at @ solid.offset
    return poses

"""Random curves of small arms past bodies that they graze, to test what certificates miss."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from tempfile import mkdtemp

import numpy as np

from layouts import Layout, Placement
from robot_layouts.kinematics.rotations import pose_matrix
from robot_layouts.motion import Motion
from robot_layouts.motion.collision.cell import Cell
from robot_layouts.motion.model.obstacles import Held, Obstacle, Track, box
from robots import RobotDescriptor
from tests import three_links
from tests.layouts.small_robots import joint, link, robot, urdf

MISSED = 2e-5  # m; overlaps that are no deeper are within what FCL's distances are known to
GAP = 0.003  # m; as near as that obstacles come to the robots, or they just touch them

STEPS = (2e-3, 2e-2, 2e-2, 0.2, 0.2, 0.2)  # m; 5 rad/m for turns; few moments are missed the most

Random = np.random.Generator


@lru_cache(maxsize=1)
def _robots() -> tuple[RobotDescriptor, ...]:
    """An arm that turns all the way round, and one whose first joint slides."""
    turning = three_links.arm().replace("3.1", "7")
    sliding = urdf(
        link("base"),
        link("cart", xyz="0 0 0.12"),
        link("upper", xyz="0.15 0 0.25"),
        link("hand", xyz="0.1 0 0"),
        joint("slide", "base", "cart", kind="prismatic", axis="0 1 0"),
        joint("turn", "cart", "upper"),
        joint("lift", "upper", "hand", xyz="0.3 0 0.25", axis="0 1 0"),
    ).replace('"-4" upper="4"', '"-7" upper="7"')
    return (
        robot(Path(mkdtemp()), turning, ("j1", "j2", "j3"), tcp="l3", name="turning"),
        robot(Path(mkdtemp()), sliding, ("slide", "turn", "lift"), tcp="hand", name="sliding"),
    )


def grazing(seed: int) -> Motion:
    """Return a motion of one or two arms that passes a body within millimetres, or touches it."""
    random = np.random.default_rng(seed)
    chosen = [_robots()[i] for i in random.integers(2, size=random.integers(1, 3))]
    layout = Layout(
        {f"arm_{i}": Placement(robot, (0.0, 1.2 * i, 0.0)) for i, robot in enumerate(chosen)}
    )
    bare = _curve(layout, random)
    if random.random() < 0.3:
        bare = replace(bare, held=(Held("arm_0", _stick()),))
    return replace(bare, obstacles=(_in_the_way(bare, random),))


def _curve(layout: Layout, random: Random) -> Motion:
    """Few knots: anywhere; or out and back; or a full turn; the velocities are high."""
    kind, count = random.integers(3), int(random.integers(2, 5))
    times = np.concatenate([[0.0], np.cumsum(random.uniform(0.2, 1.0, count - 1))])
    positions, velocities = {}, {}
    for name, placement in layout.items():
        knots = random.uniform(-1.0, 1.0, (count, placement.robot.dof))
        speeds = random.uniform(-3.0, 3.0, knots.shape)
        if kind == 1:
            knots[:] = knots[0]
        if kind == 2:
            knots, speeds = np.zeros_like(knots), np.zeros_like(knots)
            knots[1::2, -1 if placement.robot.name == "sliding" else 0] = random.choice([-1, 1])
            knots *= 2 * np.pi
        positions[name], velocities[name] = knots, speeds
    unlimited = {name: np.full(p.robot.dof, np.inf) for name, p in layout.items()}
    return Motion(layout, times, positions, velocities, largest_velocities=unlimited)


def _in_the_way(motion: Motion, random: Random) -> Obstacle:
    """Return a box that stands or moves, moved to where it nearly touches an arm, or just does."""
    cell = Cell(motion.layout)
    times = np.linspace(0.0, motion.duration, 40)
    states = np.concatenate(list(motion.sample(times).values()), axis=1)
    links = cell.poses(states)[:, :, :3, 3].reshape(-1, 3)
    middle = links[random.integers(len(links))] + random.normal(0.0, 0.3, 3)
    count = int(random.integers(1, 4))
    poses = [pose_matrix(middle + random.normal(0.0, 0.1, 3), _turn(random)) for _ in range(count)]
    track = Track(np.linspace(0.0, motion.duration, count), np.array(poses))
    body = _bodies()[random.integers(len(_bodies()))].moved(track)
    checker = Cell(motion.layout, [body], motion.held).checker(own=None)
    distances = checker.distance(states, times)
    i = int(distances.argmin())
    near = checker.nearest(states[i], times[i])
    if near is not None and near.distance > 0 and "body" in near.names:
        own, others = np.array(near.points)[
            [near.names.index("body"), 1 - near.names.index("body")]
        ]
        nearer = (others - own) * (1 - random.uniform(-GAP / 4, GAP) / near.distance)
        track = Track(track.times, track.poses + np.pad(nearer[:, None], ((0, 1), (3, 0))))
    return body.moved(track if count > 1 else track.poses[0])


@lru_cache(maxsize=1)
def _stick() -> Obstacle:
    return box("stick", (0.02, 0.02, 0.2), (0.12, 0.0, 0.0))


@lru_cache(maxsize=1)
def _bodies() -> tuple[Obstacle, ...]:
    sizes = ((0.02, 0.02, 0.02), (0.01, 0.1, 0.01), (0.1, 0.1, 0.1), (0.002, 0.2, 0.1))
    return tuple(box("body", size) for size in sizes)


def _turn(random: Random) -> np.ndarray:
    quaternion = random.normal(size=4)
    return quaternion / np.linalg.norm(quaternion)


def missed(seed: int) -> float | None:
    """Return the deepest overlap in ten times as many moments as a certificate looked at (m).

    None if it found one itself, and 0 if there is none.
    """
    motion, random = grazing(seed), np.random.default_rng([seed, 1])
    step, turn = random.choice(STEPS), random.choice(STEPS)
    certificate = motion.certify(step=float(step), turn=5 * float(turn))
    if not certificate.ok:
        return None
    count = 10 * certificate.moments
    checker = Cell(motion.layout, motion.obstacles, motion.held, motion.table).checker()
    times = random.uniform(0.0, motion.duration, count)
    states = np.concatenate(list(motion.sample(times).values()), axis=1)
    hits = np.flatnonzero(~checker.free(states, times)).tolist()
    contacts = [c for i in hits if (c := checker.contact(states[i], times[i])) is not None]
    return max((-contact.distance for contact in contacts), default=0.0)

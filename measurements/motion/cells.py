"""Random valid layouts of mixed arms whose workspaces overlap, and random postures in them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from kinematics.rotations import Floats
from layouts import Layout, face_to_face, grid, ring, side_by_side
from layouts.validation.arguments import Rectangle
from motion.cell import Cell
from motion.goals import arm_joints
from robots import RobotDescriptor, RobotLayoutsError, RobotRegistry

LARGE = (
    "panda",
    "panda_stick",
    "panda_wristcam",
    "panda_pinch",
    "franka_panda",
    "ur3",
    "ur5",
    "ur10",
    "xarm7",
    "jaco2",
    "z1",
    "ur5_gripper",
    "talos_left_arm",
)
SMALL = ("so100", "so101", "koch")
SHARE_OF_SMALL = 0.15  # of the cells; arms of both sizes seldom share space
CLOSENESS = 0.75, 1.05  # of distances that presets choose by themselves
FLOOR: Rectangle = (-6.0, -6.0, 6.0, 6.0)  # m; robots stand on it
TRIES = 400  # postures per robot


def random_cell(seed: int, arms: int, extra: Sequence[RobotDescriptor] = ()) -> Layout:
    """Return a valid layout of some arms, the same for the same seed.

    Args:
        seed: Of everything random.
        arms: How many.
        extra: Robots to draw from, besides those of the catalogue.
    """
    random = np.random.default_rng([seed, arms])
    while True:
        small = random.random() < SHARE_OF_SMALL
        pool = [RobotRegistry.load(name) for name in (SMALL if small else LARGE)]
        pool += [] if small else list(extra)
        robots = {f"arm{i}": pool[int(random.integers(len(pool)))] for i in range(arms)}
        closeness = float(random.uniform(*CLOSENESS))
        try:
            layout = _arranged(robots, int(random.integers(3)), closeness)
            if layout.validate(table=FLOOR, samples=0, workspaces=False).ok:
                return layout
        except RobotLayoutsError:
            continue


def _arranged(robots: dict[str, RobotDescriptor], kind: int, closeness: float) -> Layout:
    if kind == 0:
        across = len(robots) == 2
        layout = face_to_face(robots, spacing="auto") if across else ring(robots)
    elif kind == 1:
        layout = side_by_side(robots, spacing="auto")
    else:
        layout = grid(robots)
    scale = np.array([closeness, closeness, 1.0])
    return Layout(
        {
            name: replace(p, position=tuple((scale * p.base_position).tolist()))
            for name, p in layout.items()
        }
    )


def random_postures(cell: Cell, seed: Sequence[int], clearance: float) -> Iterator[Floats]:
    """Yield postures of all arms in which nothing comes near anything, (D,) (rad, m).

    One arm after the other is drawn until it keeps clear of those before: joints anywhere within
    their limits, but not more than half a turn from where the layout starts them, as arms that
    stand on a floor cannot turn all the way round.

    Args:
        cell: The cell.
        seed: Of everything random.
        clearance: How near robots may come to each other (m).
    """
    random = np.random.default_rng(list(seed))
    limits = np.clip(cell.limits, cell.start[:, None] - np.pi, cell.start[:, None] + np.pi)
    while True:
        state: Floats | None = cell.start.copy()
        for i, name in enumerate(cell.robots):
            if state is not None:
                state = _with_arm(cell, state, i, name, limits, random, clearance)
        if state is not None and cell.checker().free(state[None])[0]:
            yield state


def _with_arm(
    cell: Cell,
    state: Floats,
    number: int,
    name: str,
    limits: Floats,
    random: np.random.Generator,
    clearance: float,
) -> Floats | None:
    robot = cell.layout[name].robot
    columns = [cell.slices[name].start + robot.joints.index(j) for j in arm_joints(robot)]
    later = [(name, other) for other in cell.robots[number + 1 :]]
    checker = cell.checker([name], clearance, except_=later)
    for _ in range(TRIES // 20):
        states = np.tile(state, (20, 1))
        low, high = limits[columns].T
        states[:, columns] = random.uniform(low, high, (20, len(columns)))
        free = checker.free(states)
        if free.any():
            return states[np.argmax(free)]
    return None

"""Random valid layouts of mixed arms whose workspaces overlap, and random postures in them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from kinematics.rotations import Floats
from layouts import Layout, face_to_face, grid, ring, side_by_side
from layouts.validation.arguments import Rectangle
from motion.collision.cell import Cell
from motion.collision.checker import Checker
from motion.planning.goals import arm_joints
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
LARGE_REACH = 0.5  # m; of arms from elsewhere, those with less are small
SHARE_OF_EXTRA = 0.45  # of the arms, where there are some from elsewhere
SHARE_OF_SMALL = 0.15  # of the cells; arms of both sizes seldom share space
CLOSENESS = 0.75, 1.05  # of distances that presets choose by themselves
FLOOR: Rectangle = (-6.0, -6.0, 6.0, 6.0)  # m; robots stand on it
TRIES = 400  # postures per robot
ABOVE_FLOOR = 0.01  # m; the links of shoulders turn at less than 2 cm above what some arms stand on


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
        others = [robot for robot in extra if (robot.reach < LARGE_REACH) == small]
        robots = {f"arm{i}": _drawn(random, pool, others) for i in range(arms)}
        closeness = float(random.uniform(*CLOSENESS))
        try:
            layout = _arranged(robots, int(random.integers(3)), closeness)
            if layout.validate(table=FLOOR, samples=0, workspaces=False).ok:
                return layout
        except RobotLayoutsError:
            continue


def _drawn(
    random: np.random.Generator, pool: Sequence[RobotDescriptor], others: Sequence[RobotDescriptor]
) -> RobotDescriptor:
    chosen = others if others and random.random() < SHARE_OF_EXTRA else pool
    return chosen[int(random.integers(len(chosen)))]


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


class RandomPostures:
    """Postures of all arms of a cell in which nothing comes near anything.

    One arm after the other is drawn until it keeps clear of those before: joints anywhere within
    their limits (those that turn without end: half a turn to each side of zero), but not more than
    half a turn from where the layout starts them, as arms that stand on a floor cannot turn all the
    way round.
    """

    def __init__(self, cell: Cell, clearance: float) -> None:
        """Prepare to draw.

        Args:
            cell: The cell.
            clearance: How near robots may come to each other (m); to a table, `ABOVE_FLOOR` at
                most.
        """
        self._cell, self._whole = cell, cell.checker()
        limits = np.nan_to_num(cell.limits, posinf=np.pi, neginf=-np.pi)
        self._limits = np.clip(limits, cell.start[:, None] - np.pi, cell.start[:, None] + np.pi)
        self._checkers: dict[str, tuple[Checker, Checker]] = {}
        for i, name in enumerate(cell.robots):
            earlier = [(name, other) for other in cell.robots[:i]]
            later = [(name, other) for other in cell.robots[i + 1 :]]
            tables = [(name, table) for table in cell.tables]
            self._checkers[name] = (
                cell.checker([name], clearance, own=None, except_=later + tables),
                cell.checker([name], min(clearance, ABOVE_FLOOR), except_=later + earlier),
            )

    def drawn(self, seed: Sequence[int]) -> Iterator[Floats]:
        """Yield postures, (D,) (rad, m), the same for the same seed."""
        random = np.random.default_rng(list(seed))
        while True:
            state: Floats | None = self._cell.start.copy()
            for name in self._cell.robots:
                if state is not None:
                    state = self._with_arm(state, name, random)
            if state is not None and self._whole.free(state[None])[0]:
                yield state

    def _with_arm(self, state: Floats, name: str, random: np.random.Generator) -> Floats | None:
        robot = self._cell.layout[name].robot
        first = self._cell.slices[name].start
        columns = [first + robot.joints.index(joint) for joint in arm_joints(robot)]
        low, high = self._limits[columns].T
        for _ in range(TRIES // 20):
            states = np.tile(state, (20, 1))
            states[:, columns] = random.uniform(low, high, (20, len(columns)))
            free = np.all([checker.free(states) for checker in self._checkers[name]], axis=0)
            if free.any():
                return states[np.argmax(free)]
        return None

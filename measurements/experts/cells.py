"""Other layouts for tasks with several robots: what arms must reach there, and a search for it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from layouts import Layout, ring, search
from layouts.frames import Frame
from robots import LayoutError, TaskError
from tasks import get_task_class, make

Area = tuple[tuple[float, float], tuple[float, float], tuple[float, float]]  # x, y, z (m)

DOWN = (0.0, 1.0, 0.0, 0.0)  # a gripper that points straight down, wxyz
GRIPPERS = ("panda", "panda_wristcam", "franka_panda", "panda")  # in turn, place by place
STICKS = ("panda_stick", "panda")
RELAY = ("panda", "panda_stick", "panda_wristcam", "franka_panda")


@dataclass(frozen=True)
class Cell:
    """What a task asks of a layout.

    Attributes:
        reached: For each place, the boxes whose corners it must reach with the gripper pointing
            straight down.
        around: Where bases may stand; see `layouts.search`.
        robots: For each place the robots that stand there in turn.
    """

    reached: Mapping[str, Sequence[Area]]
    around: Mapping[str, Frame] | tuple[float, float, float, float]
    robots: Mapping[str, Sequence[str]]


def _beside(x: float, low: float, high: float, z: tuple[float, float] = (0.03, 0.1)) -> Area:
    """Return the box at both sides of x = 0, from one y to another."""
    return (-x, x), (low, high), z


CELLS = {
    "TwoRobotPickCube-v1": Cell(
        {
            "left": [_beside(0.05, -0.2, -0.1), _beside(0.0, 0.0, 0.0, (0.22, 0.22))],
            "right": [
                _beside(0.05, 0.1, 0.2, (0.1, 0.3)),
                _beside(0.0, 0.0, 0.0, (0.22, 0.22)),
            ],
        },
        (-0.3, -0.4, 0.3, 0.4),
        {"left": GRIPPERS, "right": GRIPPERS[1:]},
    ),
    "TwoRobotStackCube-v1": Cell(
        {
            "left": [_beside(0.05, -0.2, -0.1, (0.03, 0.15))],
            "right": [_beside(0.05, 0.1, 0.2), _beside(0.05, -0.1, -0.1)],
        },
        (-0.3, -0.4, 0.3, 0.4),
        {"left": GRIPPERS, "right": GRIPPERS[1:]},
    ),
    "TwoRobotLiftBar-v1": Cell(
        {
            "left": [_beside(0.13, -0.28, -0.2, (0.03, 0.25))],
            "right": [_beside(0.13, 0.2, 0.28, (0.03, 0.25))],
        },
        (-0.3, -0.45, 0.3, 0.45),
        {"left": GRIPPERS, "right": GRIPPERS[1:]},
    ),
    "TwoRobotPushPick-v1": Cell(
        {
            "pusher": [_beside(0.1, -0.33, 0.0, (0.03, 0.13))],
            "picker": [_beside(0.1, -0.03, 0.1), _beside(0.1, 0.15, 0.25, (0.1, 0.3))],
        },
        (-0.3, -0.5, 0.3, 0.5),
        {"pusher": STICKS, "picker": GRIPPERS},
    ),
    "FourRobotStack-v1": Cell(
        {
            "south": [_beside(0.08, -0.33, -0.25), _beside(0.0, 0.0, 0.0, (0.03, 0.1))],
            "east": [
                ((0.25, 0.33), (-0.08, 0.08), (0.03, 0.1)),
                _beside(0.0, 0.0, 0.0, (0.07, 0.14)),
            ],
            "north": [_beside(0.08, 0.25, 0.33), _beside(0.0, 0.0, 0.0, (0.11, 0.18))],
            "west": [
                ((-0.33, -0.25), (-0.08, 0.08), (0.03, 0.1)),
                _beside(0.0, 0.0, 0.0, (0.15, 0.22)),
            ],
        },
        (-0.5, -0.5, 0.5, 0.5),
        {"south": GRIPPERS, "east": GRIPPERS[1:], "north": GRIPPERS[2:], "west": GRIPPERS},
    ),
}
TASKS = (*CELLS, "Relay-v1")


def other_layout(task_id: str, number: int) -> Layout:
    """Return one of the layouts that a task is tried in, besides its own; the same every time.

    For Relay it is a ring of any valid number of robots, else what `layouts.search` returns.

    Args:
        task_id: One of `TASKS`.
        number: Which one.

    Raises:
        LayoutError: If the search finds none.
        TaskError: If nothing is known of the task.
    """
    if task_id == "Relay-v1":
        return _ring(number)
    if task_id not in CELLS:
        raise TaskError(f"nothing is known of {task_id}; tasks: {', '.join(TASKS)}")
    cell = CELLS[task_id]
    robots = {place: choices[number % len(choices)] for place, choices in cell.robots.items()}
    targets = {
        f"{place} {i}": (*point, *DOWN)
        for place, areas in cell.reached.items()
        for i, point in enumerate(p for area in areas for p in dict.fromkeys(product(*area)))
    }
    within = np.random.default_rng(number).uniform(0.7, 1.1, 2)
    edge_x, edge_y = within.tolist()
    return search(
        {place: robots[place] for place in get_task_class(task_id).layout},
        targets,
        around=cell.around,
        within=(-edge_x, -edge_y, edge_x, edge_y),
        reached_by={name: name.split()[0] for name in targets},
        seed=number,
        tries=1,
    )


def _ring(number: int) -> Layout:
    """Return a ring of three to six robots, of any radius at which they can pass on."""
    random = np.random.default_rng(number)
    while True:
        names = [f"robot_{i + 1}" for i in range(3 + number % 4)]
        robots = {name: RELAY[int(random.integers(len(RELAY)))] for name in names}
        layout = ring(robots, radius=float(random.uniform(0.55, 1.1)))
        try:
            make("Relay-v1", layout=layout, obs_mode="none").close()
        except (LayoutError, TaskError):
            continue
        return layout

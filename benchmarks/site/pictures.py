"""``python -m benchmarks pictures``: draws the documentation's pictures anew."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image
from tqdm import tqdm

import tasks
from benchmarks.records import DOCS
from layouts import Layout, ring, search, table
from robot_layouts.core.writing import write_whole
from robot_layouts.experts import find_expert
from robot_layouts.motion import TcpGoal, plan
from robot_layouts.simulation.cameras import Camera
from robots import UnknownNameError
from tasks.episode import play

WIDTH, HEIGHT = 640, 340  # of rendered pictures (pixels)
FRAME, LAST = 60, 1500  # how long a frame stays, and the last one (ms)
COLOURS = 64  # of a drawing
FRONT = Camera((-0.12, -0.3, 0.62), (0.5, 0.0, 0.23), "view", WIDTH, HEIGHT, 0.82)  # of a body
VIEW = Camera((1.2, 0.0, 1.05), (-0.05, 0.0, 0.2), "view", WIDTH, HEIGHT, 0.82)  # m, rad


def pictures(names: Sequence[str] = (), *, out: Path = DOCS / "images") -> int:
    """Draw the documentation's pictures anew.

    They are committed, so that nobody needs a Vulkan driver or a planner to see them.

    Args:
        names: hand_over.webp, humanoid.webp, placement_search.png, crossing.png (all).
        out: Their folder.

    Raises:
        RobotLayoutsError: If one cannot be drawn or written.
    """
    for name in names or PICTURES:
        if name not in PICTURES:
            raise UnknownNameError("picture", name, PICTURES)
        PICTURES[name](out / name)
        print(f"{out / name}: {(out / name).stat().st_size / 1000:.0f} kB")
    return 0


def hand_over(path: Path) -> None:
    """Film two arms that hand a cube over."""
    film("TwoRobotPickCube-v1", 3, path)


def humanoid(path: Path) -> None:
    """Film a humanoid that hands a cube from one hand to the other."""
    film("TwoRobotHandOver-v1", 0, path, FRONT, robots="unitree_g1_with_hands")


def placement_search(path: Path) -> None:
    """Draw the layout that the page about placement search looks for."""
    targets = {"feeder": (-0.35, 0.1, 0.15), "fixture": (0.0, 0.0, 0.2), "tray": (0.35, 0.1, 0.1)}
    cell = search(
        {"left": "panda", "right": "ur5_gripper"},
        targets,
        around=table(1.4, 0.9),
        reached_by={"feeder": "left", "fixture": "all", "tray": "right"},
    )
    picture = Image.open(cell.validate(targets=targets).picture(path))
    picture.resize((picture.width // 2, picture.height // 2)).quantize(COLOURS).save(path)


def film(task_id: str, seed: int, path: Path, camera: Camera = VIEW, **scenario: Any) -> None:
    """Write an animation of an expert's episode.

    Args:
        task_id: The task.
        seed: The episode.
        path: Of the WebP file.
        camera: What sees it.
        scenario: What `tasks.make` takes besides.

    Raises:
        UnwritableFileError: If the file cannot be written.
    """
    task = tasks.make(task_id, render_mode="rgb_array", **scenario)
    plan = np.asarray(find_expert(task_id)(task, seed))
    frames: list[Image.Image] = []
    with tqdm(total=len(plan) + 1, desc=path.name, unit="frames", disable=None) as bar:

        def watch() -> None:
            (view,) = task.simulation.look(0, {"view": camera}, ("rgb",), markers=True)
            frames.append(Image.fromarray(view.images["rgb"].astype(np.uint8)))
            bar.update()

        play(task, seed, plan, watch)
    task.close()
    first, *others = frames
    durations, stream = [FRAME] * len(others) + [LAST], BytesIO()
    moving = {"save_all": True, "append_images": others, "duration": durations, "loop": 0}
    first.save(stream, "WEBP", quality=60, method=6, **moving)
    write_whole(path, stream.getvalue())


def crossing(path: Path) -> None:
    """Draw four arms in a ring that all reach from their right to their left at the same time."""
    cell = ring(dict.fromkeys(("south", "east", "north", "west"), "panda"), radius=0.75)
    ready = plan(cell, goals=_beside(cell, 1))
    plan(cell, ready.end, _beside(cell, -1)).picture(path)


def _beside(cell: Layout, step: int) -> dict[str, TcpGoal]:
    """Return goals before the bases that stand some places further in a ring."""
    bases = [placement.base_position for placement in cell.values()]
    before = [bases[(i + step) % len(bases)] for i in range(len(bases))]
    return {
        name: TcpGoal((0.4 * x, 0.4 * y, 0.3)) for name, (x, y, _) in zip(cell, before, strict=True)
    }


PICTURES: dict[str, Callable[[Path], None]] = {
    "hand_over.webp": hand_over,
    "humanoid.webp": humanoid,
    "placement_search.png": placement_search,
    "crossing.png": crossing,
}

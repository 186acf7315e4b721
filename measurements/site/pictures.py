"""``python -m measurements.site.pictures``: draws the documentation's pictures anew.

They are committed, so that nobody needs a Vulkan driver or a planner to see them.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from PIL import Image

import tasks
from experts import find_expert
from layouts import Layout, ring, search, table
from motion import TcpGoal, plan
from robots import RecordingError
from robots.common.commands import exit_code, start
from robots.common.writing import written_whole
from rollouts.progress import LiveLine
from simulation.scene.cameras import Camera
from tasks.episode import play

FOLDER = Path("docs/images")
WIDTH, HEIGHT = 640, 340  # of rendered pictures (pixels)
FRAME, LAST = 60, 1500  # how long a frame stays, and the last one (ms)
COLOURS = 64  # of a drawing
VIEW = Camera((1.2, 0.0, 1.05), (-0.05, 0.0, 0.2), "view", WIDTH, HEIGHT, 0.82)  # m, rad


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command.

    Returns:
        0 if every picture was drawn, 1 if not.
    """
    parser = argparse.ArgumentParser(prog="python -m measurements.site.pictures")
    parser.add_argument("only", nargs="*", metavar="NAME", help=f"of {', '.join(PICTURES)}")
    parser.add_argument("--out", type=Path, default=FOLDER, metavar="DIR", help=f"({FOLDER})")
    options = parser.parse_args(arguments)
    options.out.mkdir(parents=True, exist_ok=True)
    return exit_code(lambda: _draw(options.only or [*PICTURES], options.out))


def _draw(names: Sequence[str], folder: Path) -> None:
    for name in names:
        PICTURES[name](folder / name)
        print(f"{folder / name}: {(folder / name).stat().st_size / 1000:.0f} kB")


def hand_over(path: Path) -> None:
    """Film two arms that hand a cube over."""
    film("TwoRobotPickCube-v1", 3, path)


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


def film(task_id: str, seed: int, path: Path) -> None:
    """Write an animation of an expert's episode.

    Raises:
        RecordingError: If the file cannot be written.
    """
    task = tasks.make(task_id, render_mode="rgb_array")
    plan = np.asarray(find_expert(task_id)(task, seed))
    frames: list[Image.Image] = []
    with LiveLine(len(plan) + 1, "frames") as line:

        def watch() -> None:
            (view,) = task.simulation.look(0, {"view": VIEW}, ("rgb",), markers=True)
            frames.append(Image.fromarray(view.images["rgb"].astype(np.uint8)))
            line.advance(1, path.name)

        play(task, seed, plan, watch)
    task.close()
    _save(frames, path, FRAME)


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


def _save(frames: Sequence[Image.Image], path: Path, duration: int) -> None:
    durations = [duration] * (len(frames) - 1) + [LAST]
    with written_whole(path, RecordingError) as partial:
        frames[0].save(
            partial,
            format="webp",
            save_all=True,
            append_images=frames[1:],
            duration=durations,
            loop=0,
            quality=60,
            method=6,
        )


PICTURES: dict[str, Callable[[Path], None]] = {
    "hand_over.webp": hand_over,
    "placement_search.png": placement_search,
    "crossing.png": crossing,
}


if __name__ == "__main__":
    start(main)

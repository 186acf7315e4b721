"""A task's clip: an episode of its expert, from the reset to its end, in few pictures."""

from __future__ import annotations

from math import atan2, ceil, radians

import numpy as np

import tasks
from experts import find_expert
from measurements.gallery.camera import TEXTURES, Floats, Lens, Picture, shrunk
from simulation import Camera
from tasks import MultiRobotTask
from tasks.engine.columns import overview
from tasks.episode import play

FRAMES_PER_SECOND = 10
LONGEST = 6.0  # s; what takes longer is shown faster
HEIGHT, ASPECT = 240, 4 / 3
SAMPLES = 2  # pixels that are drawn for one, along each side
ELEVATION, FIELD_OF_VIEW, MARGIN = radians(28), radians(40), 0.08
LOWEST, FARTHEST = -0.05, 2.0  # m; what is beyond is hidden there


def steps_per_frame(steps: int, control_frequency: float) -> int:
    """Return how many control steps lie between two pictures of an episode of so many steps."""
    return max(
        ceil(control_frequency / FRAMES_PER_SECOND), ceil(steps / (LONGEST * FRAMES_PER_SECOND))
    )


def speed(steps: int, control_frequency: float) -> float:
    """Return how many times its real speed an episode of so many steps is shown at."""
    return steps_per_frame(steps, control_frequency) * FRAMES_PER_SECOND / control_frequency


class Performance:
    """An episode that is filmed; what it is drawn with lives as long as this."""

    def __init__(self, task_id: str, seed: int) -> None:
        """Let the expert plan it, and play it once without a camera.

        Args:
            task_id: Id of the task.
            seed: Of the episode.

        Raises:
            TaskError: If the expert finds no plan.
            AssetError: If robot files cannot be had.
        """
        planning, points = tasks.make(task_id), list[Floats]()
        try:
            self._seed, self._actions = seed, find_expert(task_id)(planning, seed)
            play(planning, seed, self._actions, lambda: points.append(_places(planning)))
        finally:
            planning.close()
        self._task: MultiRobotTask = tasks.make(task_id, render_mode="rgb_array")
        lens = _lens(self._task)
        self._camera = lens.camera(lens.fitted(np.concatenate(points)), HEIGHT * SAMPLES)

    def film(self) -> list[Picture]:
        """Play it, and return its pictures, the last of them of its end."""
        task, pictures, step = self._task, list[Picture](), 0
        stride = steps_per_frame(len(self._actions), task.scenario.control_frequency)

        def watch() -> None:
            nonlocal step
            if step % stride == 0 or step == len(self._actions):
                pictures.append(_look(task, self._camera))
            step += 1

        play(task, self._seed, self._actions, watch)
        return pictures


def _lens(task: MultiRobotTask) -> Lens:
    """Look from where the task is best seen: two robots from the side."""
    eye, target = (overview(task.layout) if len(task.layout) == 2 else None) or task.viewpoint
    azimuth = atan2(eye[1] - target[1], eye[0] - target[0])
    return Lens(azimuth, ELEVATION, FIELD_OF_VIEW, ASPECT, MARGIN)


def _places(task: MultiRobotTask) -> Floats:
    """Return where all links and bodies are that may move, (P, 3) (m, world)."""
    state, simulation = task.simulation.read(), task.simulation
    places = [
        state.link_position(robot, link)
        for robot in task.layout
        for link in simulation.index.links[robot]
    ]
    bodies = simulation.worlds[0].bodies
    places += [state.position(name) for name, body in bodies.items() if body.kind != "static"]
    points = np.concatenate(places).astype(np.float64)
    return points[(np.abs(points) < FARTHEST).all(1) & (points[:, 2] > LOWEST)]


def _look(task: MultiRobotTask, camera: Camera) -> Picture:
    (view,) = task.simulation.look(0, {"clip": camera}, TEXTURES[:2], markers=True)
    images = view.images
    return shrunk(images["rgb"].astype(np.uint8), images["segmentation"] != 0, SAMPLES)

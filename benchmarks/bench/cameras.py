"""What pictures cost: by size, number and kind of cameras, and the rate of a cell that observes."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from functools import partial
from typing import Any, NamedTuple

import tasks
from benchmarks.bench.environments import random_actions
from benchmarks.bench.measurement import BenchmarkError, Measurement, Sample, Settings, measured
from benchmarks.bench.vectors import PROCESSES, Helpers, TimedVector, draw_everything, vector
from robot_layouts.simulation.rendering import Observers, vulkan_problem
from tasks import TaskEnv
from tasks.engine.cameras import by_place, cameras_of, resized
from tasks.engine.scenario import VISUALS

TASK = "TwoRobotPickCube-v1"
ROBOTS = {"left": "panda_wristcam", "right": "panda_wristcam"}
STANDING, LEFT, RIGHT = "base_camera", "left.hand_camera", "right.hand_camera"
ALL, LARGE = (STANDING, LEFT, RIGHT), 224  # pixels
OBSERVING: dict[str, Any] = {
    "robots": ROBOTS,
    "obs_mode": "rgb",
    "camera_size": (LARGE, LARGE),
    "visuals": "light",
}
RATE, DRAWING = "observing 'rgb'", "SAPIEN's drawing of everything"
STEPS, ROUNDS = 4, 5  # pictures take tens of ms of a processor
RATED = 16  # control steps of a sample of the rate, of all environments


class Looking(NamedTuple):
    """What is looked at: cameras by place, width and height of pictures (pixels), textures."""

    cameras: tuple[str, ...] = ALL
    size: int = LARGE
    textures: tuple[str, ...] = ("rgb",)


LOOKING = {
    "1 of 224×224, standing": Looking((STANDING,)),
    "1 of 224×224, on a wrist": Looking((LEFT,)),
    "2 of 224×224, on wrists": Looking((LEFT, RIGHT)),
    "3 of 64×64": Looking(size=64),
    "3 of 128×128": Looking(size=128),
    "3 of 224×224": Looking(),
    "3 of 224×224, depth": Looking(textures=("depth",)),
    "3 of 224×224, segmentation": Looking(textures=("segmentation",)),
    "3 of 224×224, all three": Looking(textures=("rgb", "depth", "segmentation")),
}
"""Colours, unless they say otherwise."""


class SeenWorld:
    """A world that is looked at after each step of random actions."""

    def __init__(self, env: TaskEnv, looking: Looking, settings: Settings) -> None:
        """Take an environment whose world can be drawn."""
        known = by_place(cameras_of(env.layout, env.cameras))
        size = looking.size, looking.size
        self._cameras = {name: resized(known[name], size) for name in looking.cameras}
        self._env, self._textures, self._clock = env, looking.textures, settings.clock
        self._observers = Observers(env.simulation, self._cameras, looking.textures)

    def observed(self, number: int) -> float:
        """Return the time of the pictures of a step (ms)."""
        return self._timed(number, partial(self._observers.look, 0))

    def everything(self, number: int) -> float:
        """Return the same if SAPIEN draws everything anew (ms)."""
        # With its markers a world is drawn at once, nothing left out.
        look = partial(self._env.simulation.look, 0, self._cameras, self._textures, markers=True)
        return self._timed(number, look)

    def _timed(self, number: int, look: Callable[[], Any]) -> float:
        self._env.reset(number)
        look()
        spent = 0.0
        for action in random_actions(number, STEPS, 1, self._env.single_action_space.shape[0]):
            self._env.step(action)
            start = self._clock.now()
            look()
            spent += self._clock.now() - start
        return spent / STEPS * 1e3


def cameras(settings: Settings) -> Measurement:
    """The pictures of a step by size, number and kind of cameras, beside SAPIEN's drawing alone."""
    _expect_driver()
    here, alone = VISUALS, tuple(f"{visuals}, SAPIEN's" for visuals in VISUALS)
    variants: dict[tuple[str, str], Sample] = {}
    for visuals, drawing in zip(here, alone, strict=True):
        env = tasks.make(
            TASK, robots=ROBOTS, obs_mode="none", render_mode="rgb_array", visuals=visuals
        )
        for name, looking in LOOKING.items():
            world = SeenWorld(env, looking, settings)
            variants |= {(visuals, name): world.observed, (drawing, name): world.everything}
    samples = settings.interleave(variants, rounds=min(settings.rounds, ROUNDS))
    title = f"Pictures of a step of {TASK}, of full or light meshes, beside {DRAWING}"
    ratios = tuple(zip(here, alone, strict=True))
    return measured("cameras", title, "ms per step", "cameras", samples, ratios=ratios)


def camera_rate(settings: Settings) -> Measurement:
    """The rate of a cell with three cameras, in one process and in two."""
    _expect_driver()
    clock, variants = settings.clock, dict[tuple[str, str], Sample]()
    with ExitStack() as stack:
        floor = stack.enter_context(Helpers(PROCESSES, draw_everything, TASK, OBSERVING))
        for workers, processes in ((0, 1), (PROCESSES, PROCESSES)):
            for each in (1, 4):
                count = each * processes
                env = stack.enter_context(vector(TASK, count, workers, **OBSERVING))
                name = f"{f'{workers} workers' if workers else 'one process'}, {each} each"
                variants[RATE, name] = TimedVector(env, clock, RATED // count).rate
                variants[DRAWING, name] = lambda _, processes=processes: clock.rate(
                    (STEPS, seconds) for seconds in floor.ask([(STEPS, clock)] * processes)
                )
        samples = settings.interleave(variants, rounds=min(settings.rounds, ROUNDS))
    title = f"Rate of {TASK} with three cameras of {LARGE}×{LARGE}, two on wrists, light meshes"
    ratios = ((RATE, DRAWING),)
    return measured("camera_rate", title, clock.rate_unit, "environments", samples, ratios=ratios)


def _expect_driver() -> None:
    if problem := vulkan_problem():
        raise BenchmarkError(f"no pictures can be drawn here: {problem}")

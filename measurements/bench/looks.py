"""What pictures that vary cost: resets with each visual axis alone, and their first pictures."""

from __future__ import annotations

from typing import Any

import tasks
from measurements.bench.episodes import Sample, timed_resets
from measurements.bench.measurement import Measurement, by_series
from measurements.bench.settings import Settings
from measurements.bench.varying import EVERYTHING, PLAIN
from simulation.rendering.pictures import vulkan_problem
from tasks import (
    CameraShift,
    Distractors,
    Light,
    Normal,
    Randomization,
    Surface,
    Texture,
    Uniform,
    Whole,
)

RESET, PICTURE = "reset", "reset and picture"
SHIFT = CameraShift(x=Normal(0.02), y=Normal(0.02), yaw=Normal(0.05), fov=Uniform(0.9, 1.1))
LIGHT = Light(turn=Uniform(-1, 1), tilt=Uniform(0, 0.5), strength=Uniform(0.5, 1.5))
PAINT = Surface(red=Uniform(0, 1), green=Uniform(0, 1), blue=Uniform(0, 1), share=0.5)

# Each axis on all that it can vary, and textures on one body, too.
ALONE = {
    PLAIN: None,
    "cameras": Randomization(cameras={EVERYTHING: SHIFT}),
    "lights": Randomization(lights={EVERYTHING: LIGHT}),
    "colors": Randomization(colors={EVERYTHING: PAINT}),
    "textures": Randomization(textures={EVERYTHING: Texture()}),
    "textures; one body": Randomization(textures={"cube": Texture()}),
    "distractors; 8, visual": Randomization(
        distractors=Distractors(count=Whole(4, 8), kind="visual")
    ),
    "distractors; 8, dynamic": Randomization(distractors=Distractors(count=Whole(4, 8))),
}


def looks(settings: Settings) -> Measurement:
    """Time resets with each visual axis alone, without pictures and with one of 128 × 128."""
    series = {RESET: "none"} if vulkan_problem() else {RESET: "none", PICTURE: "rgb"}
    task, values = settings.tasks[0], tuple(ALONE)
    variants = {
        (name, axis): _resets(task, settings, obs_mode=obs_mode, randomization=alone)
        for axis, alone in ALONE.items()
        for name, obs_mode in series.items()
    }
    return Measurement(
        name="looks",
        title=f"Worlds of {task} that look different, each axis alone",
        unit="ms per reset",
        variable="what varies",
        values=values,
        samples=by_series(values, settings.interleave(variants)),
    )


def _resets(task: str, settings: Settings, **options: Any) -> Sample:
    making: dict[str, Any] = {**settings.making, **options}
    return timed_resets(tasks.make(task, **making).reset, settings.clock)

"""What worlds that vary cost: resets and steps with each axis alone."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import tasks
from measurements.bench.episodes import timed_resets
from measurements.bench.measurement import Measurement, by_series
from measurements.bench.settings import Settings
from measurements.bench.steps import Played
from tasks import MultiRobotTask, Normal, Randomization, Shift, Uniform, Whole
from tasks.episode import REBUILT

PLAIN, REBUILD = "nothing", "nothing; world built anew"
EVERYTHING = "*"  # any body or robot
SHIFT = Shift(x=Uniform(-0.02, 0.02), y=Uniform(-0.02, 0.02), yaw=Uniform(-0.1, 0.1))

# Each axis on all that it can vary.
ALONE = {
    "mass": Randomization(mass={EVERYTHING: Uniform(0.8, 1.2)}),
    "friction": Randomization(friction={EVERYTHING: Uniform(0.3, 1.0)}),
    "stiffness": Randomization(stiffness={EVERYTHING: Uniform(0.8, 1.2)}),
    "damping": Randomization(damping={EVERYTHING: Uniform(0.8, 1.2)}),
    "joint_friction": Randomization(joint_friction={EVERYTHING: Uniform(0.0, 0.2)}),
    "bases": Randomization(bases={EVERYTHING: SHIFT}),
    "action_noise": Randomization(action_noise={EVERYTHING: Normal(0.02)}),
    "action_delay": Randomization(action_delay=Whole(1, 3)),
    "sensor_noise": Randomization(sensor_noise={"*.*": Normal(0.01), "*": Normal(0.01)}),
    "observation_delay": Randomization(observation_delay=Whole(1, 3)),
    "size": Randomization(size={EVERYTHING: Uniform(0.9, 1.1)}),
    "gravity": Randomization(gravity=Uniform(9.0, 10.5)),
}


def varying(settings: Settings) -> Measurement:
    """Time resets and steps of one environment with each axis of a randomization alone."""
    task, clock = settings.tasks[0], settings.clock
    plain = tasks.make(task, **settings.making)
    variants = {
        ("reset", PLAIN): timed_resets(plain.reset, clock),
        ("reset", REBUILD): timed_resets(lambda seed: plain.reset(seed, options=REBUILT), clock),
        ("step", PLAIN): _steps_of(plain, settings),
        ("step", REBUILD): _steps_of(plain, settings),
    }
    for axis, alone in ALONE.items():
        making: dict[str, Any] = {**settings.making, "randomization": alone}
        env = tasks.make(task, **making)
        variants["reset", axis] = timed_resets(env.reset, clock)
        variants["step", axis] = _steps_of(env, settings)
    values = (PLAIN, *ALONE, REBUILD)
    return Measurement(
        name="varying",
        title=f"Worlds of {task} that vary, each axis alone",
        unit="ms per reset or step",
        variable="what varies",
        values=values,
        samples=by_series(values, settings.interleave(variants)),
    )


def _steps_of(env: MultiRobotTask, settings: Settings) -> Callable[[int], float]:
    """Return what tells the time of one step (ms)."""
    played = Played(env, settings)
    return lambda number: played.step(number) / 1e3

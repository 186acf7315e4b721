"""What one environment costs: steps, resets, recordings, worlds that vary, checks of layouts."""

from __future__ import annotations

import gc
import tempfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

import tasks
from benchmarks.bench.measurement import (
    BenchmarkError,
    Measurement,
    Sample,
    Settings,
    SomeValue,
    measured,
)
from benchmarks.bench.worlds import crowd, make_crowd, make_pile
from parity.native import make_native, native_action
from robot_layouts.data.recording.recorder import Recorder
from robot_layouts.experts import find_expert, list_experts
from robot_layouts.simulation.rendering import vulkan_problem
from robots import TaskError
from tasks import (
    CameraShift,
    Distractors,
    Light,
    Normal,
    Randomization,
    Shift,
    Surface,
    TaskEnv,
    Texture,
    Uniform,
    Whole,
    list_clones,
)
from tasks.episode import REBUILT, play

STEP, PHYSICS, HERE, NATIVE = "step", "physics alone", "here", "native"  # series
EXPERT, RANDOM = "expert's actions", "random actions"  # series, too
SEEDS = 10  # of which an expert must solve one
RESETS = 5  # of a sample
EPISODE_STEPS = 60  # of an episode that is recorded

# Each axis alone, on all that it can vary, and textures on one body, too.
PLAIN, REBUILD = "nothing", "nothing; world built anew"
SHIFT = Shift(x=Uniform(-0.02, 0.02), y=Uniform(-0.02, 0.02), yaw=Uniform(-0.1, 0.1))
VARYING = {
    "mass": Randomization(mass={"*": Uniform(0.8, 1.2)}),
    "friction": Randomization(friction={"*": Uniform(0.3, 1.0)}),
    "stiffness": Randomization(stiffness={"*": Uniform(0.8, 1.2)}),
    "damping": Randomization(damping={"*": Uniform(0.8, 1.2)}),
    "joint_friction": Randomization(joint_friction={"*": Uniform(0.0, 0.2)}),
    "bases": Randomization(bases={"*": SHIFT}),
    "action_noise": Randomization(action_noise={"*": Normal(0.02)}),
    "action_delay": Randomization(action_delay=Whole(1, 3)),
    "sensor_noise": Randomization(sensor_noise={"*.*": Normal(0.01), "*": Normal(0.01)}),
    "observation_delay": Randomization(observation_delay=Whole(1, 3)),
    "size": Randomization(size={"*": Uniform(0.9, 1.1)}),
    "gravity": Randomization(gravity=Uniform(9.0, 10.5)),
}
CAMERA = CameraShift(x=Normal(0.02), y=Normal(0.02), yaw=Normal(0.05), fov=Uniform(0.9, 1.1))
LIGHT = Light(turn=Uniform(-1, 1), tilt=Uniform(0, 0.5), strength=Uniform(0.5, 1.5))
PAINT = Surface(red=Uniform(0, 1), green=Uniform(0, 1), blue=Uniform(0, 1), share=0.5)
LOOKS = {
    PLAIN: None,
    "cameras": Randomization(cameras={"*": CAMERA}),
    "lights": Randomization(lights={"*": LIGHT}),
    "colors": Randomization(colors={"*": PAINT}),
    "textures": Randomization(textures={"*": Texture()}),
    "textures; one body": Randomization(textures={"cube": Texture()}),
    "distractors; 8, visual": Randomization(
        distractors=Distractors(count=Whole(4, 8), kind="visual")
    ),
    "distractors; 8, dynamic": Randomization(distractors=Distractors(count=Whole(4, 8))),
}


class Played:
    """A task whose step is timed under random actions, and the physics of the same motion.

    Attributes:
        env: The task.
        options: Of the reset before every round.
    """

    options: Mapping[str, Any] | None = None

    def __init__(self, env: TaskEnv, settings: Settings) -> None:
        """Take a task; its first action is played now, as building leaves work to it."""
        self.env, self._settings = env, settings
        env.step(torch.from_numpy(self.actions(0)[0]))

    def step(self, number: int) -> float:
        """Return the time of a whole step, for each environment (µs)."""
        actions = [torch.from_numpy(action) for action in self.actions(number)]
        self.env.reset(self.seed(number), options=self.options)
        start = self._settings.clock.now()
        for action in actions:
            self.env.step(action)
        return self._each(self._settings.clock.now() - start, len(actions))

    def physics(self, number: int) -> float:
        """Return the time of its physics alone, for each environment (µs)."""
        actions = self.actions(number)
        self.env.reset(self.seed(number), options=self.options)
        step, clock = self.env.simulation.timed_step, self._settings.clock.now
        return self._each(sum(step(action, clock) for action in actions), len(actions))

    def actions(self, number: int) -> NDArray[np.float32]:
        """Return the actions of a round, shape (steps, N, A)."""
        width = self.env.single_action_space.shape[0]
        return random_actions(number, self._settings.steps, self.env.num_envs, width)

    def seed(self, number: int) -> int:
        """Return the seed of a round's episode."""
        return number

    def _each(self, seconds: float, steps: int) -> float:
        return seconds / (steps * self.env.num_envs) * 1e6


class Worked(Played):
    """A task of one environment whose step is timed under an expert's actions.

    Every round plays the same episode, which succeeds, in a freshly built world.
    """

    options = REBUILT

    def __init__(self, env: TaskEnv, settings: Settings) -> None:
        """Take a task, and find an episode.

        Raises:
            BenchmarkError: If the expert solves none.
            UnknownNameError: If the task has no expert.
        """
        expert = find_expert(env.task_id)
        for self._seed in range(SEEDS):
            try:
                self._actions = expert(env, self._seed)[:, None]
            except TaskError:
                continue
            super().__init__(env, settings)
            self.step(0)
            if env.task.evaluate(env.simulation.read())["success"].all():
                return
        raise BenchmarkError(f"the expert of {env.task_id} solves none of the seeds to {SEEDS - 1}")

    def actions(self, number: int) -> NDArray[np.float32]:
        """Return the actions of the episode, shape (steps, 1, A)."""
        return self._actions

    def seed(self, number: int) -> int:
        """Return the seed of the episode."""
        return self._seed


def random_actions(seed: int, steps: int, envs: int, numbers: int) -> NDArray[np.float32]:
    """Return actions within the range, shape (steps, envs, numbers)."""
    drawn = np.random.default_rng(seed).uniform(-1, 1, (steps, envs, numbers))
    return drawn.astype(np.float32)


def step(settings: Settings) -> Measurement:
    """A step of one environment, under an expert's actions and under random ones."""
    envs = {task_id: tasks.make(task_id) for task_id in settings.task}
    played: dict[str, dict[str, Played]] = {EXPERT: {}, RANDOM: {}}
    for task_id, env in envs.items():
        if task_id in list_experts():
            played[EXPERT][task_id] = Worked(env, settings)
        played[RANDOM][task_id] = Played(env, settings)
    title = "One step of one environment, by task"
    return _timed_beside_physics(settings, "step", title, "task", played)


def environments(settings: Settings) -> Measurement:
    """A step by number of environments in one process."""
    task_id, settings = settings.task[0], replace(settings, steps=settings.batch_steps)
    envs = {count: tasks.make(task_id, num_envs=count) for count in settings.environments}
    title = f"One step per environment of one process, {task_id}"
    return _beside_physics(settings, "environments", title, "environments", {STEP: envs})


def robots(settings: Settings) -> Measurement:
    """A step by number of robots in a ring, of one kind and mixed."""
    rings = {"one kind": settings.kinds[:1], "mixed": settings.kinds}
    envs = {
        name: {count: make_crowd(count, kinds) for count in settings.robots}
        for name, kinds in rings.items()
    }
    title = f"One step of a ring of robots: {settings.kinds[0]}, or {' + '.join(settings.kinds)}"
    return _beside_physics(settings, "robots", title, "robots", envs)


def contacts(settings: Settings) -> Measurement:
    """A step by number of bodies that touch."""
    envs: dict[int, TaskEnv] = {}
    for cubes in settings.cubes:
        env = make_pile(cubes)
        Played(env, settings)  # its first action lets the cubes touch
        envs[env.touching()] = env
    title = "One step beside cubes that touch"
    return _beside_physics(settings, "contacts", title, "pairs that touch", {STEP: envs})


def reset(settings: Settings) -> Measurement:
    """A reset of one environment, as it is and with the world built anew."""
    variants: dict[tuple[str, str], Sample] = {}
    for task_id in settings.task:
        env = tasks.make(task_id)
        variants["reset", task_id] = _timed_resets(settings, env.reset)
        variants["world built anew", task_id] = _timed_resets(settings, _rebuild(env))
    title, samples = "A reset of one environment, by task", settings.interleave(variants)
    return measured("reset", title, "ms per reset", "task", samples)


def recording(settings: Settings) -> Measurement:
    """An episode of random actions that is recorded, and one that is only stepped."""
    variants: dict[tuple[str, str], Sample] = {}
    for task_id in settings.task:
        env = tasks.make(task_id)
        variants["stepped", task_id] = _timed_episodes(env, settings, _step_all)
        variants["recorded", task_id] = _timed_episodes(env, settings, _record_all)
    samples = settings.interleave(variants, rounds=min(settings.rounds, 5))
    title = f"An episode of a reset and {EPISODE_STEPS} steps, recorded or not"
    ratios = (("recorded", "stepped"),)
    return measured("recording", title, "ms per episode", "task", samples, ratios=ratios)


def validation(settings: Settings) -> Measurement:
    """The check of a layout whose robots were loaded before."""
    variants = {
        ("layout.validate()", count): _timed(settings, crowd(count, settings.kinds).validate, 1e3)
        for count in settings.checked
    }
    title = f"layout.validate() of a ring of {' + '.join(settings.kinds)}"
    samples = settings.interleave(variants)
    return measured("validation", title, "ms per check", "robots", samples)


def varying(settings: Settings) -> Measurement:
    """Resets and steps of worlds that vary, each axis of a randomization alone."""
    task, plain = settings.task[0], tasks.make(settings.task[0])
    resets, steps = [(PLAIN, _timed_resets(settings, plain.reset))], [(PLAIN, plain)]
    for axis, alone in VARYING.items():
        env = tasks.make(task, randomization=alone)
        resets.append((axis, _timed_resets(settings, env.reset)))
        steps.append((axis, env))
    resets.append((REBUILD, _timed_resets(settings, _rebuild(plain))))
    steps.append((REBUILD, plain))
    variants = {("reset", axis): timed for axis, timed in resets}
    variants |= {("step", axis): _timed_steps(settings, env) for axis, env in steps}
    title, samples = f"Worlds of {task} that vary, each axis alone", settings.interleave(variants)
    return measured("varying", title, "ms per reset or step", "what varies", samples)


def looks(settings: Settings) -> Measurement:
    """Resets of worlds that look different, without pictures and with one of 128 × 128."""
    modes = {"reset": "none"} | ({} if vulkan_problem() else {"reset and picture": "rgb"})
    task = settings.task[0]
    variants = {
        (series, axis): _timed_resets(
            settings, tasks.make(task, obs_mode=mode, randomization=alone).reset
        )
        for axis, alone in LOOKS.items()
        for series, mode in modes.items()
    }
    title = f"Worlds of {task} that look different, each axis alone"
    samples = settings.interleave(variants)
    return measured("looks", title, "ms per reset", "what varies", samples)


def step_beside_native(settings: Settings) -> Measurement:
    """A step of one environment of each clone, native's and ours, under both kinds of actions."""

    def variants(native: Any, ours: TaskEnv) -> dict[str, Sample]:
        found: dict[str, Sample] = {}
        for kind, cls in ((EXPERT, Worked), (RANDOM, Played)):
            played = cls(ours, settings)
            found[f"{HERE}, {kind}"] = played.step
            found[f"{NATIVE}, {kind}"] = partial(_native_steps, native, played, settings)
            found[f"{PHYSICS}, {kind}"] = played.physics
        return found

    title = "One step with observation, reward and success"
    samples = _beside_native(settings, variants)
    floors = tuple(f"{PHYSICS}, {kind}" for kind in (EXPERT, RANDOM))
    ratios = tuple(
        (f"{over}, {kind}", f"{under}, {kind}")
        for kind in (EXPERT, RANDOM)
        for over, under in ((NATIVE, HERE), (HERE, PHYSICS))
    )
    return measured("step", title, "µs per step", "task", samples, floors, ratios)


def _native_steps(native: Any, played: Played, settings: Settings, number: int) -> float:
    """Return the time of a step of native's environment under the same actions (µs)."""
    actions = [native_action(native, action[0]) for action in played.actions(number)]
    native.reset(seed=played.seed(number), options=played.options)
    start = settings.clock.now()
    for action in actions:
        native.step(action)
    return (settings.clock.now() - start) / len(actions) * 1e6


def reset_beside_native(settings: Settings) -> Measurement:
    """A reset of one environment of each clone, native's and ours."""

    def variants(native: Any, ours: TaskEnv) -> dict[str, Sample]:
        return {
            HERE: _timed_resets(settings, ours.reset),
            NATIVE: _timed_resets(settings, lambda seed: native.reset(seed=seed)),
        }

    samples = _beside_native(settings, variants)
    title, ratios = "A reset of one environment", ((NATIVE, HERE),)
    return measured("reset", title, "ms per reset", "task", samples, ratios=ratios)


def _beside_native(
    settings: Settings, variants: Callable[[Any, TaskEnv], dict[str, Sample]]
) -> dict[tuple[str, str], list[float]]:
    """Take samples of one clone after the other, with native's environment and ours."""
    samples: dict[tuple[str, str], list[float]] = {}
    clones = [task_id for task_id in settings.task if task_id in list_clones()]
    for task_id in clones:
        native = make_native(task_id)
        native.reset(seed=0)
        gc.freeze()  # native collects garbage when it builds a scene; ours is not to count
        both = {(name, task_id): v for name, v in variants(native, tasks.make(task_id)).items()}
        samples.update(settings.interleave(both, part=1 / len(clones)))
        native.close()
        gc.unfreeze()
    return samples


def _beside_physics(
    settings: Settings,
    name: str,
    title: str,
    variable: str,
    envs: Mapping[str, Mapping[SomeValue, TaskEnv]],
) -> Measurement:
    """Time steps under random actions, and their physics."""
    played = {
        series: {value: Played(env, settings) for value, env in at_values.items()}
        for series, at_values in envs.items()
    }
    return _timed_beside_physics(settings, name, title, variable, played)


def _timed_beside_physics(
    settings: Settings,
    name: str,
    title: str,
    variable: str,
    played: Mapping[str, Mapping[SomeValue, Played]],
) -> Measurement:
    """Time steps and physics; one series is beside `PHYSICS`, several are each beside its own."""
    floors = {series: PHYSICS if len(played) == 1 else f"{series}, physics" for series in played}
    variants: dict[tuple[str, SomeValue], Sample] = {}
    for series, at_values in played.items():
        for value, each in at_values.items():
            variants[series, value] = each.step
            variants[floors[series], value] = each.physics
    samples = settings.interleave(variants)
    floors = {series: floor for series, floor in floors.items() if played[series]}
    return measured(
        name, title, "µs per step", variable, samples, tuple(floors.values()), tuple(floors.items())
    )


def _rebuild(env: TaskEnv) -> Callable[[int], object]:
    return lambda seed: env.reset(seed, options=REBUILT)


def _timed(settings: Settings, work: Callable[[], object], scale: float) -> Sample:
    """Return what times some work, in units of 1 / scale seconds."""

    def sample(number: int) -> float:
        start = settings.clock.now()
        work()
        return (settings.clock.now() - start) * scale

    return sample


def _timed_resets(settings: Settings, reset_to: Callable[[int], object]) -> Sample:
    """Return what times a reset (ms)."""

    def sample(number: int) -> float:
        start = settings.clock.now()
        for seed in range(number * RESETS, (number + 1) * RESETS):
            reset_to(seed)
        return (settings.clock.now() - start) / RESETS * 1e3

    return sample


def _timed_steps(settings: Settings, env: TaskEnv) -> Sample:
    """Return what times a step (ms)."""
    played = Played(env, settings)
    return lambda number: played.step(number) / 1e3


def _timed_episodes(
    env: TaskEnv,
    settings: Settings,
    play_all: Callable[[TaskEnv, Sequence[NDArray[np.float32]]], None],
) -> Sample:
    """Return what times an episode (ms)."""

    def sample(number: int) -> float:
        width = env.single_action_space.shape[0]
        drawn = random_actions(number, settings.episodes * EPISODE_STEPS, 1, width)
        episodes = list(drawn.reshape(settings.episodes, EPISODE_STEPS, -1))
        start = settings.clock.now()
        play_all(env, episodes)
        return (settings.clock.now() - start) / settings.episodes * 1e3

    return sample


def _step_all(env: TaskEnv, episodes: Iterable[NDArray[np.float32]]) -> None:
    for seed, actions in enumerate(episodes):
        env.reset(seed, options=REBUILT)
        for action in actions:
            env.step(torch.from_numpy(action))


def _record_all(env: TaskEnv, episodes: Iterable[NDArray[np.float32]]) -> None:
    with tempfile.TemporaryDirectory() as folder:
        with Recorder(Path(folder) / "trajectory.h5", env) as recorder:
            for seed, actions in enumerate(episodes):
                recorder.add(play(env, seed, actions))

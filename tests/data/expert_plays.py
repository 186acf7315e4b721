"""What experts plan and what comes of it, kept because planning takes seconds."""

import functools

import numpy as np

import tasks
from robot_layouts.experts import find_expert
from tasks.episode import PlayedEpisode, play

REBUILT = {"reconfigure": True}

# Played in every run, where it is not 0 and 1.
SEEDS = {
    "DrawTriangle-v1": (0,),
    "PlugCharger-v1": (0, 3),  # 3 takes the second style
    "PushT-v1": (13, 15),
    "TwoRobotPickCube-v1": tuple(range(10)),
}


def seeds(name: str) -> tuple[int, ...]:
    """Return the seeds of a task that are played in every run."""
    return SEEDS.get(name, (0, 1))


@functools.cache
def task(name: str) -> tasks.MultiRobotTask:
    return tasks.make(name)


@functools.cache
def plan(name: str, seed: int) -> np.ndarray:
    return find_expert(name)(task(name), seed)


@functools.cache
def episode(name: str, seed: int) -> PlayedEpisode:
    """Return the expert's episode, played in an environment that did not plan it."""
    return play(_stage(name), seed, plan(name, seed))


LEFT_OUT = ("seconds", "reason")


def same_episodes(one: PlayedEpisode, other: PlayedEpisode) -> bool:
    """Tell whether all that happened in two episodes is the same, bit for bit.

    The time that it took is not, and only an expert knows the reason of a failure.
    """
    return _kept(one) == _kept(other)


def _kept(value: object) -> object:
    if isinstance(value, PlayedEpisode):
        return _kept({key: part for key, part in vars(value).items() if key not in LEFT_OUT})
    if isinstance(value, dict):
        return {key: _kept(part) for key, part in value.items()}
    if isinstance(value, np.ndarray):
        return value.dtype, value.shape, value.tobytes()
    return value


def path(name: str, seed: int, body: str) -> np.ndarray:
    """Return where a body was before and after every step, (T + 1, 3) (m)."""
    return episode(name, seed).states["actors"][body][:, :3]


@functools.cache
def _stage(name: str) -> tasks.MultiRobotTask:
    return tasks.make(name)

"""Reads what robots' files say, and lets experts play, for the record."""

from __future__ import annotations

from collections.abc import Callable
from hashlib import sha256

import tasks
from measurements.gallery.record import Entry, ExpertRecord, Joint, RobotRecord, TaskRecord
from measurements.robots.record import versions_of
from robots import RobotRegistry
from robots.urdf.reading import read_model
from robots.urdf.summary import read_urdf
from rollouts import evaluate
from rollouts.playing.executor import Event
from tasks import MultiRobotTask

EPISODES = 25
PACKAGES = ("robot-layouts", "sapien", "torch", "numpy")


def read_robot(name: str) -> RobotRecord:
    """Return what the files of a robot say; fetches them if need be.

    Raises:
        UnknownNameError: If there is no such robot.
        AssetError: If its files cannot be had.
    """
    urdf = RobotRegistry.load(name).urdf.locate()
    joints = tuple(
        Joint(j.name, j.type, j.unit, j.lower, j.upper, j.effort, j.velocity, j.mimics)
        for j in read_model(read_urdf(urdf), urdf.name).moving
    )
    return RobotRecord(sha256(urdf.read_bytes()).hexdigest(), joints)


def measure_task(
    task_id: str, on_episode: Callable[[], None], *, episodes: int = EPISODES
) -> TaskRecord:
    """Look at a task's observation, and let its expert play the first seeds.

    Args:
        task_id: Its id.
        on_episode: Called after each episode.
        episodes: How many.

    Raises:
        UnknownNameError: If there is no such task.
        TaskError: If it has no expert.
        AssetError: If robot files cannot be had.
    """
    env = tasks.make(task_id)
    try:
        observation = _entries(env)
    finally:
        env.close()

    def count(event: Event) -> None:
        if event.result is not None:
            on_episode()

    found = evaluate("expert", task_id, range(episodes), workers=0, on_event=count)
    failed = {
        str(seed): found.reasons.get(seed, "") or "not solved at the last step"
        for seed, success in found.successes.items()
        if not success
    }
    steps = tuple(found.lengths.values())
    return TaskRecord(observation, ExpertRecord(episodes, failed, steps, versions_of(*PACKAGES)))


def _entries(env: MultiRobotTask) -> tuple[Entry, ...]:
    return tuple(
        Entry(
            name,
            part.stop - part.start,
            name.endswith((".qpos", ".qvel")) or env.observer.senses(name),
        )
        for name, part in env.observation_slices.items()
    )

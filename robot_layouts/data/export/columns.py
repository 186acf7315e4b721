"""Recorded episodes as named columns (whose joint, which body), and what datasets write of them."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterable, Mapping
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot_layouts.data.actors import EXPERT
from robot_layouts.data.export.shots import Frame
from robot_layouts.data.point_clouds import Cloud
from robot_layouts.data.reading.json_files import TrajectoryError
from robot_layouts.data.reading.recording import Recording, Trajectory
from robots import RobotDescriptor, UnknownNameError
from tasks import TaskEnv
from tasks.engine.columns import placed_bodies
from tasks.episode import States
from tasks.native.format import articulation_keys, body_poses, declared_joints, row_of

Floats = NDArray[np.float32]
Flags = NDArray[np.bool_]
Frames = Iterable[Frame]
Watch = Callable[[int], None]

POSE = ("x", "y", "z", "qw", "qx", "qy", "qz")  # of a body, in the world frame (m, wxyz)
_ACTOR = "kind", "name", "sha256"
ROW = 13  # numbers of a body, and of a robot's root, in a state dict


class Credits:
    """Who acted in a recording.

    Attributes:
        actors: Everybody who acted, each once, as plain data; empty if no episode says it.
        corrected: Whether all episodes hold what a corrector would have done.
    """

    def __init__(self, file: Recording) -> None:
        """Read who it was in each episode."""
        said = [_acted(source) for source in file.sources] if any(file.sources) else []
        self.actors: list[dict[str, Any]] = []
        for actor in (actor for actors in said for actor in actors):
            if actor not in self.actors:
                self.actors.append(actor)
        self.corrected = file.corrected

    def numbers(self, trajectory: Trajectory) -> NDArray[np.int64] | None:
        """Return which of the actors acted at each step, (T,); None if there are not several.

        A converted recording may not know it for each step: then it is the first of its actors.
        """
        if len(self.actors) < 2:
            return None
        acted = [self.actors.index(actor) for actor in _acted(trajectory.source)]
        if trajectory.actor is None:
            return np.full(len(trajectory.actions), acted[0])
        return np.array(acted)[trajectory.actor]


@dataclass(frozen=True)
class Columns:
    """One episode of T steps, column by column; joints are in the order of the descriptors.

    Attributes:
        episode_id: Its number in the recording.
        seed: Seed of its reset, or None.
        actions: Flat actions, (T, A).
        qpos: Place → joint positions, (T + 1, dof) (rad, m).
        qvel: Place → joint velocities, (T + 1, dof) (rad/s, m/s).
        bodies: Poses of all bodies, one after the other, (T + 1, 7 · bodies) (m, wxyz).
        states: The state dict as it was recorded.
        rewards: Shape (T,), or None if the recording holds none.
        success: Shape (T,), or None if the recording holds none.
        done: Whether the episode ended with the step, (T,); always at its last step.
        source: Who acted; see `robot_layouts.data.reading.recording.Trajectory`.
        actor: Who acted at each step, (T,): a number of `Credits.actors`;
            None if there are not several.
        corrections: What a corrector would have done, (T, A); None unless all episodes hold it.
        points: What `robot_layouts.data.point_clouds.point_cloud` returned of what was observed,
            each (T + 1, …); None if no points are exported.
    """

    episode_id: int
    seed: int | None
    actions: Floats
    qpos: dict[str, Floats]
    qvel: dict[str, Floats]
    bodies: Floats
    states: States
    rewards: Floats | None
    success: Flags | None
    done: Flags
    source: Mapping[str, Any] | None = None
    actor: NDArray[np.int64] | None = None
    corrections: Floats | None = None
    points: Cloud | None = None

    def __len__(self) -> int:
        """Return the number of steps T."""
        return len(self.actions)


class ColumnReader:
    """Reads the episodes of one recording as columns, all with the same names.

    Attributes:
        task: The task they were recorded in.
        credits: Who acted in them, or None.
        action_names: ``place.joint`` of each action number, ``place.group`` where one number
            drives a whole group.
        joint_names: ``place.joint`` of each joint.
        bodies: The bodies of the task that move, or that a reset places.
        body_names: ``body.x`` to ``body.qz`` of each body.
    """

    def __init__(self, task: TaskEnv, credits: Credits | None = None) -> None:
        """Take the names from a task and its robots.

        Args:
            task: The task that was recorded.
            credits: Who acted in the recording; None if that is unknown.
        """
        self.task, self.credits = task, credits
        placements = task.layout.items()
        self.action_names = [
            f"{place}.{name}" for place, p in placements for name in action_names(p.robot)
        ]
        self.joint_names = [
            f"{place}.{joint}" for place, p in placements for joint in p.robot.joints
        ]
        self._world = task.simulation.worlds[0]
        self.bodies = placed_bodies(self._world)
        self.body_names = [f"{body}.{number}" for body in self.bodies for number in POSE]
        self._keys = articulation_keys(task.layout)
        self._dof = {place: p.robot.dof for place, p in placements}
        self._judged: tuple[bool, bool] | None = None

    def read(self, trajectory: Trajectory) -> Columns:
        """Return an episode's columns.

        Raises:
            TrajectoryError: If it holds no states, or those of other robots or bodies, or if it
                lacks rewards or success and earlier episodes have them, or the reverse.
        """
        states = self._checked(trajectory)
        rows = {place: states["articulations"][key] for place, key in self._keys.items()}
        dof, none = self._dof, np.empty((len(trajectory.actions) + 1, 0), np.float32)
        found = body_poses(self._world, states)
        poses = [found[body] for body in self.bodies]
        return Columns(
            episode_id=trajectory.episode_id,
            seed=trajectory.seed,
            actions=trajectory.actions,
            qpos={n: self._joints(n, row[:, ROW : ROW + dof[n]]) for n, row in rows.items()},
            qvel={n: self._joints(n, row[:, ROW + dof[n] :]) for n, row in rows.items()},
            bodies=np.concatenate([none, *poses], 1),
            states=states,
            rewards=trajectory.rewards,
            success=trajectory.success,
            done=_done(trajectory),
            source=trajectory.source,
            actor=self.credits.numbers(trajectory) if self.credits else None,
            corrections=trajectory.corrections if self.credits and self.credits.corrected else None,
        )

    def base_poses(self, columns: Columns, place: str) -> Floats:
        """Return the pose of a robot's base in the world frame, (T + 1, 7) (m, wxyz).

        Raises:
            UnknownNameError: If there is no such place.
        """
        if place not in self._keys:
            raise UnknownNameError("place", place, self._keys)
        return columns.states["articulations"][self._keys[place]][:, :7]

    def tcp_poses(self, columns: Columns) -> dict[str, Floats]:
        """Return the TCP pose of each arm, robot or limb, in the world frame, (T + 1, 7) (m, wxyz).

        A recording does not hold them; they follow from its joints, and are within a micrometre
        of where the TCP was.
        """
        poses: dict[str, list[Floats]] = {arm: [] for arm in self.task.layout.arms}
        for t in range(len(columns) + 1):
            self.task.set_state_dict(state_row(columns.states, t))
            state = self.task.simulation.read()
            for arm, found in poses.items():
                found.append(state.tcp_pose(arm)[0].copy())
        return {arm: np.stack(found) for arm, found in poses.items()}

    def _joints(self, place: str, rows: Floats) -> Floats:
        # Column by column in memory, because statistics round by the order in which they add up.
        return np.asfortranarray(declared_joints(self.task.simulation.index, place, rows))

    def _checked(self, trajectory: Trajectory) -> States:
        states = trajectory.states
        if not states:
            raise TrajectoryError(
                f"episode {trajectory.episode_id} was recorded without states, which are what is"
                " exported; record it with env_states"
            )
        widths = {
            row_of(body): ROW + 2 * len(body.joints)
            for name, body in self._world.bodies.items()
            if body.joints or (name in self.bodies and body.part_of is None)
        }
        for place, key in self._keys.items():
            widths["articulations", key] = ROW + 2 * self._dof[place]
        for (kind, name), width in widths.items():
            rows = states.get(kind, {}).get(name)
            if rows is None or rows.shape[1] != width:
                found = "is missing" if rows is None else f"has {rows.shape[1]} numbers"
                raise TrajectoryError(
                    f"episode {trajectory.episode_id}: {kind}/{name} {found} in its states;"
                    f" {self.task.task_id} with these robots has {width} there"
                )
        judged = (trajectory.rewards is not None, trajectory.success is not None)
        self._judged = self._judged or judged
        if judged != self._judged:
            raise TrajectoryError(
                f"episode {trajectory.episode_id} and those before it do not both have rewards and"
                " success; export them apart"
            )
        return states


class DatasetWriter(AbstractContextManager["DatasetWriter", None]):
    """Writes episodes one after the other; the dataset is complete when the block ends."""

    def __init__(self, folder: Path, reader: ColumnReader, origin: Mapping[str, Any]) -> None:
        """Begin a dataset.

        Args:
            folder: An empty folder.
            reader: Names the columns.
            origin: What is kept of where the episodes come from; anything that json can hold.
        """
        self._folder, self._reader, self._origin = folder, reader, origin

    def __exit__(self, kind: object, error: BaseException | None, traceback: object) -> None:
        """Complete the dataset, unless there was an error, and let go of its files."""
        if error is not None:
            with suppress(OSError):  # of files that are incomplete anyway: the first error counts
                self._let_go()
            return
        try:
            self._complete()
        finally:
            self._let_go()

    @abstractmethod
    def add(self, columns: Columns, frames: Frames, watch: Watch, text: str | None) -> None:
        """Write one episode.

        Args:
            columns: The episode, of T steps.
            frames: The pictures of T moments, or of T + 1 where the dataset holds what is seen
                after a step, too; none without channels.
            watch: Called with the number of moments whose pictures are written.
            text: What is to be done in it, in words; None: what the whole dataset says, if it does.

        Raises:
            OSError: If it cannot be written.
        """

    @abstractmethod
    def note(self, about: Mapping[str, Any]) -> None:
        """Keep more about where the last episode comes from: numbers, flags or texts by name."""

    @abstractmethod
    def _complete(self) -> None:
        """Write what can only be written when all episodes are known."""

    @abstractmethod
    def _let_go(self) -> None:
        """Close every file."""


def action_names(robot: RobotDescriptor) -> list[str]:
    """Return the joint that each action number drives, or the group where it drives several.

    Where that would name two numbers alike, as those of a TCP, they are called as in
    `robots.ActionNumber`.
    """
    numbers = robot.describe_action()
    names = [n.joints[0] if len(n.joints) == 1 else n.group for n in numbers]
    return [
        number.name if names.count(name) > 1 else name
        for name, number in zip(names, numbers, strict=True)
    ]


def state_row(states: States, t: int) -> dict[str, dict[str, Floats]]:
    """Return the state dict after step ``t``, each entry (1, k); 0 is that after the reset."""
    return {
        kind: {name: rows[t : t + 1] for name, rows in entries.items()}
        for kind, entries in states.items()
    }


def succeeded(trajectory: Trajectory) -> bool:
    """Return whether the last step of an episode ended in success.

    Raises:
        TrajectoryError: If the recording does not say.
    """
    if trajectory.success is None:
        raise TrajectoryError(
            f"episode {trajectory.episode_id} does not say whether it succeeded; to export it all"
            " the same, take include_failures (--include-failures)"
        )
    return bool(trajectory.success[-1])


def _done(trajectory: Trajectory) -> Flags:
    done = np.zeros(len(trajectory.actions), np.bool_)
    for flags in (trajectory.terminated, trajectory.truncated):
        if flags is not None:
            done |= flags
    done[-1] = True
    return done


def _acted(source: Mapping[str, Any] | None) -> list[dict[str, Any]]:
    """Return who acted in an episode; experts say it in the header alone."""
    if source is None:
        return [{"kind": EXPERT}]
    said: list[Mapping[str, Any]] = source.get("actors") or [source.get("corrects") or source]
    return [{name: actor[name] for name in _ACTOR if name in actor} for actor in said]

"""An episode that people steer step by step, take back in part, and keep or discard."""

from __future__ import annotations

from collections.abc import Callable, Generator
from contextlib import contextmanager
from copy import deepcopy
from dataclasses import replace
from enum import Enum
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray

from robot_layouts.core.bounds import expect_unit
from robot_layouts.core.catalogue import reason
from robot_layouts.data.actors import PERSON, Actor, actor_of, episode_source
from robot_layouts.data.playing.policies import check_policy, playing
from robot_layouts.data.recording.recorder import Recorder
from robot_layouts.data.teleop.steering import Steering
from robot_layouts.kinematics.rotations import Floats, multiply, quaternion_about
from robots import RecordingError, TaskError, UnknownNameError
from tasks import TaskEnv
from tasks.engine.outcome import solved
from tasks.episode import REBUILT, PlayedEpisode, Policy, play

SOMEBODY = Actor(PERSON, "browser")


class Phase(Enum):
    """Where an episode is."""

    READY = "ready"
    RUNNING = "running"
    STOPPED = "stopped"


class _Moment(NamedTuple):
    """What people asked for at a step."""

    targets: dict[str, Floats]
    closed: dict[str, bool]
    reference: Floats
    by_hand: bool


class Session:
    """Steers a task with one environment; needs no browser, and is used by one thread.

    An episode begins with the reset of its seed in a freshly built world. What goes back to an
    earlier moment, and what is kept, is played from there once more: actions and seed are all
    that an episode follows from.

    Attributes:
        task: The task.
        seed: Seed of the episode.
        phase: Whether it has begun, and whether it goes on.
        actions: What has been done in it, each (A,).
        success: Whether the task is solved now.
        observation: What the task last returned.
        targets: By arm, where its TCP is to be: position (m, world), quaternion (wxyz), (7,).
        closed: By arm, whether its gripper is to be closed.
        by_hand: Whether people steer; else the policy does.
        on_replay: Called with the number of steps played again, and how many there are.
        kept: Seeds of the episodes kept so far, by whether they were solved.
    """

    def __init__(
        self,
        task: TaskEnv,
        recorder: Recorder | None = None,
        seed: int = 0,
        *,
        policy: Policy | None = None,
        policy_name: str | None = None,
    ) -> None:
        """Begin an episode.

        Args:
            task: A task with one environment.
            recorder: Where episodes are kept; None if they are only returned.
            seed: Of the first episode, or of one of the next if that is recorded already.
            policy: Acts until a person takes over; each episode has a copy as it was passed.
            policy_name: Where it was imported from, ``module:name``; None: where it is defined.

        Raises:
            TaskError: If the task has several environments, no arm can be steered, or the policy
                cannot be copied.
        """
        self.task, self._recorder = task, recorder
        self._passed = None if policy is None else playing(check_policy(policy), task)
        self._actors = [SOMEBODY]
        if policy is not None:
            self._actors.insert(0, actor_of(policy, policy_name))
        self.on_replay: Callable[[int, int], None] = lambda done, steps: None
        self.kept: dict[int, bool] = {}
        self._begin(self._free_seed(seed))

    @property
    def arms(self) -> tuple[str, ...]:
        """Names of the arms that can be steered, as the task calls them."""
        return self.steering.arms

    @property
    def seconds(self) -> float:
        """Time from one step to the next (s)."""
        return 1 / self.task.scenario.control_frequency

    def aim(self, arm: str, pose: ArrayLike) -> None:
        """Say where the TCP of an arm is to be.

        Args:
            arm: Its name.
            pose: Position (m, world), then quaternion (wxyz), (7,).

        Raises:
            UnknownNameError: If no arm of that name can be steered.
            TaskError: If the pose is invalid.
        """
        self._check(arm)
        pose = np.array(pose, float)
        if pose.shape != (7,) or not np.isfinite(pose).all():
            raise TaskError(f"a pose is 7 finite numbers; {arm} was given {pose.tolist()}")
        expect_unit(f"the quaternion for {arm}", pose[3:].tolist(), TaskError)
        self.targets[arm] = pose

    def shift(self, arm: str, way: ArrayLike | None = None, turn: ArrayLike | None = None) -> None:
        """Move and turn the place where the TCP of an arm is to be.

        Args:
            arm: Its name.
            way: By how much to move it, (3,) (m, world); None: not at all.
            turn: Axis in the world by whose length to turn it, (3,) (rad); None: not at all.

        Raises:
            UnknownNameError: If no arm of that name can be steered.
            TaskError: If it is invalid.
        """
        self._check(arm)
        pose = self.targets[arm].copy()
        if way is not None:
            pose[:3] += way
        if turn is not None and (angle := float(np.linalg.norm(turn))):
            axis = (np.array(turn, float) / angle).tolist()
            pose[3:] = multiply(quaternion_about(axis, angle), pose[3:])
            pose[3:] /= np.linalg.norm(pose[3:])
        self.aim(arm, pose)

    def let_go(self, arm: str) -> None:
        """Let an arm stay where it is.

        Raises:
            UnknownNameError: If no arm of that name can be steered.
        """
        self._check(arm)
        self.targets[arm] = self.steering.tcp(arm)

    def grip(self, arm: str, closed: bool) -> None:
        """Close or open the gripper of an arm; of one that has none, nothing happens.

        Raises:
            UnknownNameError: If no arm of that name can be steered.
        """
        self._check(arm)
        self.closed[arm] = closed

    def start(self) -> None:
        """Let the episode go on."""
        self.phase = Phase.RUNNING

    def stop(self) -> None:
        """Let it stand still."""
        if self.phase is Phase.RUNNING:
            self.phase = Phase.STOPPED

    def step(self) -> None:
        """Take one control step towards what people ask for.

        Raises:
            TaskError: If the policy fails, or its action is invalid; nothing is done then.
        """
        targets = {arm: pose.copy() for arm, pose in self.targets.items()}
        reference = self.steering.reference.copy()
        moment = _Moment(targets, dict(self.closed), reference, self.by_hand)
        action = self.steering.action(targets, self.closed) if self.by_hand else self._advised()
        self._do(action)
        if not self.by_hand:
            self.targets = {arm: self.steering.tcp(arm) for arm in self.arms}
        self._moments.append(moment)
        self.actions.append(action)
        self._successes.append(self.success)

    def take_over(self) -> None:
        """Let people steer from where the policy has brought the arms."""
        if not self.by_hand:
            self.by_hand = True
            self.steering.begin_anew()
            self.targets = {arm: self.steering.tcp(arm) for arm in self.arms}
            if self.actions:
                self.closed = self.steering.closed(self.actions[-1])

    def give_back(self) -> None:
        """Let the policy act again.

        Raises:
            TaskError: If there is no policy.
        """
        if self._passed is None:
            raise TaskError("there is no policy to give the arms to")
        self.by_hand = False

    @property
    def has_policy(self) -> bool:
        """Whether there is a policy that acts until a person takes over."""
        return self._passed is not None

    def undo(self, step: int) -> None:
        """Go back to an earlier moment of the episode, exactly, and stop there.

        The world is built and reset once more, and the steps up to that moment are played again.

        Args:
            step: How many steps of the episode stay.

        Raises:
            TaskError: If the episode has fewer.
        """
        if not 0 <= step <= len(self.actions):
            raise TaskError(f"the episode has steps 0 to {len(self.actions)}; there is no {step}")
        if step == len(self.actions):
            return self.stop()
        actions, moment = self.actions[:step], self._moments[step]
        moments, successes = self._moments[:step], self._successes[:step]
        self._begin(self.seed)
        for number, action in enumerate(actions, start=1):
            self._do(action)
            self.on_replay(number, len(actions))
        self.actions, self._moments, self._successes = actions, moments, successes
        self.phase = Phase.STOPPED if actions else Phase.READY
        self.targets = {arm: pose.copy() for arm, pose in moment.targets.items()}
        self.closed, self.steering.reference = dict(moment.closed), moment.reference.copy()
        self.by_hand = moment.by_hand

    def keep(self) -> PlayedEpisode:
        """Record the episode, and begin the next one.

        Returns:
            The episode, as it was played once more from its seed and actions.

        Raises:
            TaskError: If nothing has been done in it.
            RecordingError: If it cannot be written, or does not come out the same when it is played
                again; it goes on as it was.
        """
        if not self.actions:
            raise TaskError("there is nothing to keep: the episode has no steps yet")
        self.stop()
        episode = self._played_again()
        if self._recorder is not None:
            self._recorder.add(episode)
        self.kept[self.seed] = episode.solved
        self._begin(self._free_seed(self.seed + 1))
        return episode

    def discard(self) -> None:
        """Forget the episode, and begin it anew."""
        self._begin(self.seed)

    def skip(self) -> None:
        """Forget the episode, and begin that of the next seed."""
        self._begin(self._free_seed(self.seed + 1))

    # -- inside ------------------------------------------------------------------------------

    def _begin(self, seed: int) -> None:
        self.observation, _ = self.task.reset(seed, options=REBUILT)
        self.seed, self.phase, self.success = seed, Phase.READY, False
        with _errors_of_policy():
            self.by_hand, self._policy = self._passed is None, deepcopy(self._passed)
        self.actions: list[NDArray[np.float32]] = []
        self._moments: list[_Moment] = []
        self._successes: list[bool] = []
        self.steering = Steering(self.task)
        self.targets = {arm: self.steering.tcp(arm) for arm in self.arms}
        self.closed = dict.fromkeys(self.arms, False)

    def _do(self, action: NDArray[np.float32]) -> None:
        self.observation, _, _, _, info = self.task.step(action[None])
        self.success = bool(solved(info))

    def _advised(self) -> NDArray[np.float32]:
        """Return what the policy does."""
        assert self._policy is not None
        with _errors_of_policy(), torch.no_grad():
            action = np.asarray(self._policy(self.observation), np.float32)
        if action.size != self.task.layout.action_dim or not np.isfinite(action).all():
            raise TaskError(
                f"the policy gave an action of shape {action.shape}; it must be"
                f" {self.task.layout.action_dim} finite numbers"
            )
        return action.reshape(-1)

    def _played_again(self) -> PlayedEpisode:
        states, done = self.task.get_state_dict(), iter(range(len(self.actions) + 1))
        actions = np.array(self.actions, np.float32)
        watch = self.on_replay
        episode = play(self.task, self.seed, actions, lambda: watch(next(done), len(actions)))
        same = episode.success.tolist() == self._successes and all(
            np.array_equal(rows[-1], np.asarray(states[kind][name])[0])
            for kind, entries in episode.states.items()
            for name, rows in entries.items()
        )
        if not same:
            raise RecordingError(
                f"the episode of seed {self.seed} came out different when it was played again, so"
                " it is not kept: something else than seed and actions decides what happens"
            )
        turns = np.array([m.by_hand * (len(self._actors) - 1) for m in self._moments], np.uint8)
        source, actor = episode_source(self._actors, turns)
        return replace(episode, source=source, actor=actor)

    def _free_seed(self, seed: int) -> int:
        taken = self._recorder.seeds if self._recorder is not None else self.kept
        while seed in taken:
            seed += 1
        return seed

    def _check(self, arm: str) -> None:
        if arm not in self.targets:
            raise UnknownNameError("arm that can be steered", arm, self.targets)


@contextmanager
def _errors_of_policy() -> Generator[None]:
    """Say of whatever goes wrong in the user's own code that it was the policy's."""
    try:
        yield
    except (Exception, SystemExit) as error:
        raise TaskError(f"the policy failed: {reason(error)}") from error

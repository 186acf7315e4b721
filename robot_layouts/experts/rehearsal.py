"""Plays scripts, or closed loops in their place, in a private copy of a task."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary, ref

import numpy as np
from numpy.typing import NDArray

from robot_layouts.experts.framed import framed
from robot_layouts.experts.player import BlockedError, Player, StuckError
from robot_layouts.experts.script import Scene, Script
from robot_layouts.experts.touching import ArmWatch
from robot_layouts.experts.ways import Ways, without_planner
from robot_layouts.simulation.checks.overlaps import RobotsAlone
from robots import TaskError, UnknownNameError
from tasks import TaskEnv
from tasks.engine.actions import ActionReader
from tasks.episode import REBUILT, EpisodeTape, PlayedEpisode, take_step

IDLE = 100  # control steps after all of a script is done in which it may still succeed


@dataclass(frozen=True)
class Attempt:
    """The result of playing a script.

    Attributes:
        actions: Shape (T, A).
        success: Whether the task's own success was reached, at the last action.
        reason: Why not.
        obstructed: Whether it failed because something was in an arm's way.
        episode: What happened, if it was kept; see `Rehearsal.episode`.
    """

    actions: NDArray[np.float32]
    success: bool
    reason: str = ""
    obstructed: bool = False
    episode: PlayedEpisode | None = None


class Plan(NDArray[np.float32] if TYPE_CHECKING else np.ndarray):
    """Actions, (T, A) float32, and why they do not solve their episode.

    Attributes:
        reason: In words; empty if they do.
        episode: What happened when they were tried, if it was kept; see `rehearsed`.
        task: The task that they were planned for; None if it is gone.
    """

    reason: str = ""
    episode: PlayedEpisode | None = None
    task: Callable[[], TaskEnv | None] = staticmethod(lambda: None)

    @classmethod
    def of(cls, attempt: Attempt, task: TaskEnv) -> Plan:
        """Return the plan that an attempt at a task made."""
        plan = attempt.actions.view(cls)
        plan.reason, plan.episode, plan.task = attempt.reason, attempt.episode, ref(task)
        return plan


def rehearsed(task: TaskEnv, seed: int, actions: NDArray[np.float32]) -> PlayedEpisode | None:
    """Return the episode of a task that a plan's rehearsal was; None if it has to be played first.

    A rehearsal begins in a freshly built world, with the physics and rewards of the task that is
    planned for. So these actions, played there, would give the same states again, bit for bit.
    """
    if not isinstance(actions, Plan) or actions.episode is None or actions.task() is not task:
        return None
    same = actions.episode.seed == seed and np.array_equal(actions.episode.actions, actions)
    reason = "" if actions.episode.solved else actions.reason
    return replace(actions.episode, reason=reason) if same else None


class Rehearsal:
    """A private copy of a task, in which scripts are tried out from fresh worlds."""

    def __init__(self, task: TaskEnv) -> None:
        """Build one environment with layout, physics and rewards of ``task``, without pictures."""
        scenario = replace(
            task.scenario,
            num_envs=1,
            obs_mode="none",
            render_mode=None,
            check_layout=False,  # it was checked when the task was made
        )
        self.task = task.task_class(scenario)
        several = len(self.task.layout.arms) > 1
        self._watch = ArmWatch(self.task, strict=False) if several else None
        self._alone = RobotsAlone(self.task.layout, scenario.physics, simulator=scenario.simulator)
        self._tape: EpisodeTape | None = None
        self.fresh = False  # whether an episode has begun, in which nothing was done yet

    def begin(self, seed: int) -> Scene:
        """Start the episode of a seed in a freshly built world, and return what it looks like."""
        self.task.reset(seed, options=REBUILT)
        self._tape = EpisodeTape(self.task, seed)
        self.fresh = True
        return self.scene()

    def scene(self) -> Scene:
        """Return what the episode looks like now."""
        return Scene(self.task)

    def step(self, action: NDArray[np.float32]) -> tuple[bool, str]:
        """Take a control step.

        Returns:
            Whether the task is solved then, and in words why it cannot be any more: which arms
            touched in it, or that the task counts it as failed.
        """
        self.fresh = False
        moment = take_step(self.task, action)
        if self._tape is not None:
            self._tape.add(action, moment)
        touching = self._watch.touching() if self._watch is not None else []
        touched = ", ".join(f"{a} touches {b}" for a, b in touching[:1])
        return moment.success, touched or moment.failure

    def episode(self, actions: NDArray[np.float32]) -> PlayedEpisode | None:
        """Return what happened since `begin`, if it followed from these actions, (T, A), alone.

        That is, if `step` took all of them and no others, and the task's state was not set; else
        return None.
        """
        if self._tape is None or not len(actions) or not self._tape.unbroken:
            return None
        episode = self._tape.read()
        return episode if np.array_equal(episode.actions, actions) else None

    def play(
        self,
        script: Script,
        *,
        around: bool = False,
        careful: bool = False,
        until: str | None = None,
    ) -> Attempt:
        """Play a script from the present state until success, or `IDLE` steps after its end.

        It fails as soon as two arms touch, robots or limbs of one robot, or the task is lost.

        Args:
            script: Waypoints by robot; robots left out keep still.
            around: Whether arms go round what is in their way, or wait until it is gone. Otherwise
                their joints go straight to each waypoint.
            careful: Whether they come to rest at each pose before they go on.
            until: A waypoint, ``"robot.name"``; once it is done, that is success.

        Raises:
            MissingPackageError: If that takes the extra ``motion``, which is not installed.
            UnknownNameError: If the layout has no such robot, or the script no such waypoint.
            TaskError: If two waypoints of a robot have the same name.
        """
        task, scene = self.task, self.scene()
        _check_names(script, task)
        players = _players(task, script, scene, self._alone, careful)
        if around:
            ways = Ways(task)
            for player in players:
                player.look_around(ways, players)
        done: set[str] = set()
        actions: list[NDArray[np.float32]] = []
        number, idle = sum(map(len, script.values())), 0
        while len(actions) < task.max_episode_steps and idle < IDLE:
            try:
                parts = [player.act(scene, done) for player in players]
            except StuckError as error:
                blocked = isinstance(error, BlockedError)
                return Attempt(_stack(actions, task), False, str(error), blocked)
            if until in done:
                return Attempt(_stack(actions, task), True)
            idle += len(done) == number
            actions.append(np.concatenate(parts).astype(np.float32))
            solved, lost = self.step(actions[-1])
            scene = self.scene()
            if lost:
                return Attempt(_stack(actions, task), False, lost, True)
            if solved:
                return Attempt(_stack(actions, task), True)
        places = ", ".join(player.place for player in players)
        ended = "episode" if idle < IDLE else "script"
        return Attempt(_stack(actions, task), False, f"the {ended} ended at {places}")


# Making one takes as long as half an episode, and each episode begins in a world built anew.
_idle: WeakKeyDictionary[TaskEnv, Rehearsal] = WeakKeyDictionary()


@contextmanager
def rehearsing(task: TaskEnv) -> Generator[Rehearsal]:
    """Lend the private copy of a task, which lasts as long as the task does.

    One that is lent already, or was left by an error, is not lent again: another is made.
    """
    rehearsal = _idle.pop(task, None) or Rehearsal(task)
    yield rehearsal
    _idle[task] = rehearsal


def _players(
    task: TaskEnv, script: Script, scene: Scene, alone: RobotsAlone, careful: bool
) -> list[Player]:
    """Return who takes the action numbers, in their order, by the names that the script uses."""
    short = task.layout.short_names
    names = {short.get(name, name): name for name in script}
    return [
        Player(task, name, script.get(name, ()), scene, alone, careful)
        for name in (names.get(part, part) for part in task.layout.action_split)
    ]


def first_success(
    task: TaskEnv,
    seed: int,
    scripts: Callable[[Scene], Iterable[Script]],
    *,
    as_declared: bool = False,
) -> Plan:
    """Try scripts one after the other and return the actions of the first that succeeds.

    If none does, those in which arms touched, or something blocked one, are tried once more, with
    ways round what is in the way; that needs the extra ``motion``.

    Args:
        task: Says layout and physics; left alone.
        seed: The episode.
        scripts: Makes the scripts to try from the episode's first scene, the best first.
        as_declared: Whether they speak in the frame and the lengths of the task's declaration, as a
            task that ``fits_robots`` does itself, and not in the world's: scenes are like that, and
            so are the places that waypoints return.

    Returns:
        What `search` returns.

    Raises:
        TaskError: If no script could even be begun.
    """
    made = (
        scripts if not as_declared or task.task.fit.as_declared else framed(scripts, task.task.fit)
    )
    return search(task, seed, lambda copy: tried(copy, seed, made(copy.begin(seed))))


def tried(
    rehearsal: Rehearsal, seed: int, scripts: Iterable[Script | Attempt]
) -> Iterator[Attempt]:
    """Yield an attempt with each script in turn, then with ways round what was in the way.

    Last comes one with each script in which arms come to rest before they go on.

    Args:
        rehearsal: Where they are tried; each begins the episode anew.
        seed: The episode.
        scripts: The scripts, the best first; attempts that failed while they were looked for are
            yielded as they are.
    """
    obstructed, failed = list[Script](), list[Script]()
    for script in scripts:
        if isinstance(script, Attempt):
            yield script
            continue
        if not rehearsal.fresh:
            rehearsal.begin(seed)
        attempt = rehearsal.play(script)
        if not attempt.success and any(w.to for part in script.values() for w in part):
            failed.append(script)
        if attempt.obstructed:
            obstructed.append(script)
            attempt = replace(attempt, reason=attempt.reason + without_planner())
        yield attempt
    if without_planner():
        return
    for careful, again in ((False, obstructed), (True, failed)):
        for script in again:
            rehearsal.begin(seed)
            yield rehearsal.play(script, around=True, careful=careful)


def search(task: TaskEnv, seed: int, attempts: Callable[[Rehearsal], Iterable[Attempt]]) -> Plan:
    """Make attempts until one succeeds and return its actions.

    If none does, the actions of the longest attempt are returned: it got furthest.

    Args:
        task: Says layout and physics; left alone.
        seed: The episode.
        attempts: Makes them one by one, each in an episode begun anew.

    Returns:
        Actions (T, A) with T at most the task's ``max_episode_steps``, and the reason if they fail.

    Raises:
        TaskError: If no attempt could even be begun.
    """
    made: list[Attempt] = []
    with rehearsing(task) as rehearsal:
        for attempt in attempts(rehearsal):
            made.append(replace(attempt, episode=rehearsal.episode(attempt.actions)))
            if attempt.success:
                break
    best = max(made, key=lambda attempt: (attempt.success, len(attempt.actions)))
    if not len(best.actions):
        raise TaskError(f"no plan: {best.reason}")
    return Plan.of(best, task)


def rehearse(task: TaskEnv, seed: int, act: Callable[[Scene], Any]) -> Plan:
    """Let a function act in a private copy of a task until it succeeds or the episode ends.

    It also ends, and has failed, when two arms touch: robots, or limbs of one robot.

    Args:
        task: Says layout and physics; left alone.
        seed: The episode.
        act: Called before every step with what there is to see; returns the action, (A,), or a
            mapping robot name → (a,) with every robot.

    Returns:
        What it did, (T, A), and the reason if that fails.

    Raises:
        ActionError: If an action has the wrong shape or numbers that are not finite.
    """
    with rehearsing(task) as rehearsal:
        return Plan.of(_closed_loop(rehearsal, seed, act), task)


def _closed_loop(rehearsal: Rehearsal, seed: int, act: Callable[[Scene], Any]) -> Attempt:
    copy, scene = rehearsal.task, rehearsal.begin(seed)
    reader, actions = ActionReader(copy.layout, 1), list[NDArray[np.float32]]()
    success, lost = False, ""
    while not (success or lost) and len(actions) < copy.max_episode_steps:
        actions.append(reader.read(act(scene))[0].copy())
        success, lost = rehearsal.step(actions[-1])
        scene = rehearsal.scene()
    success = success and not lost
    reason = "" if success else lost or f"no success within {len(actions)} steps"
    done = np.stack(actions)
    return Attempt(done, success, reason, episode=rehearsal.episode(done))


def _stack(actions: list[NDArray[np.float32]], task: TaskEnv) -> NDArray[np.float32]:
    return np.array(actions, np.float32).reshape(-1, task.layout.action_dim)


def _check_names(script: Script, task: TaskEnv) -> None:
    for robot in script:
        if task.layout.arm_name(robot) not in task.layout.action_split:
            raise UnknownNameError("arm that takes numbers", robot, task.layout.places)
    names = [f"{robot}.{waypoint.name}" for robot in script for waypoint in script[robot]]
    for name in names:
        if names.count(name) > 1:
            raise TaskError(f"{names.count(name)} waypoints are called {name!r}; one may be")
    for waypoints in script.values():
        for name in (name for waypoint in waypoints for name in waypoint.after):
            if name not in names:
                raise UnknownNameError("waypoint of this script", name, names)

"""Records episodes that an expert, a policy or several in turn play; goes on where it stopped."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import torch

from robot_layouts.core.bounds import checked_whole
from robot_layouts.core.pages import plural
from robot_layouts.core.processes.start import WorkerError
from robot_layouts.core.processes.transport import as_ours
from robot_layouts.data.actors import (
    DESCRIPTION,
    EXPERT,
    PERSON,
    POLICY,
    TYPE,
    Actor,
    actor_of,
    combined,
    episode_source,
)
from robot_layouts.data.playing.executor import (
    Executor,
    checked_seeds,
    choose_executor,
    play_all,
    seed_lines,
    wait_lines,
)
from robot_layouts.data.playing.policies import check_policy, find_policy
from robot_layouts.data.playing.scheduler import EPISODE_SECONDS, Event, WorkersDied
from robot_layouts.data.playing.together import (
    BatchError,
    Cast,
    EpisodesJob,
    EpisodesPlay,
    grouped,
    one_by_one,
    record_together,
)
from robot_layouts.data.reading.json_files import FILE_SIZE
from robot_layouts.data.reading.provenance import describe_layout, differences, listing
from robot_layouts.data.reading.recording import FILE
from robot_layouts.data.recording.episode_files import PartEncoder
from robot_layouts.data.recording.recorder import Recorder
from robot_layouts.experts import find_expert
from robots import RecordingError, TaskError
from tasks import MultiRobotTask, TaskEnv
from tasks.episode import PlayedEpisode, Policy, Score
from tasks.registry import scenario_of

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from tasks.engine.scenario import MakingFields

FOLDER = Path("runs/recordings")  # of recordings, each in a folder called as its task
_TYPES = {EXPERT: "scripted", POLICY: "policy", PERSON: "human"}
LOST_IN_A_ROW = 10  # episodes that workers died of, and none that was played, until all ends


Recorded = tuple[Score, bytes]
"""How an episode went, and what is to be stored of it."""


@dataclass(frozen=True)
class Actors:
    """Who acts in the episodes of a recording.

    Attributes:
        actors: The policy, and who may take over.
        corrector: Who says what would have been right, or None.
    """

    actors: tuple[Actor, ...]
    corrector: Actor | None = None

    @staticmethod
    def cast(
        task: type[MultiRobotTask],
        policy: Policy | str,
        takeover: Policy | str | None,
        corrector: Policy | str | None,
    ) -> tuple[Cast, Actors]:
        """Return who plays, and who that is.

        Raises:
            TaskError: If the task has no expert, something cannot be imported or called, or
                a takeover or corrector is given for an expert.
            RecordingError: If a policy's file cannot be read.
        """
        if isinstance(policy, str) and policy == EXPERT:
            if not takeover is corrector is None:
                raise TaskError(
                    "an expert's plan is made for what it does itself; a takeover or a corrector"
                    " needs a policy"
                )
            expert = find_expert(task.task_id)
            module, name = (getattr(expert, n, "") for n in ("__module__", "__qualname__"))
            described = Actor(EXPERT, f"{module}:{name or expert}")
            return Cast(expert=expert, to_the_end=True), Actors((described,))
        acting, who = _found(policy, "policy")
        taking, taker = _found(takeover, "takeover")
        correcting, right = _found(corrector, "corrector")
        cast = Cast(acting, takeover=taking, corrector=correcting)
        return cast, Actors(tuple(actor for actor in (who, taker) if actor is not None), right)

    @property
    def header(self) -> dict[str, Any]:
        """What the recording says of all its episodes, as arguments of `Recorder`."""
        everyone = (*self.actors, *((self.corrector,) if self.corrector else ()))
        said = combined((_TYPES[actor.kind], actor.name) for actor in everyone)
        return {"source": said[TYPE] or "", "source_desc": said[DESCRIPTION]}

    def sign(self, episode: PlayedEpisode) -> PlayedEpisode:
        """Write into an episode who acted in it; an expert's says so in the header alone."""
        if self.actors[0].kind == EXPERT:
            return replace(episode, actor=None)
        turns = episode.actor
        assert turns is not None  # the player keeps them
        source, actor = episode_source(self.actors, turns, self.corrector)
        return replace(episode, source=source, actor=actor)


@dataclass(frozen=True)
class EpisodeJob(EpisodesJob):
    """Episodes that are recorded.

    Attributes:
        actors: Who plays, as the recording keeps it.
        encoder: What encodes finished episodes.
        observed: Whether what is observed is recorded.
    """

    actors: Actors
    encoder: PartEncoder
    observed: bool = False

    def __call__(self) -> Callable[[int], dict[int, Recorded | str]]:
        """Make the task in a worker, and return what plays and encodes the episodes of seeds.

        Raises:
            RecordingError: If the robot files of this machine are not those of the recording.
        """
        return _RecordingPlay(self)


class _RecordingPlay(EpisodesPlay[EpisodeJob]):
    """Plays episodes, and encodes them."""

    def __init__(self, job: EpisodeJob) -> None:
        super().__init__(job)
        here = describe_layout(self._env.layout)
        if found := differences(job.encoder.header["layout"], here):
            raise RecordingError(
                f"a worker would record something else than this recording is of ({listing(found)})"
            )

    def __call__(self, seed: int) -> dict[int, Recorded | str]:
        """Play and encode the episodes of a seed and of those that are played together with it.

        Returns:
            How each went, or in words why it could not be played.
        """
        seeds = self._job.together[seed]
        try:
            return self._play(seeds)
        except BatchError:
            raise
        except Exception:
            if len(seeds) == 1:
                raise
        return {seed: self._alone(seed) for seed in seeds}  # one of them must not cost the others

    def _play(self, seeds: Sequence[int]) -> dict[int, Recorded | str]:
        players = [self._casting(seed) for seed in seeds]
        with torch.no_grad():
            episodes = record_together(self._env, players, observed=self._job.observed)
        return {
            player.seed: (player.score, self._job.encoder.encode(self._job.actors.sign(episode)))
            for player, episode in zip(players, episodes, strict=True)
        }

    def _alone(self, seed: int) -> Recorded | str:
        try:
            return self._play([seed])[seed]
        except Exception as error:
            return str(as_ours(error))


@dataclass
class Summary:
    """The result of a recording.

    Attributes:
        folder: Where the recording is. The summary itself is a path, too: that of this folder.
        recorded: Episodes in the file in the end.
        already: How many of those asked for were there before.
        damaged: Episodes that were there before and are damaged, in words.
        played: Episodes played this time, by seed.
        failed: Why an episode could not be played, by seed: it raised an error, or its workers
            died, each time that it was tried.
        deaths: Workers that died, in words.
        workers: Who played, in words.
    """

    folder: Path
    recorded: int = 0
    already: int = 0
    damaged: list[str] = field(default_factory=list[str])
    played: dict[int, Score] = field(default_factory=dict[int, Score])
    failed: dict[int, Exception] = field(default_factory=dict[int, Exception])
    deaths: list[str] = field(default_factory=list[str])
    workers: set[str] = field(default_factory=set[str])

    @property
    def path(self) -> Path:
        """The first h5 file."""
        return self.folder / FILE

    def __fspath__(self) -> str:
        """Return the recording's folder."""
        return str(self.folder)

    def __str__(self) -> str:
        """Say in a few lines what was recorded and what was not."""
        played = self.played.values()
        lines = [f"{self.path}: {plural(self.recorded, 'episode')}"]
        if played:
            solved = sum(score.success for score in played)
            steps = sum(score.steps for score in played) / len(played)
            new = plural(len(played), "new episode")
            lines.append(f"{new}, {solved} with success, {steps:.1f} steps on average")
            if len(self.workers) > 1:
                lines.append(f"played by {len(self.workers)} workers")
        failed = {seed: score.reason for seed, score in self.played.items() if not score.success}
        reasons = {seed: str(error) for seed, error in sorted(self.failed.items())}
        return "\n".join(
            [
                *lines,
                *wait_lines([wait for score in played for wait in score.waits]),
                *seed_lines("no success", dict(sorted(failed.items()))),
                *(f"replaced: {death}" for death in self.deaths),
                *seed_lines("not recorded", reasons),
            ]
        )


def record(
    task: str | TaskEnv,
    seeds: Sequence[int] | None = None,
    folder: str | PathLike[str] | None = None,
    executor: Executor | None = None,
    *,
    episodes: int | None = None,
    workers: int | None = None,
    episode_timeout: float | None = EPISODE_SECONDS,
    policy: Policy | str = EXPERT,
    takeover: Policy | str | None = None,
    corrector: Policy | str | None = None,
    num_envs: int = 1,
    observations: bool | None = None,
    file_size: float = FILE_SIZE,
    on_event: Callable[[Summary, Event | None], None] = lambda summary, event: None,
    **making: Unpack[MakingFields],
) -> Summary:
    """Record the episodes of some seeds; those that are in the folder already are kept.

    Args:
        task: Id of the task, or an environment of it, as which every episode is made.
        seeds: Which episodes.
        folder: Where ``trajectory.h5`` and ``trajectory.json`` are written; by default
            ``runs/recordings/TASK``.
        executor: Who plays, such as `RayExecutor`; None: processes of this machine.
        episodes: How many episodes, instead of ``seeds``: those of seeds 0, 1, 2, …
        workers: How many processes; None: one for each core that this process may use; 0: none,
            but this one.
        episode_timeout: Seconds that an episode may take in a worker until that is ended and the
            episode played again, three times in all; None if it may take for ever. An episode that
            ends its worker each time is left out, with those that are played at once with it, and
            tried again by the next recording.
        policy: ``"expert"``, whose plan for each seed is carried out to its end, or who acts at
            every step: maps the observation, (1, D) float32 if ``obs_mode`` is ``"state"``, to the
            action, (A,) or (1, A); an episode ends with the first step that is terminated or
            truncated. Or ``"module:name"``, which is imported. As in `evaluate`, a copy
            plays each episode, and the random generators of Python, NumPy and torch start from
            its seed. Or ``"ws://host:port"``, where one is served; see
            `robot_layouts.data.playing.served.policy.ServedPolicy`. Or ``"hub:OWNER/NAME"``; see
            `robot_layouts.data.playing.shared_policy`.
        takeover: May act in the place of the policy, at any step: maps the observation to an
            action, or to None, which lets the policy act. The policy is asked at every step. Or
            ``"module:name"``.
        corrector: Asked at every step what it would do: maps the observation to an action, which
            is recorded beside the one that is carried out. Or ``"module:name"``.
        num_envs: How many episodes each process plays at once, in environments of one task. What
            is recorded is the same, and so it is with a policy whose attribute ``batched`` is True
            if each row of its actions follows from that row of the observations alone; see
            `robot_layouts.data.evaluate`.
        observations: Whether to record what is observed, by ``obs_mode``, after the reset and after
            every step, as ManiSkill does; None: if ``obs_mode`` is given.
        file_size: Size at which a further h5 file is begun (MB); see `Recorder`.
        on_event: Called once at the start without an event, and after every event.
        making: Arguments of `tasks.make`, such as ``layout``, ``robots`` and ``control_mode``, if
            ``task`` is an id. ``obs_mode`` is what policies observe.

    Returns:
        What was recorded. It stands for the folder wherever a path does: ``Recording(summary)``.

    Raises:
        UnknownNameError: If the task, a place, a robot or a field is unknown.
        TaskError: If the task has no expert or cannot be made like that, a policy cannot be
            imported or called, a number is out of range, a seed is given twice, or not exactly one
            of ``seeds`` and ``episodes`` is given.
        RecordingError: If the folder cannot be written or holds a recording of something else, or
            a policy's file cannot be read; the finished episodes are kept.
        WorkerError: If workers cannot be started, die of ten episodes in a row, or end before all
            is played; they are kept, too.
        KeyboardInterrupt: If interrupted; they are kept, too.
    """
    executor = choose_executor(workers, executor, episode_timeout)
    if seeds is not None and episodes is None:
        seeds = checked_seeds(seeds)
    elif seeds is None and episodes is not None:
        seeds = tuple(range(checked_whole("episodes", episodes, 1, None, TaskError)))
    else:
        raise TaskError("give either seeds or episodes: seeds=range(10, 20), or episodes=10")
    cls, scenario = scenario_of(task, **making)
    checked_whole("num_envs", num_envs, 1, None, TaskError)
    cast, actors = Actors.cast(cls, policy, takeover, corrector)
    env = cls(scenario)
    observed = "obs_mode" in making if observations is None else observations
    summary = Summary(FOLDER / cls.task_id if folder is None else Path(folder))
    recorder = Recorder(
        summary.path, env, resume=True, file_size=file_size, observed=observed, **actors.header
    )
    with recorder:
        env.close()
        summary.damaged, there = recorder.damaged, recorder.seeds
        missing = [seed for seed in seeds if seed not in there]
        summary.already, summary.recorded = len(seeds) - len(missing), len(there)
        on_event(summary, None)
        recorder.expect(missing)
        together = grouped(missing, num_envs)
        at_once = replace(scenario, num_envs=max(map(len, together.values()), default=1))
        job = EpisodeJob(cls, at_once, cast, together, actors, recorder.encoder, observed)
        try:
            with closing(play_all(executor, job, list(together))) as events:
                for event in _of_episodes(events, together):
                    _note(summary, event, recorder)
                    on_event(summary, event)
        finally:  # an interrupt may come between writing and counting
            summary.recorded = len(recorder)
    return summary


def _of_episodes(events: Iterable[Event], together: Mapping[int, Sequence[int]]) -> Iterator[Event]:
    """Yield an event for each episode, as long as not one after the other ends its workers."""
    lost = 0
    for event in events:
        yield from _one_by_one(event, together)
        if event.result is not None:
            lost = 0
        elif isinstance(event.error, WorkersDied):
            lost += 1
            if lost == LOST_IN_A_ROW:
                raise event.error


def _one_by_one(event: Event, together: Mapping[int, Sequence[int]]) -> list[Event]:
    """Return an event for each episode if it is of episodes that were played at once."""
    if event.error is not None and event.seed is not None:
        return [replace(event, seed=seed) for seed in together[event.seed]]
    return [
        replace(single, result=None, error=WorkerError(single.result))
        if isinstance(single.result, str)
        else single
        for single in one_by_one(event)
    ]


def _note(summary: Summary, event: Event, recorder: Recorder) -> None:
    if event.died is not None:
        summary.deaths.append(event.death)
    elif event.error is not None and event.seed is not None:
        summary.failed[event.seed] = event.error
        recorder.give_up(event.seed)
    elif event.result is not None and event.seed is not None:
        played, part = event.result
        recorder.store(event.seed, part)
        summary.played[event.seed] = played
        summary.recorded += 1
        summary.workers.add(event.worker)


def _found(policy: Policy | str | None, what: str) -> tuple[Any, Actor | None]:
    """Return what is named or given, and who it is."""
    if policy is None:
        return None, None
    name = policy if isinstance(policy, str) else None
    found = check_policy(policy if name is None else find_policy(name, what), what)
    return found, actor_of(found, name)

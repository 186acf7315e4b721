"""Who plays the episodes of a recording, to be sent to workers and to be kept in each episode."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, TypedDict

from experts import find_expert
from robots import TaskError
from rollouts.playing.casting import Cast
from rollouts.sources import actors as kinds
from rollouts.sources.actors import Actor, actor_of, episode_source
from rollouts.sources.header import DESCRIPTION, TYPE, combined
from rollouts.sources.policies import EXPERT, check_policy, find_policy
from tasks import MultiRobotTask
from tasks.episode import PlayedEpisode, Policy

_TYPES = {kinds.EXPERT: "scripted", kinds.POLICY: "policy", kinds.PERSON: "human"}


class Header(TypedDict):
    """Arguments of `rollouts.recording.recorder.Recorder`."""

    source: str
    source_desc: str | None


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
                somebody is to take over from an expert, who does not look.
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
            described = Actor(kinds.EXPERT, f"{module}:{name or expert}")
            return Cast(expert=expert, to_the_end=True), Actors((described,))
        acting, who = _found(policy, "policy")
        taking, taker = _found(takeover, "takeover")
        correcting, right = _found(corrector, "corrector")
        cast = Cast(acting, takeover=taking, corrector=correcting)
        return cast, Actors(tuple(actor for actor in (who, taker) if actor is not None), right)

    @property
    def header(self) -> Header:
        """What the recording says of all its episodes."""
        everyone = (*self.actors, *((self.corrector,) if self.corrector else ()))
        said = combined((_TYPES[actor.kind], actor.name) for actor in everyone)
        return {"source": said[TYPE] or "", "source_desc": said[DESCRIPTION]}

    def sign(self, episode: PlayedEpisode) -> PlayedEpisode:
        """Write into an episode who acted in it; an expert's says so in the header alone."""
        if self.actors[0].kind == kinds.EXPERT:
            return replace(episode, actor=None)
        turns = episode.actor
        assert turns is not None  # whoever plays keeps them
        source, actor = episode_source(self.actors, turns, self.corrector)
        return replace(episode, source=source, actor=actor)


def _found(policy: Policy | str | None, what: str) -> tuple[Any, Actor | None]:
    """Return what is named or given, and who it is."""
    if policy is None:
        return None, None
    name = policy if isinstance(policy, str) else None
    found = check_policy(policy if name is None else find_policy(name, what), what)
    return found, actor_of(found, name)

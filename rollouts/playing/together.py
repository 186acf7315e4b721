"""Plays the episodes of several seeds in one task, each as if it were alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import fsum
from typing import Any

import numpy as np
import torch

from robots import TaskError
from rollouts.playing.randomness import random_states, set_random_states
from tasks import MultiRobotTask
from tasks.engine.actions import ActionReader
from tasks.episode import REBUILT, Policy, Score


@dataclass
class Player:
    """Who plays the episode of a seed.

    Attributes:
        seed: The seed.
        policy: Who acts.
        most: Steps after which the episode ends.
        states: Where the random generators are when it acts.
        reason: Why it can but fail, if that is known.
        rewards: Of the steps so far.
        success: Whether the last one was a success.
    """

    seed: int
    policy: Policy
    most: int
    states: tuple[Any, ...]
    reason: str = ""
    rewards: list[float] = field(default_factory=list[float])
    success: bool = False

    @property
    def score(self) -> Score:
        """How its episode went."""
        reason = "" if self.success else self.reason
        return Score(self.success, fsum(self.rewards), len(self.rewards), reason)


def play_together(env: MultiRobotTask, players: Sequence[Player]) -> None:
    """Play an episode for each player, from freshly built worlds, until all are over.

    Every player sees its own environment alone, and draws from generators that are its own, so
    that nothing depends on who plays beside it. One that is marked as `batched` is called once
    for all of them.

    Args:
        env: The task, with at least as many environments as players.
        players: Who plays; it is noted in them what comes of it.

    Raises:
        TaskError: If the actions of a batched policy are not one for each environment.
        ActionError: If an action has the wrong shape or numbers that are not finite.
    """
    ids = list(range(len(players)))
    observation, _ = env.reset([player.seed for player in players], REBUILT, ids)
    reader = ActionReader(env.layout, 1)
    actions = np.zeros((env.num_envs, env.layout.action_dim), np.float32)
    running = [i for i in ids if players[i].most > 0]
    while running:
        act = _act_at_once if is_batched(players[0].policy) else _act
        for i, action in act(players, running, observation).items():
            actions[i] = reader.read(action)[0]
        everywhere = len(running) == env.num_envs
        observation, rewards, terminated, truncated, info = env.step(
            actions, None if everywhere else running
        )
        over = (terminated | truncated).tolist()
        for i in running:
            players[i].rewards.append(rewards[i].item())
            players[i].success = bool(info["success"][i])
        running = [i for i in running if not over[i] and len(players[i].rewards) < players[i].most]


def is_batched(policy: object) -> bool:
    """Return whether a policy says that it takes many observations at once, by ``batched``."""
    return getattr(policy, "batched", False) is True


def _act(players: Sequence[Player], running: Sequence[int], observation: Any) -> dict[int, Any]:
    actions: dict[int, Any] = {}
    for i in running:
        player = players[i]
        if len(players) > 1:
            set_random_states(player.states)
        actions[i] = player.policy(_rows(observation, [i]))
        if len(players) > 1:
            player.states = random_states()
    return actions


def _act_at_once(
    players: Sequence[Player], running: Sequence[int], observation: Any
) -> dict[int, Any]:
    actions = players[0].policy(_rows(observation, running))
    if len(actions) != len(running):
        raise TaskError(
            f"a batched policy returned {len(actions)} actions for {len(running)} observations"
        )
    return dict(zip(running, actions, strict=True))


def _rows(tree: Any, rows: Sequence[int]) -> Any:
    """Return rows of an observation, in memory of their own, as if there were no others."""
    if isinstance(tree, dict):
        return {key: _rows(value, rows) for key, value in tree.items()}
    return tree[torch.tensor(rows)]

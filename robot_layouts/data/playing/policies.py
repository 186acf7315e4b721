"""Policies by name: of modules, addresses of servers, on the Hub, and the word for an expert."""

from __future__ import annotations

from typing import Any

from robot_layouts.core.importing import imported
from robot_layouts.data.actors import EXPERT
from robot_layouts.data.playing.served.client import PolicyClient
from robot_layouts.data.playing.served.policy import ServedPolicy, is_address
from robot_layouts.data.playing.shared_policy import SharedPolicy, hub_policy
from robot_layouts.data.reading.hub import on_hub
from robots import TaskError
from tasks import TaskEnv


def find_policy(name: str, what: str = "policy") -> Any:
    """Return what a name stands for.

    Args:
        name: ``MODULE:NAME``, which is imported; ``ws://HOST:PORT``, a `ServedPolicy`;
            ``hub:OWNER/NAME[@REVISION]``, a `SharedPolicy`; or the word ``"expert"``, which is
            returned as it is.
        what: What is looked for, in a word that an error uses.

    Raises:
        TaskError: If it cannot be imported, the address is invalid, or it is no policy.
        HubError: If it cannot be downloaded.
    """
    if name == EXPERT and what == "policy":
        return name
    if is_address(name):
        return ServedPolicy(name)
    if on_hub(name):
        return hub_policy(name)
    module, _, attribute = name.partition(":")
    if not module or not attribute:
        expert = what == "policy"
        others = f", something callable, or the word {EXPERT!r}" if expert else " or callable"
        known = "MODULE:NAME, ws://HOST:PORT, hub:OWNER/NAME"
        raise TaskError(f"{what} is {name!r}; it must be {known}{others}")
    return check_policy(imported(name, what, TaskError), what)


def check_policy(policy: Any, what: str = "policy") -> Any:
    """Return what gives actions, or refuse what cannot.

    Raises:
        TaskError: If it is not callable, or a class.
    """
    if isinstance(policy, ServedPolicy):
        return policy
    if isinstance(policy, type):
        raise TaskError(
            f"{what} is the class {policy.__qualname__}; give an instance of it, such as"
            f" {policy.__qualname__}()"
        )
    if not callable(policy):
        word = f", or the word {EXPERT!r}" if what == "policy" else ""
        raise TaskError(f"{what} is {policy!r}; it must be callable, obs → action{word}")
    return policy


def playing(policy: Any, task: TaskEnv) -> Any:
    """Return what acts in a task: of a served policy, what asks its server; else the policy.

    Raises:
        TaskError: If what the server is to be sent, or a policy from the Hub, does not fit the
            task.
    """
    return policy.playing(task) if isinstance(policy, (ServedPolicy, SharedPolicy)) else policy


def waits_of(policy: Any) -> tuple[float, ...]:
    """Return how long each answer of a policy's server took (s); of other policies, nothing."""
    return tuple(policy.waits) if isinstance(policy, PolicyClient) else ()


def close_served(policy: Any) -> None:
    """Close the connection of a policy that is served."""
    if isinstance(policy, PolicyClient):
        policy.close()

"""Policies by name: ``module:name``, imported from a module of the user's own."""

from __future__ import annotations

from typing import Any

from robot_layouts.core.importing import imported
from robots import TaskError

EXPERT = "expert"


def find_policy(name: str, what: str = "policy") -> Any:
    """Return what ``MODULE:NAME`` names, or the word ``"expert"`` as it is.

    Args:
        name: The name.
        what: What is looked for, in a word that an error uses.

    Raises:
        TaskError: If it cannot be imported.
    """
    if name == EXPERT and what == "policy":
        return name
    module, _, attribute = name.partition(":")
    if not module or not attribute:
        word = f", or the word {EXPERT!r}" if what == "policy" else ""
        raise TaskError(f"{what} is {name!r}; it must be MODULE:NAME, something callable{word}")
    return check_policy(imported(name, what, TaskError), what)


def check_policy(policy: Any, what: str = "policy") -> Any:
    """Return what gives actions, or refuse what cannot.

    Raises:
        TaskError: If it is not callable, or a class.
    """
    if isinstance(policy, type):
        raise TaskError(
            f"{what} is the class {policy.__qualname__}; give an instance of it, such as"
            f" {policy.__qualname__}()"
        )
    if not callable(policy):
        word = f", or the word {EXPERT!r}" if what == "policy" else ""
        raise TaskError(f"{what} is {policy!r}; it must be callable, obs → action{word}")
    return policy

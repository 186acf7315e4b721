"""Policies by name: ``module:name``, imported from a module of the user's own."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from robots import TaskError, closest_match
from robots.common.catalogue import reason
from robots.common.rooms import ROOMS

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
    try:
        found: Any = import_module(module)
        for part in attribute.split("."):
            if not hasattr(found, part):
                raise TaskError(_lacks(found, module, part))
            found = getattr(found, part)
    except (Exception, SystemExit) as error:  # whatever the user's own code does
        raise TaskError(f"no {what} {name!r}: {reason(error)}") from error
    return check_policy(found, what)


def _lacks(found: Any, module: str, attribute: str) -> str:
    """Say that a module has no such attribute, and why that may be."""
    words = f"module {module!r} has no attribute {attribute!r}"
    if (package := module.partition(".")[0]) in ROOMS:
        return f"{words}; {package!r} is a package of this library: rename a module of yours"
    match = closest_match(attribute, dir(found))
    return f"{words}. Did you mean {match!r}?" if match else words


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

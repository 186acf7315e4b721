"""The error of a module that is asked for a name that it does not have."""

from __future__ import annotations

from collections.abc import Iterable

from robot_layouts.core.errors import closest_match


def missing_name(module: str, name: str, names: Iterable[str]) -> AttributeError:
    """Return what a module's ``__getattr__`` raises for a name that is missing.

    Args:
        module: The module.
        name: What it was asked for.
        names: What it has.
    """
    names = sorted(names)
    match = closest_match(name, names)
    suggestion = f" Did you mean {match!r}?" if match else ""
    return AttributeError(f"{module} has no {name!r}.{suggestion} It has {', '.join(names)}.")

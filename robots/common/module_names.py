"""What a module answers to whoever asks it for a name that it does not have."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from dis import opname

from robots.common.errors import closest_match


def missing_name(module: str, name: str, names: Iterable[str]) -> AttributeError | ImportError:
    """Return what a module's ``__getattr__`` raises, which calls this, for a name that is missing.

    ``from module import name`` turns an `AttributeError` into an `ImportError` without these words;
    that statement gets an `ImportError` with them.

    Args:
        module: The module.
        name: What it was asked for.
        names: What it has.
    """
    if name.startswith("_"):  # Python itself asks for these, and often
        return AttributeError(f"module {module!r} has no attribute {name!r}")
    names = sorted(names)
    match = closest_match(name, names)
    suggestion = f" Did you mean {match!r}?" if match else ""
    words = f"{module} has no {name!r}.{suggestion} It has {', '.join(names)}."
    asking = sys._getframe(2)  # pyright: ignore[reportPrivateUsage]
    if opname[asking.f_code.co_code[asking.f_lasti]] == "IMPORT_FROM":
        return ImportError(words, name=module)
    return AttributeError(words, name=name)

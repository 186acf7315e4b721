"""What holds worlds cannot be copied; a copy is another one, made with the same arguments."""

from __future__ import annotations

from typing import Any, TypeVar

_Self = TypeVar("_Self", bound="Remade")


class Remade:
    """Something whose copies, and what is unpickled, are made anew with the same arguments.

    They begin their own episodes, and each is to be closed for itself. What Gymnasium noted about
    the environment, its ``spec``, is theirs as well.
    """

    _arguments: tuple[tuple[Any, ...], dict[str, Any]]

    def __new__(cls: type[_Self], *args: Any, **kwargs: Any) -> _Self:
        """Note the arguments."""
        self = object.__new__(cls)
        self._arguments = args, kwargs
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        """Say how to make another one."""
        spec = vars(self).get("spec")
        return _make, (type(self), *self._arguments), None if spec is None else {"spec": spec}


def _make(cls: type[Remade], args: tuple[Any, ...], kwargs: dict[str, Any]) -> Remade:
    return cls(*args, **kwargs)

"""Things known by name: built in, registered in this process, or brought by other packages."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from importlib import import_module, metadata
from typing import TypeVar

from robot_layouts.core.errors import RobotLayoutsError, UnknownNameError

Value = TypeVar("Value")


class Catalogue(Mapping[str, Value]):
    """A mapping from names to things, each of which is loaded only when it is looked up.

    A name is looked for among the things registered in this process, then among those built in,
    then among the entry points of installed packages.

    Attributes:
        kind: What it holds, in the singular (``"robot"``).
        lines: What is built in: name → ``"module:attribute"``.
        registered: What was registered in this process, by name.
        aliases: Other names, as they are compared, and the name that each stands for.
    """

    def __init__(
        self,
        kind: str,
        lines: Mapping[str, str],
        *,
        group: str,
        check: Callable[[object, str, str], Value],
        error: type[RobotLayoutsError],
        aliases: Mapping[str, str] | None = None,
        ignore_case: bool = False,
        hint: str = "",
    ) -> None:
        """Declare what is built in; nothing is imported.

        Args:
            kind: What it holds, in the singular.
            lines: Name → ``"module:attribute"``.
            group: Entry-point group through which other packages bring more.
            check: Called with what an entry point gave, the entry point in words, and its name;
                returns the thing or raises.
            error: Raised if a thing of another package cannot be loaded.
            aliases: Other name → name.
            ignore_case: Whether ``"PANDA"`` finds ``"panda"``.
            hint: Last sentence of the message for an unknown name.
        """
        self.kind, self.lines, self._group = kind, lines, group
        self._check, self._error, self._hint = check, error, hint
        self._key: Callable[[str], str] = str.lower if ignore_case else str
        self.registered: dict[str, Value] = {}
        self.aliases = {self._key(alias): name for alias, name in (aliases or {}).items()}

    def __getitem__(self, name: str) -> Value:
        """Return what goes by a name or an alias, and import it if need be.

        Raises:
            UnknownNameError: If there is no such name (also a ``KeyError``).
            RobotLayoutsError: If another package brings it, and that goes wrong.
        """
        if (known := self._known(name)) is None:
            if points := self._points(name):
                return self._brought(points)
            raise self.unknown(name)
        if known in self.registered:
            return self.registered[known]
        module, _, attribute = self.lines[known].partition(":")
        return getattr(import_module(module), attribute)

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names, sorted, without the aliases."""
        brought = (point.name for point in self._entry_points())
        return iter(sorted({*self.lines, *self.registered, *brought}))

    def __len__(self) -> int:
        """Return how many names there are."""
        return len(list(iter(self)))

    def __contains__(self, name: object) -> bool:
        """Say whether something goes by a name or an alias; it is not loaded."""
        return isinstance(name, str) and bool(self._known(name) or self._points(name))

    def register(self, name: str, value: Value, aliases: Iterable[str] = ()) -> None:
        """Make something known in this process, in place of what went by that name."""
        name = self._known(name) or name
        self.registered[name] = value
        self.aliases.update({self._key(alias): name for alias in aliases})

    def add(self, name: str, value: Value) -> None:
        """Make a descriptor known in this process; the same one again is allowed.

        Raises:
            RobotLayoutsError: The catalogue's own error, if another one has that name.
        """
        if name in self and self[name] != value:
            raise self._error(
                f"another {self.kind} is already called {name!r};"
                " choose another name with dataclasses.replace(descriptor, name=...)"
            )
        self.register(name, value)

    def aliases_of(self, name: str) -> tuple[str, ...]:
        """Return the other names of what goes by a name."""
        return tuple(alias for alias, target in self.aliases.items() if target == name)

    def home(self, name: str) -> str | None:
        """Return where something built in or registered is defined, ``"module:attribute"``.

        None if it is neither, or if what was registered does not say.
        """
        known = self._known(name)
        if known is None or known not in self.registered:
            return self.lines.get(known or "")
        value = self.registered[known]
        if not hasattr(value, "__qualname__"):
            return None
        return f"{value.__module__}:{value.__qualname__}"  # pyright: ignore[reportAttributeAccessIssue]

    def load_all(self) -> tuple[list[Value], list[RobotLayoutsError]]:
        """Return everything, sorted by name, and why that of other packages fails which does."""
        values: list[Value] = []
        failures: list[RobotLayoutsError] = []
        for name in self:
            try:
                values.append(self[name])
            except self._error as error:
                failures.append(error)
        return values, failures

    def origin(self, name: str) -> str | None:
        """Return where something comes from that is not built in.

        Returns:
            The package and version that bring it by an entry point, or the module of what was
            registered in this process; None for what is built in, or says nothing of itself.
        """
        home, known = self.home(name), self._known(name)
        if known is not None and home == self.lines.get(known):
            return None
        for point in self._points(name):
            if point.dist is not None:
                return f"{point.dist.name} {point.dist.version}"
        return None if home is None else home.partition(":")[0]

    def unknown(self, name: object, hint: str | None = None) -> UnknownNameError:
        """Return the error that says that a name is unknown, with the closest match."""
        hint = self._hint if hint is None else hint
        return UnknownNameError(self.kind, name, [*self, *self.aliases], hint)

    def _known(self, name: str) -> str | None:
        """Return the name under which something is registered or built in, as it is written."""
        key = self._key(self.aliases.get(self._key(name), name))
        written = {self._key(known): known for known in (*self.lines, *self.registered)}
        return written.get(key)

    def _points(self, name: str) -> list[metadata.EntryPoint]:
        key = self._key(name)
        return [point for point in self._entry_points() if self._key(point.name) == key]

    def _entry_points(self) -> Iterable[metadata.EntryPoint]:
        return metadata.entry_points(group=self._group)

    def _brought(self, points: Sequence[metadata.EntryPoint]) -> Value:
        """Return what other packages bring under one name."""
        name = points[0].name
        origins = {point.value: _in_words(point) for point in points}
        if len(origins) > 1:
            raise self._error(
                f"the {self.kind} {name!r} is brought more than once, by"
                f" {' and by '.join(origins.values())}; uninstall all packages but one, or register"
                " the one that is meant"
            )
        origin = origins[points[0].value]
        try:
            value = points[0].load()
        except (Exception, SystemExit) as error:  # whatever the code of another package does
            raise self._error(f"{origin} cannot be loaded: {reason(error)}") from error
        return self._check(value, origin, name)


def reason(error: BaseException) -> str:
    """Return why code of other people failed: our own messages as they are, others with type."""
    if isinstance(error, RobotLayoutsError) and str(error):
        return str(error)
    return f"{type(error).__name__}: {error}" if str(error) else type(error).__name__


def _in_words(point: metadata.EntryPoint) -> str:
    package = f" of {point.dist.name} {point.dist.version}" if point.dist is not None else ""
    return f"entry point {point.value!r}{package}"

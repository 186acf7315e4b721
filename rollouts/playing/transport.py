"""What goes to workers, and how errors come back from them."""

from __future__ import annotations

import io
import pickle
import sys
import sysconfig
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from types import FunctionType
from typing import Any

from robots import RobotLayoutsError
from robots.common.rooms import ROOMS
from rollouts.playing.events import Play, WorkerError
from tasks.processes.process import Sendable

_CHECKOUT = Path(__file__).parents[2]

HINT = "put it into a module that they can import, or pass workers=0, which plays in this process"


def modules_of(*things: Any) -> tuple[str, ...]:
    """Return the modules that define classes, functions, or the classes of other things."""
    known = (thing if hasattr(thing, "__module__") else type(thing) for thing in things)
    return tuple(dict.fromkeys(str(thing.__module__) for thing in known))


def packed(prepare: Callable[[], Play]) -> bytes:
    """Return what makes the plays, pickled for processes of this machine.

    Raises:
        WorkerError: If they could not load it, or it cannot be pickled.
    """
    buffer = io.BytesIO()
    try:
        _Pickler(buffer, pickle.HIGHEST_PROTOCOL).dump(prepare)
    except WorkerError:
        raise
    except Exception as error:  # whatever a class of the user's own raises
        raise unsendable(error) from error
    return buffer.getvalue()


def loaded(job: bytes) -> Callable[[], Play]:
    """Return what makes the plays, in a worker.

    Raises:
        WorkerError: If something that it needs cannot be imported, say.
    """
    try:
        return pickle.loads(job)
    except Exception as error:
        raise WorkerError(
            f"a worker cannot load what it is to play: {_words(error)}{_users_line(error)}; {HINT}"
        ) from error


def unsendable(error: Exception) -> WorkerError:
    """Return what to raise if pickling what the workers need raised ``error``."""
    return WorkerError(
        f"what the workers need cannot be sent to them: {_words(error)}{_users_line(error)}; a"
        " task, an expert or a policy must be defined in a module that they can import and hold"
        " what can be pickled, or play in this process with workers=0"
    )


def portable(error: Exception) -> Sendable:
    """Return what arrives elsewhere as an error of ours, with its traceback as its cause."""
    return Sendable(as_ours(error), WorkerError)


def as_ours(error: Exception) -> RobotLayoutsError:
    """Return an error that was raised in this process as one of ours."""
    if isinstance(error, RobotLayoutsError):
        return error
    ours = WorkerError(described(error))
    ours.__cause__ = error
    return ours


def described(error: BaseException) -> str:
    """Return an error's kind and words, and the line that it came from, if possible the user's."""
    return _words(error) + (_users_line(error) or _line(traceback.extract_tb(error.__traceback__)))


def _words(error: BaseException) -> str:
    try:
        return f"{type(error).__name__}: {error}".rstrip(": ")
    except Exception:  # whatever a class of the user's own does
        return f"{type(error).__name__}: its message cannot be read"


def _users_line(error: BaseException) -> str:
    frames = traceback.extract_tb(error.__traceback__)
    return _line([frame for frame in frames if _is_users(frame.filename)])


def _line(frames: Sequence[traceback.FrameSummary]) -> str:
    if not frames:
        return ""
    return f" ({frames[-1].filename}:{frames[-1].lineno}, in {frames[-1].name})"


def is_installed(path: Path) -> bool:
    """Return whether a file is Python's own or of an installed package."""
    kinds = ("stdlib", "platlib", "purelib")
    return any(path.is_relative_to(sysconfig.get_path(kind)) for kind in kinds)


def _is_users(file: str) -> bool:
    path = Path(file)
    library = any(path.is_relative_to(_CHECKOUT / room) for room in ROOMS)
    return not (library or is_installed(path) or file.startswith("<frozen "))


class _Pickler(pickle.Pickler):
    """Refuses what is defined where no other process can look for it."""

    def reducer_override(self, obj: Any) -> Any:
        """Look at every function and class that is pickled by its name."""
        named = isinstance(obj, FunctionType | type)
        if named and obj.__module__ == "__main__" and not _others_can_load_main():
            raise WorkerError(
                f"{obj.__qualname__} is defined in this notebook or interactive session, where"
                f" worker processes cannot load it: {HINT}"
            )
        return NotImplemented


def _others_can_load_main() -> bool:
    """Return whether ``__main__`` comes from a file, which spawned processes read again."""
    main = sys.modules["__main__"]
    file = getattr(main, "__file__", None)
    return getattr(main, "__spec__", None) is not None or (
        file is not None and Path(file).is_file()
    )

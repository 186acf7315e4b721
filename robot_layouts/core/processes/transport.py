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

from robot_layouts.core.errors import RobotLayoutsError
from robot_layouts.core.own_packages import PACKAGES
from robot_layouts.core.processes.start import WorkerError

_CHECKOUT = Path(__file__).parents[3]
_ALONE = "use this process alone: workers=0, and num_workers=0 of a vector"
_HINT = f"define it in a module that they can import, or {_ALONE}"


class RemoteError(WorkerError):
    """An error that is not a `RobotLayoutsError`, as it arrives here, with its kind and place."""


class WorkerTraceback(Exception):
    """Where an error came up in another process: the ``__cause__`` of what is raised here."""

    def __str__(self) -> str:
        """Return the traceback as that process would have printed it."""
        return f"\n\n{self.args[0]}" if self.args else ""


class SentError:
    """An error that arrives in another process together with where it came up.

    It is pickled as the error itself if that is one of ours, else as a `RemoteError`; the
    ``__cause__`` of what arrives is a `WorkerTraceback`.
    """

    def __init__(self, error: BaseException) -> None:
        """Keep the error and its traceback, as text."""
        lines = traceback.format_exception(type(error), error, error.__traceback__)
        self._traceback = "".join(lines).rstrip()
        ours = isinstance(error, RobotLayoutsError) and _survives_pickling(error)
        self._error = error if ours else RemoteError(described(error))

    def __reduce__(self) -> tuple[Callable[..., Exception], tuple[BaseException, str]]:
        """Pickle as the error."""
        return _arrived, (self._error, self._traceback)


def packed(what: Any) -> bytes:
    """Return what workers of this machine are to have, pickled.

    Raises:
        WorkerError: If they could not load it, or it cannot be pickled.
    """
    buffer = io.BytesIO()
    try:
        _Pickler(buffer, pickle.HIGHEST_PROTOCOL).dump(what)
    except WorkerError:
        raise
    except Exception as error:  # whatever a class of the user's own raises
        raise unsendable(error) from error
    return buffer.getvalue()


def loaded(job: bytes) -> Any:
    """Return what was packed, in a worker.

    Raises:
        WorkerError: If something that it needs cannot be imported, say.
    """
    try:
        return pickle.loads(job)
    except Exception as error:
        raise WorkerError(
            f"a worker cannot load what it needs: {_words(error)}{_users_line(error)}; {_HINT}"
        ) from error


def unsendable(error: Exception) -> WorkerError:
    """Return what to raise if pickling what workers need raised ``error``."""
    return WorkerError(
        f"what the workers need cannot be sent to them: {_words(error)}{_users_line(error)};"
        " a task, an expert or a policy must be defined in a module that they can import and hold"
        f" what can be pickled, or {_ALONE}"
    )


def as_ours(error: Exception) -> RobotLayoutsError:
    """Return an error that was raised in this process as one of ours."""
    if isinstance(error, RobotLayoutsError):
        return error
    ours = RemoteError(described(error))
    ours.__cause__ = error
    return ours


def described(error: BaseException) -> str:
    """Return an error's kind and words, and the line that it came from, if possible the user's."""
    return _words(error) + (_users_line(error) or _line(traceback.extract_tb(error.__traceback__)))


def is_installed(path: Path) -> bool:
    """Return whether a file is Python's own or of an installed package."""
    kinds = ("stdlib", "platlib", "purelib")
    return any(path.is_relative_to(sysconfig.get_path(kind)) for kind in kinds)


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


def _is_users(file: str) -> bool:
    path = Path(file)
    library = any(path.is_relative_to(_CHECKOUT / room) for room in PACKAGES)
    return not (library or is_installed(path) or file.startswith("<frozen "))


def _arrived(error: Exception, text: str) -> Exception:
    error.__cause__ = WorkerTraceback(text)
    return error


def _survives_pickling(error: BaseException) -> bool:
    try:
        arrived = pickle.loads(pickle.dumps(error))
        return type(arrived) is type(error) and str(arrived) == str(error)
    except Exception:  # whatever a class of the user's own does
        return False


class _Pickler(pickle.Pickler):
    """Refuses what is defined where no other process can look for it."""

    def reducer_override(self, obj: Any) -> Any:
        """Look at every function and class that is pickled by its name."""
        named = isinstance(obj, FunctionType | type)
        if named and obj.__module__ == "__main__" and not _others_can_load_main():
            raise WorkerError(
                f"{obj.__qualname__} is defined in this notebook or interactive session, where"
                f" worker processes cannot load it: {_HINT}"
            )
        return NotImplemented


def _others_can_load_main() -> bool:
    """Return whether ``__main__`` comes from a file, which workers read again."""
    main = sys.modules["__main__"]
    file = getattr(main, "__file__", None)
    return getattr(main, "__spec__", None) is not None or (
        file is not None and Path(file).is_file()
    )

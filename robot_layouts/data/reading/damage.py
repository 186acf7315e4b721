"""What libraries raise, in many ways, when a file is damaged or foreign, turned into our errors."""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Callable, Generator
from contextlib import contextmanager

from robots import RobotLayoutsError

_ERRORS = (
    *(OSError, RuntimeError, LookupError, ValueError, TypeError, AttributeError, ArithmeticError),
    *(MemoryError, EOFError, zlib.error, zipfile.BadZipFile),
)


@contextmanager
def damage_errors(refusal: Callable[[str], RobotLayoutsError]) -> Generator[None]:
    """Turn what h5py, NumPy and others raise while they read a file into one of our errors.

    Args:
        refusal: Makes the error, given the reason.
    """
    try:
        yield
    except RobotLayoutsError:
        raise
    except _ERRORS as error:
        raise refusal(str(error) or repr(error)) from error

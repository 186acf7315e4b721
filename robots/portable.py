"""``robot-layouts portable PROGRAM …``: begins a program whose physics is the same everywhere.

NumPy, torch and the C library choose functions by the processor as they are loaded, so this has to
be settled before. Processes that the program begins inherit it.
"""

from __future__ import annotations

import os
import platform
import shutil
import sys
from collections.abc import Sequence
from typing import Annotated, NoReturn

from robot_layouts.core.cli import Word
from robot_layouts.core.errors import RobotLayoutsError, SimulationError
from robot_layouts.core.portable import portable_variables


def portable(program: Annotated[Sequence[str], Word("PROGRAM", nargs="...")] = ()) -> None:
    """Run a program so that physics has the same bits on every x86-64 processor.

    For example: robot-layouts portable python train.py

    Args:
        program: The program and its arguments; without one, the variables that it would get in its
            environment are printed.

    Raises:
        RobotLayoutsError: If there is no such program.
    """
    if (sys.platform, platform.machine()) != ("linux", "x86_64"):
        raise SimulationError("`robot-layouts portable` needs Linux on an x86-64 processor")
    if program:
        _become(program)
    for name, value in _variables().items():
        print(f"{name}={value}")


def _become(words: Sequence[str]) -> NoReturn:
    path = shutil.which(words[0])
    if path is None:
        raise SimulationError(
            f"there is no program {words[0]!r}; write it as in a terminal, such as"
            " `robot-layouts portable python train.py`"
        )
    try:
        os.execve(path, list(words), {**os.environ, **_variables()})
    except OSError as error:
        raise SimulationError(f"{path} cannot be begun: {error}") from error


def _variables() -> dict[str, str]:
    return portable_variables(os.environ, numpy_versions())


def numpy_versions() -> tuple[str, ...]:
    """Return the names of what NumPy's functions have versions for.

    Raises:
        RobotLayoutsError: If this NumPy does not tell.
    """
    try:
        from numpy._core._multiarray_umath import __cpu_dispatch__
    except ImportError:
        raise RobotLayoutsError("this NumPy does not tell what processors it knows") from None
    return tuple(__cpu_dispatch__)

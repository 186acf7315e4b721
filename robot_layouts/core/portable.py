"""Whether this process computes the same bits on every x86-64 processor, and what makes it so.

The libraries below choose among several versions of their functions by what a processor offers, and
these versions round differently. Variables of the environment, read as a process begins, hold every
one of them to the version that runs everywhere. `robots.portable` begins programs with them.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from functools import cache
from pathlib import Path

from robot_layouts.core.errors import SimulationError

PORTABLE = "ROBOT_LAYOUTS_PORTABLE"
NUMPY, GLIBC = "NPY_DISABLE_CPU_FEATURES", "GLIBC_TUNABLES"

FIXED: Mapping[str, str] = {
    "ATEN_CPU_CAPABILITY": "default",  # torch's own loops
    "MKL_CBWR": "COMPATIBLE",  # Intel's library in torch
    "ONEDNN_MAX_CPU_ISA": "SSE41",  # convolutions in torch
    "OPENBLAS_CORETYPE": "Nehalem",  # products and solvers of NumPy and SciPy
}
_TUNABLE, _WITHOUT = "glibc.cpu.hwcaps", ("-AVX2", "-FMA", "-FMA4")  # sin, exp, … of C


def portable_variables(
    environment: Mapping[str, str], numpy_versions: tuple[str, ...]
) -> dict[str, str]:
    """Return the variables of a process that is to compute the same everywhere.

    Args:
        environment: Those of now; tunables of the C library are kept beside ours.
        numpy_versions: What NumPy calls the processors that it has versions of functions for.
    """
    tunables = [t for t in environment.get(GLIBC, "").split(":") if t]
    kept = [t for t in tunables if not t.startswith(f"{_TUNABLE}=")]
    tunable = f"{_TUNABLE}={','.join(_WITHOUT)}"
    return {
        **FIXED,
        NUMPY: " ".join(numpy_versions),
        GLIBC: ":".join([*kept, tunable]),
        PORTABLE: "1",
    }


@cache
def is_portable() -> bool:
    """Return whether this process computes physics with the same bits on every x86-64 processor.

    That is decided when a process begins: by ``robot-layouts portable PROGRAM …``. What it begins
    itself is portable as well.

    Raises:
        SimulationError: If `PORTABLE` is set, but what belongs to it was not when this process
            began.
    """
    if os.environ.get(PORTABLE, "0") == "0":
        return False
    missing = missing_variables(_at_the_beginning())
    if missing:
        raise SimulationError(
            f"{PORTABLE} is set, but not what belongs to it before Python begins:"
            f" {', '.join(missing)}; begin with `robot-layouts portable python PROGRAM.py`, which"
            " sets all"
        )
    return True


def inherited_variables() -> dict[str, str]:
    """Return the variables that a process elsewhere needs to be as portable as this one.

    Raises:
        SimulationError: See `is_portable`.
    """
    if not is_portable():
        return {}
    return {name: os.environ[name] for name in (*FIXED, NUMPY, GLIBC, PORTABLE)}


def missing_variables(environment: Mapping[str, str]) -> list[str]:
    """Return the names of variables that a portable process begins with, and this one lacks."""
    missing = [name for name, value in FIXED.items() if environment.get(name) != value]
    if not environment.get(NUMPY):
        missing.append(NUMPY)
    tunables = dict(_pair(t) for t in environment.get(GLIBC, "").split(":"))
    if not {*_WITHOUT} <= {*tunables.get(_TUNABLE, "").split(",")}:
        missing.append(GLIBC)
    return missing


def _at_the_beginning() -> dict[str, str]:
    """Return the environment that this process began with; what is set later has no effect."""
    rows = os.fsdecode(Path("/proc/self/environ").read_bytes()).split("\0")
    return dict(_pair(row) for row in rows)


def _pair(text: str) -> tuple[str, str]:
    name, _, value = text.partition("=")
    return name, value

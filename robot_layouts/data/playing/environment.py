"""What a process plays on besides the code of the user: versions, processor, our own source."""

from __future__ import annotations

import os
import platform
from collections.abc import Iterable, Iterator
from contextlib import suppress
from functools import cache
from hashlib import sha256
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np
import torch

from robot_layouts.core.own_packages import PLAYING
from robot_layouts.core.portable import is_portable

# What computes states, and what experts plan with.
PACKAGES = (
    "robot-layouts",
    "sapien",
    "numpy",
    "torch",
    "fast-simplification",
    "gymnasium",
    "mujoco",
    "ompl",
    "pycollada",
    "python-fcl",
    "scipy",
    "toppra",
    "trimesh",
    "yourdfpy",
)
SOURCE = "robot-layouts source"  # a SHA-256: a checkout changes more often than its version

# What libraries go by when they choose, among versions of a function, that for the processor.
_VARIABLES = (
    "ATEN_CPU_CAPABILITY",
    "GLIBC_TUNABLES",
    "MKL_CBWR",
    "NPY_DISABLE_CPU_FEATURES",
    "ONEDNN_MAX_CPU_ISA",
    "OPENBLAS_CORETYPE",
)

_ROOT = Path(__file__).parents[3]


@cache
def environment() -> dict[str, Any]:
    """Return versions and processor, as plain data; other processes may have others.

    ``versions`` has those of Python, of the C library and of packages, and a SHA-256 of our own
    source; ``processor`` its name, what torch and NumPy use of it, whether the process is to
    compute the same on every one (``portable``), and the variables that choose what is used.
    """
    return {
        "versions": {
            "python": platform.python_version(),
            "libc": " ".join(platform.libc_ver()),
            **versions(PACKAGES),
            "numpy": np.__version__,  # what is loaded, which need not be what is installed
            "torch": torch.__version__,
            SOURCE: _source(),
        },
        "processor": {
            "machine": platform.machine(),
            "name": _processor(),
            "torch": torch.backends.cpu.get_cpu_capability(),
            "numpy": " ".join(_numpy_features()),
            "portable": is_portable(),
            "variables": " ".join(f"{n}={os.environ[n]}" for n in _VARIABLES if n in os.environ),
        },
    }


def versions(packages: Iterable[str]) -> dict[str, str]:
    """Return the versions of those packages that are installed."""
    found: dict[str, str] = {}
    for package in packages:
        with suppress(PackageNotFoundError):
            found[package] = version(package)
    return found


def _source() -> str:
    """Return one SHA-256 of every module of ours that has a part in an episode."""
    digest = sha256()
    for folder in PLAYING:
        for path in sorted((_ROOT / folder).rglob("*.py")):
            digest.update(f"{path.relative_to(_ROOT).as_posix()}\n".encode())
            digest.update(sha256(path.read_bytes()).digest())
    return digest.hexdigest()


def _processor() -> str:
    """Return the processor's name as its maker has it, where Linux knows it."""
    with suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            name, _, value = line.partition(":")
            if name.strip() == "model name":
                return value.strip()
    return platform.processor() or platform.machine()


def _numpy_features() -> Iterator[str]:
    """Return the kinds of instructions that NumPy was built for or found here."""
    found: Any = np.show_config(mode="dicts")
    simd = found.get("SIMD Extensions", {})
    yield from simd.get("baseline", ())
    yield from simd.get("found", ())

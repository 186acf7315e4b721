"""Variables of the environment with which libraries compute as they do on other processors."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import NamedTuple

from robots.common.portable import FIXED, GLIBC, NUMPY, portable_variables
from robots.portable import numpy_versions

PLAIN, PORTABLE = "as it is", "portable"

_LATEST = ("X86_V4", "AVX512_ICL", "AVX512_SPR", "AVX512F", "AVX512_SKX")


class Setting(NamedTuple):
    """How episodes are played.

    Attributes:
        about: What that stands for, for the table.
        variables: Of the environment.
        against: Name of the setting whose bits it should have.
        emulated: The processor that is emulated, as QEMU calls it; empty if none is.
    """

    about: str
    variables: Mapping[str, str]
    against: str = PLAIN
    emulated: str = ""


def settings() -> dict[str, Setting]:
    """Return all of them by name; the first two are what the others are compared with."""
    versions = numpy_versions()
    portable = portable_variables(os.environ, versions)
    v3 = " ".join(name for name in versions if name in _LATEST)
    return {
        PLAIN: Setting("every library chooses by the processor", {}),
        PORTABLE: Setting("`robot-layouts portable`", portable, PORTABLE),
        "torch, AVX2": Setting("torch's loops", {"ATEN_CPU_CAPABILITY": "avx2"}),
        "torch, SSE": Setting("torch's loops", {"ATEN_CPU_CAPABILITY": "default"}),
        "MKL, AVX2": Setting("Intel's library in torch", {"MKL_CBWR": "AVX2"}),
        "MKL, any": Setting("Intel's library in torch", {"MKL_CBWR": FIXED["MKL_CBWR"]}),
        "NumPy, AVX2": Setting("NumPy's loops", {NUMPY: v3}),
        "NumPy, SSE": Setting("NumPy's loops", {NUMPY: " ".join(versions)}),
        "OpenBLAS, Haswell": _blas("Haswell"),
        "OpenBLAS, Nehalem": _blas("Nehalem"),
        "C, without FMA": Setting("sin, exp, … of C", {GLIBC: portable[GLIBC]}),
        "two threads": Setting("sums in two threads", {"OMP_NUM_THREADS": "2"}),
        **{
            f"{cpu}, {name}": Setting(f"a whole {cpu}, emulated", variables, name, cpu)
            for name, variables in ((PLAIN, {}), (PORTABLE, portable))
            for cpu in ("Nehalem", "Haswell", "EPYC")
        },
    }


def _blas(core: str) -> Setting:
    return Setting("products and solvers of NumPy", {"OPENBLAS_CORETYPE": core})

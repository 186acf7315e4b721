"""``robot-layouts portable``: what it sets, and which process says that it is portable."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from robot_layouts.__main__ import main
from robot_layouts.core import portable
from robot_layouts.core.portable import is_portable, missing_variables, portable_variables
from robots import SimulationError
from robots.portable import numpy_versions
from tests.quick import quick_cases

BEGIN = (sys.executable, "-m", "robot_layouts", "portable")
OURS = (*portable.FIXED, portable.NUMPY, portable.GLIBC, portable.PORTABLE)


def run(*command: str, **variables: str) -> subprocess.CompletedProcess[str]:
    """Run a command in an environment without any of these variables but those given."""
    environment = {name: value for name, value in os.environ.items() if name not in OURS}
    environment |= variables
    return subprocess.run(
        command, env=environment, capture_output=True, text=True, check=False, timeout=120
    )


def python(code: str, *before: str, **variables: str) -> str:
    """Return what a Python program prints, or the last line of its complaint."""
    done = run(*before, sys.executable, "-c", code, **variables)
    return done.stdout.strip() if done.returncode == 0 else done.stderr.splitlines()[-1]


SAYS = "from robots import is_portable; print(is_portable())"


@pytest.mark.long
def test_a_process_says_how_it_was_begun():
    assert python(SAYS) == "False"
    assert python(SAYS, *BEGIN) == "True"
    assert python(SAYS, *BEGIN, *BEGIN) == "True"


@pytest.mark.long
def test_what_a_portable_process_begins_is_portable():
    spawned = (
        "from multiprocessing import get_context; from robots import is_portable\n"
        "if __name__ == '__main__':\n"
        " for way in ('spawn', 'fork', 'forkserver'):\n"
        "  with get_context(way).Pool(1) as pool: print(pool.apply(is_portable), end=' ')"
    )
    assert python(spawned, *BEGIN) == "True True True"


@pytest.mark.long
def test_libraries_take_the_versions_that_run_everywhere():
    code = (
        "import torch; from numpy._core import _multiarray_umath as m;"
        "print(torch.backends.cpu.get_cpu_capability(),"
        " any(m.__cpu_features__[name] for name in m.__cpu_dispatch__))"
    )
    assert python(code, *BEGIN) == "DEFAULT False"


@pytest.mark.long
def test_the_c_library_takes_them_too():
    code = "from math import cos; print([cos(i / 7).hex() for i in range(20000)])"
    without = python(code, GLIBC_TUNABLES="glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4")
    assert python(code, *BEGIN) == without


@pytest.mark.parametrize(
    "name",
    quick_cases([name for name in OURS if name != portable.PORTABLE], ["ATEN_CPU_CAPABILITY"]),
)
def test_a_variable_that_is_missing_is_named(name):
    variables = portable_variables({}, numpy_versions())
    assert not missing_variables(variables)
    del variables[name]
    assert missing_variables(variables) == [name]
    complaint = python(SAYS, **variables)
    assert complaint.startswith("robot_layouts.core.errors.SimulationError: ROBOT_LAYOUTS_PORTABLE")
    assert f": {name}; begin with `robot-layouts portable python" in complaint


@pytest.mark.long
def test_variables_that_are_set_too_late_do_not_count():
    late = f"import os; os.environ.update({portable_variables({}, numpy_versions())}); "
    assert "set, but not what belongs to it before Python begins" in python(late + SAYS)


def test_what_this_process_was_begun_with_counts(monkeypatch):
    monkeypatch.setenv(portable.PORTABLE, "1")
    monkeypatch.setattr(portable, "_at_the_beginning", dict)
    is_portable.cache_clear()
    try:
        with pytest.raises(SimulationError, match="ATEN_CPU_CAPABILITY, MKL_CBWR"):
            is_portable()
    finally:
        is_portable.cache_clear()


def test_other_tunables_of_the_c_library_stay():
    given = {portable.GLIBC: "glibc.malloc.check=1:glibc.cpu.hwcaps=-AVX512F"}
    variables = portable_variables(given, ("X86_V3",))
    assert variables[portable.GLIBC] == "glibc.malloc.check=1:glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4"


def test_without_a_program_it_prints_the_variables(capsys):
    assert main(["portable"]) == 0
    printed = dict(line.split("=", 1) for line in capsys.readouterr().out.splitlines())
    assert printed == portable_variables(os.environ, numpy_versions())


def test_a_program_that_is_none(capsys, tmp_path):
    assert main(["portable", "pyhton", "mine.py"]) == 1
    assert "there is no program 'pyhton'" in capsys.readouterr().err
    broken = tmp_path / "broken"
    broken.write_bytes(b"\x7fELF")
    broken.chmod(0o755)
    assert main(["portable", str(broken)]) == 1
    assert "cannot be begun: " in capsys.readouterr().err


@pytest.mark.long
def test_the_exit_code_is_the_programs():
    assert run(*BEGIN, sys.executable, "-c", "raise SystemExit(7)").returncode == 7

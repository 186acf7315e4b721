"""Asks modules of this package in processes of their own, as on other processors."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Mapping
from typing import Any, NamedTuple

from robots import SimulationError

EMULATOR = "qemu-x86_64-static"
PLAIN = "as it is"


class Setting(NamedTuple):
    """How a process computes.

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


def answers_under(setting: Setting, module: str, request: Any, count: int) -> list[Any]:
    """Return what a module answers in a process of its own, a line of JSON each.

    Args:
        setting: Under what.
        module: Which reads a request from stdin, as JSON.
        request: It.
        count: How many answers there must be.

    Raises:
        SimulationError: If there is no emulator, or the process ends before it is through.
    """
    command = [sys.executable, "-m", module]
    if setting.emulated:
        if (emulator := shutil.which(EMULATOR)) is None:
            raise SimulationError(
                f"there is no program {EMULATOR!r} to emulate a {setting.emulated} with; Debian's"
                " package qemu-user-static brings it, from version 10 on without mistakes in AVX"
            )
        command = [emulator, "-cpu", setting.emulated, *command]
    done = subprocess.run(
        command,
        env={**os.environ, "OMP_NUM_THREADS": "1", **setting.variables},
        input=json.dumps(request),
        stdout=subprocess.PIPE,
        text=True,
        check=False,
    )
    found = [json.loads(line) for line in done.stdout.splitlines()]
    if done.returncode or len(found) < count:
        raise SimulationError(
            f"{' '.join(command)} ended with {done.returncode} after {len(found)} of {count}"
            " answers; its own messages stand above"
        )
    return found

"""Plays the same episodes under several settings, and says where their bits first differ."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from hashlib import sha256
from typing import Any

from measurements.processors.play import KINDS, Digests, Played
from measurements.processors.settings import Setting
from robots import SimulationError

EMULATOR = "qemu-x86_64-static"
ABSENT = -1  # an episode of another length

Differences = dict[str, int]


def play_under(
    setting: Setting,
    episodes: Sequence[Played],
    *,
    emulator: str = EMULATOR,
    on_episode: Callable[[Played], None] = lambda played: None,
) -> list[Digests | None]:
    """Return the digests of episodes, played in a process of its own.

    Args:
        setting: Under what.
        episodes: Which.
        emulator: QEMU's program, if a processor is to be emulated.
        on_episode: Called with each episode after it was played.

    Raises:
        SimulationError: If there is no emulator, or the process ends before it is through.
    """
    command = [*_emulation(setting, emulator), sys.executable, "-m", f"{__package__}.play"]
    variables = {**os.environ, "OMP_NUM_THREADS": "1", **setting.variables}
    found: list[Digests | None] = []
    with subprocess.Popen(
        command, env=variables, text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        with process.stdin as stdin:
            json.dump(list(episodes), stdin)
        for line, played in zip(process.stdout, episodes, strict=False):
            found.append(json.loads(line))
            on_episode(played)
    if process.returncode or len(found) < len(episodes):
        raise SimulationError(
            f"{' '.join(command)} ended with {process.returncode} after {len(found)} of"
            f" {len(episodes)} episodes; what it says stands above"
        )
    return found


def _emulation(setting: Setting, emulator: str) -> list[str]:
    if not setting.emulated:
        return []
    path = shutil.which(emulator)
    if path is None:
        raise SimulationError(
            f"there is no program {emulator!r} to emulate a {setting.emulated} with; Debian's"
            " package qemu-user-static brings it"
        )
    return [path, "-cpu", setting.emulated]


def differences(
    episodes: Sequence[Played],
    one: Sequence[Digests | None],
    other: Sequence[Digests | None],
) -> dict[str, Differences]:
    """Return, by episode, the kinds that differ and the first moment at which they do."""
    found: dict[str, Differences] = {}
    for played, first, second in zip(episodes, one, other, strict=True):
        if first is not None and second is not None and first != second:
            found[str(played)] = dict(_first(first, second))
    return found


def physics(episodes: Sequence[Played], found: Sequence[Digests | None]) -> dict[str, str]:
    """Return one digest of all actions and states of each episode."""
    return {
        str(played): sha256(" ".join(one["actions"] + one["states"]).encode()).hexdigest()[:16]
        for played, one in zip(episodes, found, strict=True)
        if one is not None
    }


def _first(one: Digests, other: Digests) -> Iterator[tuple[str, int]]:
    for kind in KINDS:
        pairs = zip(one[kind], other[kind], strict=False)
        at = next((i for i, (a, b) in enumerate(pairs) if a != b), None)
        if at is not None:
            yield kind, at
        elif len(one[kind]) != len(other[kind]):
            yield kind, ABSENT


def summary(found: Mapping[str, Differences]) -> dict[str, int]:
    """Return in how many episodes each kind differs."""
    return {kind: sum(kind in row for row in found.values()) for kind in KINDS}


def processor() -> str:
    """Return what the processor calls itself."""
    with open("/proc/cpuinfo", encoding="utf-8") as lines:
        names = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
        return next(names, "unknown")


Record = dict[str, Any]

"""Receipts of policies that see, verified in processes that draw and compute in other ways.

They are kept in ``docs/receipts/pictures``, so that each machine verifies what others have seen. A
process reads from stdin, as JSON, which receipt it is to verify; where that is not there yet, it
writes it first. What a policy does here follows from all pixels, so that another one of them leads
to other states.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from hashlib import sha256
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from benchmarks.asking import Setting, answers_under
from benchmarks.records import DOCS
from robot_layouts.core.portable import portable_variables
from robot_layouts.data import evaluate
from robot_layouts.data.playing.evaluation_job import pictures_of
from robot_layouts.data.receipts.receipt import Receipt
from robot_layouts.data.receipts.verification import verify
from robots import SimulationError
from robots.portable import numpy_versions

FOLDER = DOCS / "receipts" / "pictures"
EPISODES, STEPS, SIZE = 25, 20, 64  # of each cell, of an episode, pixels
CAPS, THREADS = "GALLIUM_OVERRIDE_CPU_CAPS", "LP_NUM_THREADS"


@dataclass(frozen=True)
class Seeing:
    """A policy whose actions follow from every pixel that it sees.

    Attributes:
        numbers: Of an action.
    """

    numbers: int

    def __call__(self, observation: Mapping[str, Any]) -> NDArray[np.float32]:
        """Return numbers from -1 to 1 that are made of a digest of all pictures."""
        digest = sha256()
        for picture in pictures_of(observation).values():
            digest.update(np.ascontiguousarray(picture).tobytes())
        numbers = np.frombuffer(digest.digest(), np.uint8)[: self.numbers]
        return (numbers / 127.5 - 1).astype(np.float32)


one_arm, two_arms = Seeing(8), Seeing(16)


class Cell(NamedTuple):
    """A task, and who plays.

    Attributes:
        policy: Its name in this module.
        robots: Those that bring a camera.
    """

    policy: str
    robots: Mapping[str, str]


CELLS = {
    "PickCube-v1": Cell("one_arm", {"arm": "panda_wristcam"}),
    "TwoRobotPickCube-v1": Cell("two_arms", {"left": "panda_wristcam"}),
}


class Way(NamedTuple):
    """How a receipt is verified: under what, and in how many worker processes."""

    setting: Setting
    workers: int = 0


def ways() -> dict[str, Way]:
    """Return all of them by name, all portable; the first to run writes a missing receipt."""
    portable = portable_variables(os.environ, numpy_versions())

    def way(
        about: str, variables: Mapping[str, str] = portable, workers: int = 0, emulated: str = ""
    ) -> Way:
        return Way(Setting(about, {**portable, **variables}, emulated=emulated), workers)

    return {
        "as it is": way("a portable process here"),
        "one thread": way(f"`{THREADS}=1`", {THREADS: "1"}),
        "two threads": way(f"`{THREADS}=2`", {THREADS: "2"}),
        "1 worker": way("`--workers 1`", workers=1),
        "8 workers": way("`--workers 8`", workers=8),
        "AVX": way(f"without AVX2, FMA and AVX-512: `{CAPS}=avx`", {CAPS: "avx"}),
        "SSE": way(f"without AVX, too: `{CAPS}=sse4.1`", {CAPS: "sse4.1"}),
        **{cpu: way(f"a whole {cpu}, emulated", emulated=cpu) for cpu in ("Haswell", "EPYC")},
    }


def verified(before: Mapping[str, Any], names: Collection[str]) -> Iterator[dict[str, Any]]:
    """Verify a receipt of each cell in several ways, and yield after each how often all was equal.

    Args:
        before: What was verified before in other ways, which is kept.
        names: Which ways (all without QEMU).
    """
    known, rows = ways(), dict(before.get("ways", {}))
    chosen = names or [name for name, way in known.items() if not way.setting.emulated]
    FOLDER.mkdir(parents=True, exist_ok=True)
    for name in tqdm([name for name in known if name in chosen], disable=None):
        way, cells = known[name], dict[str, dict[str, int] | None]()
        for task in CELLS:
            file = str(FOLDER / f"{task}.json")
            request = {"task": task, "file": file, "workers": way.workers, "count": EPISODES}
            try:
                (cells[task],) = answers_under(way.setting, "benchmarks.receipts", request, 1)
            except SimulationError:  # the driver ends the process
                cells[task] = None
        rows[name] = {"about": way.setting.about, "cells": cells}
        written = Receipt.read(FOLDER / f"{next(iter(CELLS))}.json").environment
        yield {
            "episodes": EPISODES,
            "steps": STEPS,
            "size": SIZE,
            "written_on": written["processor"]["name"],
            "ways": {name: rows[name] for name in known if name in rows},
        }


def _verify(task: str, file: str, workers: int, count: int) -> dict[str, int]:
    """Verify the first episodes of a receipt, which is written first where there is none."""
    policy, robots = f"benchmarks.receipts:{CELLS[task].policy}", CELLS[task].robots
    if not Path(file).exists():
        making: dict[str, Any] = {
            "robots": robots,
            "obs_mode": "rgb",
            "camera_size": (SIZE, SIZE),
            "visuals": "light",
            "max_episode_steps": STEPS,
        }
        evaluate(policy, task, range(count), workers=workers, receipt=file, **making)
    receipt = Receipt.read(file)
    recorded = receipt.episodes[:count]
    found = verify(replace(receipt, episodes=recorded), workers=workers, policy=policy)
    return {
        "episodes": len(recorded),
        "pictures": sum(len(p) for e in recorded for p in e.picture_digests().values()),
        "equal": len(recorded) - len(found.differences),
        "other_pictures": sum(p.different for e in found.differences for p in e.pictures),
    }


if __name__ == "__main__":
    print(json.dumps(_verify(**json.load(sys.stdin))), flush=True)

"""``python -m benchmarks processors``: what of results depends on the processor.

The same episodes are played in one process after the other, each under variables that make one
library compute as on another processor, or on a whole processor that QEMU emulates. Processes play
the episodes that they read from stdin as JSON, and answer with a line for each: libraries choose
their functions as they are loaded.
"""

from __future__ import annotations

import json
import os
import platform
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import closing
from hashlib import sha256
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from tqdm import tqdm

from benchmarks.asking import PLAIN, Setting, answers_under
from benchmarks.receipts import verified
from benchmarks.records import (
    DOCS,
    Record,
    read_record,
    versions_of,
    write_page,
    write_record,
)
from robot_layouts.core.portable import FIXED, GLIBC, NUMPY, portable_variables
from robot_layouts.data.playing.evaluation_job import picture_digest, pictures_of
from robot_layouts.experts import find_expert
from robot_layouts.simulation import Camera
from robots import DescriptorError, SimulationError, TaskError
from robots.portable import numpy_versions
from tasks import TaskEnv, get_task_class, list_tasks, make
from tasks.episode import REBUILT
from tasks.randomization.distributions import Stream

PACKAGES = ("numpy", "torch", "sapien")
EXPERT = "expert"
# The first seed of each, and the number of steps where actions are random.
CONTROLS = {
    EXPERT: (0, 0),
    "pd_joint_delta_pos": (3, 12),
    "pd_ee_delta_pose": (4, 12),
    "pd_ee_pose": (5, 8),
}
KINDS = ("actions", "states", "observations", "rewards")
REACH = 0.6  # m, rad; where an action number has no bound
PICTURES = "pictures"  # random actions, under the eyes of cameras
TEXTURES = "rgb+depth+segmentation"
CAMERAS = (
    Camera((0.3, 0.0, 0.6), (-0.1, 0.0, 0.1)),
    Camera((0.0, 0.0, 1.2), (0.0, 0.01, 0.0), "top", 96, 96),
    Camera((0.6, 0.7, 0.6), (0.0, 0.0, 0.35), "side", 224, 160, 1.0),
)
ABSENT = -1  # an episode of another length
PORTABLE = "portable"
LATEST = ("X86_V4", "AVX512_ICL", "AVX512_SPR", "AVX512F", "AVX512_SKX")

SWIFTSHADER = "/usr/lib/chromium/vk_swiftshader_icd.json"

Digests = dict[str, list[str]]


class Played(NamedTuple):
    """An episode to be played.

    Attributes:
        task: Id of the task.
        seed: Of its reset, and of its actions.
        control: `EXPERT`, or the control mode in which actions are random, or `PICTURES`.
        steps: How many, if they are random.
    """

    task: str
    seed: int
    control: str
    steps: int

    def __str__(self) -> str:
        """Return it in words."""
        return f"{self.task}, seed {self.seed}, {self.control}"


def settings() -> dict[str, Setting]:
    """Return all of them by name; the first two are what the others are compared with."""
    versions = numpy_versions()
    portable = portable_variables(os.environ, versions)
    v3 = " ".join(name for name in versions if name in LATEST)
    blas = "products and solvers of NumPy"
    return {
        PLAIN: Setting("every library chooses by the processor", {}),
        PORTABLE: Setting("`robot-layouts portable`", portable, PORTABLE),
        "torch, AVX2": Setting("torch's loops", {"ATEN_CPU_CAPABILITY": "avx2"}),
        "torch, SSE": Setting("torch's loops", {"ATEN_CPU_CAPABILITY": "default"}),
        "MKL, AVX2": Setting("Intel's library in torch", {"MKL_CBWR": "AVX2"}),
        "MKL, any": Setting("Intel's library in torch", {"MKL_CBWR": FIXED["MKL_CBWR"]}),
        "NumPy, AVX2": Setting("NumPy's loops", {NUMPY: v3}),
        "NumPy, SSE": Setting("NumPy's loops", {NUMPY: " ".join(versions)}),
        "OpenBLAS, Haswell": Setting(blas, {"OPENBLAS_CORETYPE": "Haswell"}),
        "OpenBLAS, Nehalem": Setting(blas, {"OPENBLAS_CORETYPE": "Nehalem"}),
        "C, without FMA": Setting("sin, exp, … of C", {GLIBC: portable[GLIBC]}),
        "two threads": Setting("sums in two threads", {"OMP_NUM_THREADS": "2"}),
        **{
            f"{cpu}, {name}": Setting(f"a whole {cpu}, emulated", variables, name, cpu)
            for name, variables in ((PLAIN, {}), (PORTABLE, portable))
            for cpu in ("Nehalem", "Haswell", "EPYC")
        },
    }


DRAWN = tuple(Played(task, 1, PICTURES, 8) for task in ("PickCube-v1", "TwoRobotPickCube-v1"))


def drawings() -> dict[str, Setting]:
    """Return how pictures are drawn, by name; the first is what the others are compared with."""
    caps, width, threads = "GALLIUM_OVERRIDE_CPU_CAPS", "LP_NATIVE_VECTOR_WIDTH", "LP_NUM_THREADS"
    return {
        PLAIN: Setting("Mesa chooses by the processor", {}),
        "once more": Setting("another process", {}),
        **{
            name: Setting(f"`{threads}={n}`", {threads: str(n)})
            for n, name in enumerate(("no threads", "one thread", "two threads"))
        },
        **{f"{n} bits": Setting(f"`{width}={n}`", {width: str(n)}) for n in (128, 256, 512)},
        "AVX": Setting(f"without AVX2, FMA and AVX-512: `{caps}=avx`", {caps: "avx"}),
        "SSE": Setting(f"without AVX, too: `{caps}=sse4.1`", {caps: "sse4.1"}),
        "SwiftShader": Setting("another software driver", {"VK_DRIVER_FILES": SWIFTSHADER}),
    }


def processors(
    *,
    tasks: tuple[str, ...] = (),
    seeds: int = 1,
    settings: tuple[str, ...] = (),
    pictures: bool = False,
    receipts: bool = False,
    out: Path = DOCS / "processors.json",
    render: bool = False,
) -> int:
    """Play episodes as on other processors, and say whose bits differ.

    Args:
        tasks: Task ids (all).
        seeds: Of each expert and control mode.
        settings: Under which settings to play, or to verify receipts, by the names in the page (all
            without QEMU).
        pictures: Play nothing; draw pictures in several ways.
        receipts: Play nothing; verify receipts of policies that see in several ways.
        out: The record, which keeps other settings that were measured before; the page is beside.
        render: Play nothing; write the page of the record anew.

    Raises:
        RobotLayoutsError: If something cannot be played, read or written.
    """
    record = read_record(out, processor="", versions={}, settings={}, portable={})
    record.setdefault("pictures", {})
    record.setdefault("receipts", {})
    if (pictures or receipts) and not render:
        if pictures:
            record["pictures"] = _drawn()
            write_record(out, record)
        for seen in verified(record["receipts"], settings) if receipts else ():
            record["receipts"] = {"processor": _processor(), "driver": _driver(), **seen}
            write_record(out, record)
    elif not render:
        libraries = {**versions_of(*PACKAGES), "glibc": platform.libc_ver()[1]}
        record |= {"processor": _processor(), "versions": record["versions"] | libraries}
        episodes = [
            Played(task, first + i, control, steps)
            for task in tasks or list_tasks()
            for control, (first, steps) in CONTROLS.items()
            for i in range(seeds)
        ]
        for _ in _measured(record, episodes, settings):
            write_record(out, record)
    counts = {
        name: [sum(kind in row for row in seen["different"].values()) for kind in KINDS]
        for name, seen in record["settings"].items()
    }
    write_page(out, "processors", record=record, kinds=KINDS, counts=counts)
    return 0


def _drawn() -> Record:
    """Draw pictures in several ways, and return which of them differ."""
    found: dict[str, list[Digests | None] | None] = {}
    for name, one in tqdm(drawings().items(), disable=None):
        try:
            found[name] = play_under(one, DRAWN)
        except SimulationError:  # the driver ends the process
            found[name] = None
    plain = _by_picture(found[PLAIN])
    ways = {
        name: {
            "about": one.about,
            "images": len(images := _by_picture(found[name])),
            "different": Counter(
                name.rpartition("/")[2]
                for (name, moment), digest in images.items()
                if plain[name, moment] != digest
            ),
        }
        for name, one in drawings().items()
    }
    return {"processor": _processor(), "driver": _driver(), "ways": ways}


def _by_picture(found: Sequence[Digests | None] | None) -> dict[tuple[str, int], str]:
    return {
        (f"{i}/{name}", moment): digest
        for i, digests in enumerate(found or ())
        for name, every in (digests or {}).items()
        for moment, digest in enumerate(every)
    }


def _driver() -> str:
    """Return what draws, and its version."""
    with closing(make("PickCube-v1", obs_mode="rgb")) as task:
        return task.simulation.describe_graphics()["driver"]


def _measured(record: Record, episodes: Sequence[Played], names: Sequence[str]) -> Iterator[None]:
    """Play under settings, note what differs, and yield after each."""
    known = settings()
    asked = names or [name for name, one in known.items() if not one.emulated]
    needed = [name for name in known if any(name in (one, known[one].against) for one in asked)]
    played: dict[str, list[Digests | None]] = {}
    for name in tqdm(needed, disable=None):
        one = known[name]
        played[name] = play_under(one, episodes)
        if name != one.against:
            record["settings"][name] = {
                "about": one.about,
                "against": one.against,
                "episodes": sum(digests is not None for digests in played[name]),
                "different": differences(episodes, played[one.against], played[name]),
            }
        if name == PORTABLE:
            record["portable"] |= physics(episodes, played[name])
        yield


def play_under(setting: Setting, episodes: Sequence[Played]) -> list[Digests | None]:
    """Return the digests of episodes, played in a process of its own.

    Args:
        setting: Under what.
        episodes: Which.

    Raises:
        SimulationError: If there is no emulator, or the process ends before it is through.
    """
    return answers_under(setting, "benchmarks.processors", list(episodes), len(episodes))


def differences(
    episodes: Sequence[Played], one: Sequence[Digests | None], other: Sequence[Digests | None]
) -> dict[str, dict[str, int]]:
    """Return, by episode, the kinds that differ and the first moment at which they do."""
    found: dict[str, dict[str, int]] = {}
    for played, first, second in zip(episodes, one, other, strict=True):
        if first is not None and second is not None and first != second:
            found[str(played)] = dict(_parted(first, second))
    return found


def _parted(one: Digests, other: Digests) -> Iterator[tuple[str, int]]:
    for kind in KINDS:
        pairs = zip(one[kind], other[kind], strict=False)
        at = next((i for i, (a, b) in enumerate(pairs) if a != b), None)
        if at is not None:
            yield kind, at
        elif len(one[kind]) != len(other[kind]):
            yield kind, ABSENT


def physics(episodes: Sequence[Played], found: Sequence[Digests | None]) -> dict[str, str]:
    """Return one digest of all actions and states of each episode."""
    return {
        str(played): sha256(" ".join(one["actions"] + one["states"]).encode()).hexdigest()[:16]
        for played, one in zip(episodes, found, strict=True)
        if one is not None
    }


def digests(played: Played) -> Digests | None:
    """Return the digests of an episode, one per moment; None if its robots lack the mode."""
    if played.control == PICTURES:
        return _picture_digests(played)
    mode = None if played.control == EXPERT else played.control
    try:
        task = make(played.task, control_mode=mode)
    except (DescriptorError, TaskError):
        return None
    found: Digests = {kind: [] for kind in KINDS}

    def note(**values: Any) -> None:
        for kind, value in values.items():
            found[kind].append(sha256(_bytes(value)).hexdigest()[:12])

    with closing(task):
        actions = _actions(task, played)
        observation, _ = task.reset(played.seed, REBUILT)
        note(states=task.get_state_dict(), observations=observation)
        for action in actions:
            observation, reward, _, _, _ = task.step(action[None])
            note(actions=action, states=task.get_state_dict())
            note(observations=observation, rewards=reward)
    return found


def _picture_digests(played: Played) -> Digests:
    """Return the digests of an episode's pictures by camera and texture, one per moment."""
    robots = dict.fromkeys(get_task_class(played.task).layout, "panda_wristcam")
    found: Digests = {}
    with closing(make(played.task, robots=robots, obs_mode=TEXTURES, cameras=CAMERAS)) as task:
        observation, _ = task.reset(played.seed, REBUILT)
        for action in [*_actions(task, played), None]:
            for name, picture in pictures_of(observation).items():
                found.setdefault(name, []).append(picture_digest(picture[0].numpy()).hex()[:12])
            if action is not None:
                observation, *_ = task.step(action[None])
    return found


def _actions(task: TaskEnv, played: Played) -> Sequence[Any] | NDArray[np.float32]:
    if played.control == EXPERT:
        return np.asarray(find_expert(played.task)(task, played.seed), np.float32)
    space = task.single_action_space
    low, high = (
        np.where(np.isfinite(bound), bound, sign * REACH).astype(float)
        for bound, sign in ((space.low, -1), (space.high, 1))
    )
    shares = (Stream(played.seed).numbers(len(low), "probe", step) for step in range(played.steps))
    return [(low + np.array(row) * (high - low)).astype(np.float32) for row in shares]


def _bytes(value: Any) -> bytes:
    if isinstance(value, dict):
        return b"".join(str(key).encode() + _bytes(value[key]) for key in sorted(value))
    return np.ascontiguousarray(value).tobytes()


def _processor() -> str:
    """Return what the processor calls itself."""
    with open("/proc/cpuinfo", encoding="utf-8") as lines:
        names = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
        return next(names, "unknown")


if __name__ == "__main__":
    torch.set_num_threads(int(os.environ.get("OMP_NUM_THREADS", "1")))
    for row in json.load(sys.stdin):
        print(json.dumps(digests(Played(*row))), flush=True)

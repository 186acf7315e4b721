"""``python -m parity rollout``: one episode in native and here, every array of it kept in files."""

from __future__ import annotations

import argparse
import json
import platform
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

import tasks
from experts import find_expert
from parity.compare.both_sides import NativeSide, OurSide, Side
from parity.compare.episodes import recorded_episodes
from parity.compare.native_env import native_agents
from parity.compare.printed import versions
from parity.compare.snapshot import Snapshot, largest_difference
from parity.compare.task_summary import number_text
from parity.show.native_pictures import NativeScene
from robots import CONTROL_MODES, RecordingError, RobotLayoutsError
from robots.common.writing import written_whole
from rollouts.progress import LiveLine
from rollouts.reading.recording import TrajectoryError
from rollouts.video import open_video
from tasks import MultiRobotTask
from tasks.episode import Episode
from tasks.native.format import articulation_keys

Arrays = dict[str, NDArray[Any]]

NATIVE_FILE, OUR_FILE, VIDEO_FILE = "maniskill.npz", "robot_layouts.npz", "maniskill.mp4"
ACTIONS = "actions"
METADATA = "metadata"  # the array that holds a json text about the others
PICTURE_SIZE = 320  # pixels; a software driver takes 0.1 s for one
LEGEND = {
    ACTIONS: "flat, every robot's numbers in the order of action_split",
    "*.pose, *.tcp_pose": "position (m) and quaternion (wxyz), world frame",
    "*.velocity": "linear (m/s) and angular (rad/s), world frame",
    "*.root": "pose and velocity of a robot's root, like both",
    "*.qpos, *.qvel": "joints in SAPIEN's order (rad, m; per s)",
    "rows": "T of actions, reward and terminated; T + 1 of the rest, the first after the reset",
}

_OBJECT_PARTS = {"object pose": "pose", "object velocity": "velocity"}
_ROBOT_PARTS = ("qpos", "qvel", "root")


@dataclass(frozen=True)
class Source:
    """An episode to play and where it comes from.

    Attributes:
        name: In a few words, for example ``"expert"``.
        episode: What to play.
        control_mode: What its actions mean, one of `robots.CONTROL_MODES`.
    """

    name: str
    episode: Episode
    control_mode: str = CONTROL_MODES[0]


@dataclass(frozen=True)
class Rollout:
    """What playing one episode on both sides found.

    Attributes:
        source: What was played.
        differences: max |Δ| of each array.
        native_success: Whether native reported success at any step.
        our_success: Whether our side did.
    """

    source: Source
    differences: Mapping[str, float]
    native_success: bool
    our_success: bool

    @property
    def max_difference(self) -> float:
        """Largest |Δ| of all arrays."""
        return max(self.differences.values())


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.epilog = (
        f"Keeps every array of both sides in DIR/TASK/{NATIVE_FILE} and {OUR_FILE}, films native,"
        " and compares the two. Exit code: 0 if every difference is exactly zero, 1 if not, 2 for"
        " bad usage."
    )
    add = parser.add_argument
    add("--task", required=True, metavar="TASK", help="task id")
    add("--demo", type=Path, metavar="FILE", help="play this file's actions, not the expert's")
    add(
        "--seed",
        type=int,
        metavar="S",
        help="reset seed (0); of --demo, the episode with it (its first)",
    )
    add("--out", type=Path, default=Path("runs"), metavar="DIR", help="folder (%(default)s)")
    add("--no-video", action="store_true", help="make no film of native")


def run(args: argparse.Namespace) -> int:
    """Run the command; returns 0 if both sides are equal, 1 if not.

    Raises:
        RobotLayoutsError: If they could not be played.
    """
    torch.set_num_threads(1)  # the tensors are small
    cls = tasks.get_task_class(args.task)
    source = find_source(cls, args.demo, args.seed)
    folder = args.out / cls.task_id
    with LiveLine(2 * len(source.episode.actions)) as line:
        found = roll_out(
            cls.task_id,
            source,
            folder,
            video=not args.no_video,
            on_step=lambda side: line.advance(1, f"{cls.task_id} {side}"),
        )
    console = Console(highlight=False)
    console.print(f"{cls.task_id}: max |Δ| against native")
    console.print(differences_table(found.differences))
    equal = found.max_difference == 0
    print(
        f"{'Bitwise equal' if equal else 'NOT equal'}: {source.name}, seed"
        f" {source.episode.seed}, {len(source.episode.actions)} steps; success in native"
        f" {_yes(found.native_success)}, here {_yes(found.our_success)}. Files in {folder}"
    )
    return 0 if equal else 1


def find_source(cls: type[MultiRobotTask], demo: Path | None, seed: int | None) -> Source:
    """Return the episode to play: a recorded one, or the expert's.

    Args:
        cls: The task.
        demo: File of recorded episodes; None asks the task's expert.
        seed: Reset seed; None takes the file's first episode, or seed 0.

    Raises:
        TrajectoryError: If the file cannot be read or has no episode of that seed.
        TaskError: If there is no file and the task has no expert.
    """
    if demo is None:
        return expert_source(cls, 0 if seed is None else seed)
    episodes, mode = recorded_episodes(demo, cls)
    for episode in episodes:
        if seed in (None, episode.seed):
            return Source(demo.name, episode, mode)
    seeds = ", ".join(str(episode.seed) for episode in episodes)
    raise TrajectoryError(f"{demo} has no episode of seed {seed}; it has seeds {seeds}")


def expert_source(cls: type[MultiRobotTask], seed: int) -> Source:
    """Return what a task's expert does with a seed.

    Raises:
        TaskError: If the task has no expert.
    """
    expert = find_expert(cls.task_id)
    env = tasks.make(cls.task_id)
    try:
        return Source("expert", Episode(seed, np.asarray(expert(env, seed), np.float32)))
    finally:
        env.close()


def roll_out(
    task_id: str,
    source: Source,
    folder: Path,
    *,
    video: bool = True,
    on_step: Callable[[str], None] = lambda side: None,
) -> Rollout:
    """Play an episode in native and here, and write both to files.

    Args:
        task_id: The task.
        source: What to play, from the reset of a scene that was built anew.
        folder: Where the files go; it is made.
        video: Whether to film native.
        on_step: Called after every step with the name of the side.

    Raises:
        RobotLayoutsError: If a side cannot be made or a file not be written.
    """
    env = tasks.make(task_id, control_mode=source.control_mode)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        native = _play_native(env, source.episode, folder if video else None, on_step)
        ours = play(
            OurSide(env),
            source.episode,
            articulation_keys(env.layout),
            lambda: _our_tcp_poses(env),
            lambda: on_step("here"),
        )
        for name, arrays in ((NATIVE_FILE, native), (OUR_FILE, ours)):
            save(folder / name, arrays, describe(env, source, name))
    except OSError as error:
        if isinstance(error, RobotLayoutsError):
            raise
        raise RecordingError(f"cannot write into {folder}: {error}") from error
    finally:
        env.close()
    return Rollout(source, compare_arrays(native, ours), *map(_succeeded, (native, ours)))


def play(
    side: Side,
    episode: Episode,
    keys: Mapping[str, str],
    tcp_poses: Callable[[], Arrays],
    watch: Callable[[], None] = lambda: None,
) -> Arrays:
    """Play an episode from a scene built anew, and return everything that happened.

    Args:
        side: Native or ours, one environment.
        episode: What to play, T steps.
        keys: Robot name → its key in native's state dict.
        tcp_poses: Reads the pose of every robot's TCP now, robot name → (7,).
        watch: Called after the reset and after every step.

    Returns:
        By name: ``actions`` (T, A), ``reward`` (T,), ``observation`` (T + 1, D), ``info.success``
        and the like, ``left.qpos``, ``left.tcp_pose``, ``cube.pose`` and so on.
    """
    names = {key: robot for robot, key in keys.items()}
    rows: list[Arrays] = []

    def note(snapshot: Snapshot) -> None:
        tcps = {f"{robot}.tcp_pose": pose for robot, pose in tcp_poses().items()}
        rows.append(_named(snapshot, names) | tcps)
        watch()

    note(side.reset([episode.seed], [0], rebuild=True))
    for action in episode.actions:
        note(side.step(action[None]))
    # What only the reset tells, such as that it rebuilt the scene, is no course of events.
    columns = {name: [row[name] for row in rows if name in row] for name in rows[-1]}
    return {ACTIONS: episode.actions, **{name: np.stack(c) for name, c in columns.items()}}


def _named(snapshot: Snapshot, robots: Mapping[str, str]) -> Arrays:
    """Return the one row of a snapshot under the names of a file's arrays."""
    found: Arrays = {}
    for (quantity, entry), values in snapshot.items():
        if quantity in _OBJECT_PARTS:
            name = f"{entry}.{_OBJECT_PARTS[quantity]}"
        elif quantity in _ROBOT_PARTS:
            name = f"{robots[entry]}.{quantity}"
        elif quantity == "info" and entry != "terminated":
            name = f"info.{entry}"
        else:
            name = entry
        found[name] = values[0]
    return found


def _play_native(
    env: MultiRobotTask, episode: Episode, film: Path | None, on_step: Callable[[str], None]
) -> Arrays:
    mode, size = str(env.control_mode), PICTURE_SIZE if film else None
    side = NativeSide(env.task_id, control_mode=mode, picture_size=size)
    native, keys = side.envs[0], articulation_keys(env.layout)

    def poses() -> Arrays:
        return dict(zip(keys, map(_native_tcp_pose, native_agents(native)), strict=True))

    try:
        if film is None:
            return play(side, episode, keys, poses, lambda: on_step("native"))
        scene = NativeScene(native)
        with open_video(film / VIDEO_FILE, env.scenario.control_frequency) as append:

            def watch() -> None:
                append(scene.live())
                on_step("native")

            return play(side, episode, keys, poses, watch)
    finally:
        side.close()


def _native_tcp_pose(agent: Any) -> NDArray[np.float32]:
    pose = agent.tcp_pose if hasattr(agent, "tcp_pose") else agent.tcp.pose
    return pose.raw_pose[0].numpy().copy()


def _our_tcp_poses(env: MultiRobotTask) -> Arrays:
    state = env.simulation.read()
    return {robot: state.tcp_pose(robot)[0].copy() for robot in env.layout}


def describe(env: MultiRobotTask, source: Source, name: str) -> dict[str, Any]:
    """Return what a file says about its arrays, as plain data."""
    return {
        "task": env.task_id,
        "side": "native ManiSkill" if name == NATIVE_FILE else "robot-layouts",
        "source": source.name,
        "seed": source.episode.seed,
        "reset": {"seed": source.episode.seed, "options": {"reconfigure": True}},
        "control_mode": env.control_mode,
        "reward_mode": env.reward_mode,
        "control_frequency": env.scenario.control_frequency,
        "robots": {place: p.robot.name for place, p in env.layout.items()},
        "action_split": {place: [s.start, s.stop] for place, s in env.action_split.items()},
        "arrays": LEGEND,
        "versions": versions(),
        "machine": platform.machine(),
    }


def save(path: Path, arrays: Arrays, about: Mapping[str, Any]) -> None:
    """Write arrays and a json text about them; the file appears when it is whole."""
    everything: dict[str, Any] = {**arrays, METADATA: np.array(json.dumps(about))}
    with written_whole(path, RecordingError) as partial, partial.open("wb") as file:
        np.savez_compressed(file, **everything)


def load(path: Path) -> tuple[Arrays, dict[str, Any]]:
    """Read what `save` wrote: the arrays, and what it says about them."""
    with np.load(path, allow_pickle=False) as data:
        arrays = {name: data[name] for name in data.files if name != METADATA}
        return arrays, json.loads(str(data[METADATA]))


def compare_arrays(first: Mapping[str, Any], second: Mapping[str, Any]) -> dict[str, float]:
    """Return max |Δ| of each array that was seen; infinite where only one of the sides has it.

    The actions are what both were given.
    """
    seen = [name for name in dict.fromkeys([*first, *second]) if name != ACTIONS]
    return {
        name: largest_difference(first[name], second[name])
        if name in first and name in second
        else np.inf
        for name in seen
    }


def differences_table(differences: Mapping[str, float]) -> Table:
    """Return max |Δ| of each array; the many that are alike, such as drawn dots, in one row."""
    rows = Table(box=box.SIMPLE_HEAD, show_edge=False)
    rows.add_column("array", no_wrap=True)
    rows.add_column("max |Δ|", justify="right")
    alike: dict[str, list[float]] = {}
    for name, largest in differences.items():
        alike.setdefault(_without_number(name), []).append(largest)
    for name, found in alike.items():
        label = name if len(found) == 1 else f"{name} ({len(found)} arrays)"
        largest = max(found)
        style = "green" if largest == 0 else "bold red"
        rows.add_row(label, Text(number_text(largest), style=style))
    return rows


def _without_number(name: str) -> str:
    head, dot, part = name.partition(".")
    stem, _, number = head.rpartition("_")
    return f"{stem}_*{dot}{part}" if number.isdigit() else name


def _succeeded(arrays: Arrays) -> bool:
    return bool(np.any(arrays["info.success"][1:]))


def _yes(value: bool) -> str:
    return "yes" if value else "no"

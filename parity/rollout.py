"""``python -m parity rollout``: one episode in native and here, every array of it kept in files."""

from __future__ import annotations

import json
import platform
from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text
from tqdm import tqdm

import tasks
from parity.episodes import Source, expert_source, recorded_source
from parity.lockstep import NativeSide, OurSide, Side, Snapshot, largest_difference
from parity.native import native_agents
from parity.results import number_text, versions
from parity.scene import NativeScene
from robot_layouts.core.writing import written_whole
from robot_layouts.data.reading.json_files import TrajectoryError
from robot_layouts.data.video import open_video
from tasks import MultiRobotTask, TaskEnv
from tasks.episode import Episode
from tasks.native.format import articulation_keys

Arrays = dict[str, NDArray[Any]]

NATIVE_FILE, OUR_FILE, VIDEO_FILE = "maniskill.npz", "robot_layouts.npz", "maniskill.mp4"
METADATA = "metadata"  # the array that holds a json text about the others
PICTURE_SIZE = 320  # pixels; a software driver takes 0.1 s for one
LEGEND = {
    "actions": "flat, every robot's numbers in the order of action_split",
    "*.pose, *.tcp_pose": "position (m) and quaternion (wxyz), world frame",
    "*.velocity": "linear (m/s) and angular (rad/s), world frame",
    "*.root": "pose and velocity of a robot's root, like both",
    "*.qpos, *.qvel": "joints in SAPIEN's order (rad, m; per s)",
    "rows": "T of actions, reward and terminated; T + 1 of the rest, the first after the reset",
}


def rollout(
    *,
    task: str,
    demo: Path | None = None,
    seed: int | None = None,
    out: Path = Path("runs"),
    no_video: bool = False,
) -> int:
    """Play one episode in native and here, and keep every array of both sides in files.

    Exit code: 0 if every difference is exactly zero, 1 if not.

    Args:
        task: Task id.
        demo: Play this file's actions, not the expert's.
        seed: Reset seed (0); of --demo, the episode with it (its first).
        out: The files go into OUT/TASK.
        no_video: Make no film of native.

    Raises:
        RobotLayoutsError: If they could not be played.
    """
    torch.set_num_threads(1)  # the tensors are small
    cls = tasks.get_task_class(task)
    source = find_source(cls, demo, seed)
    (episode,), folder = source.episodes, out / cls.task_id
    with tqdm(total=2 * len(episode.actions), desc=cls.task_id, unit="steps", disable=None) as bar:
        found = roll_out(cls.task_id, source, folder, video=not no_video, on_step=bar.update)
    equal = all(largest == 0 for largest in found.values())
    console = Console(highlight=False)
    console.print(f"{cls.task_id}: max |Δ| against native")
    console.print(differences_table(found))
    verdict = "Bitwise equal" if equal else "NOT equal"
    steps = len(episode.actions)
    print(f"{verdict}: {source.name}, seed {episode.seed}, {steps} steps. Files in {folder}")
    return 0 if equal else 1


def find_source(cls: type[MultiRobotTask], demo: Path | None, seed: int | None) -> Source:
    """Return the one episode to play: a recorded one, or the expert's.

    Args:
        cls: The task.
        demo: File of recorded episodes; None asks the task's expert.
        seed: Reset seed; None takes the file's first episode, or seed 0.

    Raises:
        TrajectoryError: If the file cannot be read or has no episode of that seed.
        TaskError: If there is no file and the task has no expert.
    """
    if demo is None:
        return expert_source(cls, [seed or 0])
    recorded = recorded_source(demo, cls)
    for episode in recorded.episodes:
        if seed in (None, episode.seed):
            return replace(recorded, episodes=(episode,))
    seeds = ", ".join(str(episode.seed) for episode in recorded.episodes)
    raise TrajectoryError(f"{demo} has no episode of seed {seed}; it has seeds {seeds}")


def roll_out(
    task_id: str,
    source: Source,
    folder: Path,
    *,
    video: bool = True,
    on_step: Callable[[], object] = lambda: None,
) -> dict[str, float]:
    """Play an episode in native and here, and write both to files.

    Args:
        task_id: The task.
        source: What to play, one episode, from the reset of a scene that was built anew.
        folder: Where the files go; it is made.
        video: Whether to film native.
        on_step: Called after every reset and step of a side.

    Returns:
        max |Δ| of each array; infinite where only one of the sides has it.

    Raises:
        RobotLayoutsError: If a side cannot be made or a file not be written.
    """
    (episode,) = source.episodes
    with closing(tasks.make(task_id, control_mode=source.control_mode)) as env:
        native = _play_native(env, episode, folder if video else None, on_step)
        side, keys = OurSide(env), articulation_keys(env.layout)
        ours = play(side, episode, keys, lambda: _our_tcp_poses(env), on_step)
        for name, arrays in ((NATIVE_FILE, native), (OUR_FILE, ours)):
            save(folder / name, arrays, _describe(env, source, name))
    return {
        name: largest_difference(native[name], ours[name])
        if name in native and name in ours
        else np.inf
        for name in dict.fromkeys([*native, *ours])
        if name != "actions"  # both were given them
    }


def play(
    side: Side,
    episode: Episode,
    keys: Mapping[str, str],
    tcp_poses: Callable[[], Arrays],
    watch: Callable[[], object] = lambda: None,
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
    robots = {key: robot for robot, key in keys.items()}
    rows: list[Arrays] = []

    def note(snapshot: Snapshot) -> None:
        tcps = {f"{robot}.tcp_pose": pose for robot, pose in tcp_poses().items()}
        named = {_name(*key, robots): values[0] for key, values in snapshot.items()}
        rows.append(named | tcps)
        watch()

    note(side.reset([episode.seed], [0], rebuild=True))
    for action in episode.actions:
        note(side.step(action[None]))
    # What only the reset reports, such as that it rebuilt the scene, is left out.
    columns = {name: [row[name] for row in rows if name in row] for name in rows[-1]}
    return {"actions": episode.actions, **{name: np.stack(c) for name, c in columns.items()}}


def _name(quantity: str, entry: str, robots: Mapping[str, str]) -> str:
    """Return what an array of a snapshot is called in a file."""
    if quantity.startswith("object "):
        return f"{entry}.{quantity.removeprefix('object ')}"
    if quantity in ("qpos", "qvel", "root"):
        return f"{robots[entry]}.{quantity}"
    return f"info.{entry}" if quantity == "info" and entry != "terminated" else entry


def _play_native(
    env: TaskEnv, episode: Episode, film: Path | None, on_step: Callable[[], object]
) -> Arrays:
    mode, size = str(env.control_mode), PICTURE_SIZE if film else None
    keys = articulation_keys(env.layout)
    with closing(NativeSide(env.task_id, control_mode=mode, picture_size=size)) as side:

        def poses() -> Arrays:
            agents = native_agents(side.envs[0])
            return dict(zip(keys, map(_native_tcp_pose, agents), strict=True))

        if film is None:
            return play(side, episode, keys, poses, on_step)
        scene = NativeScene(side.envs[0])
        with open_video(film / VIDEO_FILE, env.scenario.control_frequency) as append:

            def watch() -> None:
                append(scene.live())
                on_step()

            return play(side, episode, keys, poses, watch)


def _native_tcp_pose(agent: Any) -> NDArray[np.float32]:
    pose = agent.tcp_pose if hasattr(agent, "tcp_pose") else agent.tcp.pose
    return pose.raw_pose[0].numpy().copy()


def _our_tcp_poses(env: TaskEnv) -> Arrays:
    state = env.simulation.read()
    return {robot: state.tcp_pose(robot)[0].copy() for robot in env.layout}


def _describe(env: TaskEnv, source: Source, name: str) -> dict[str, Any]:
    """Return what a file says about its arrays, as plain data."""
    seed = source.episodes[0].seed
    return {
        "task": env.task_id,
        "side": "native ManiSkill" if name == NATIVE_FILE else "robot-layouts",
        "source": source.name,
        "seed": seed,
        "reset": {"seed": seed, "options": {"reconfigure": True}},
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
    with written_whole(path) as partial, partial.open("wb") as file:
        np.savez_compressed(file, **everything)


def load(path: Path) -> tuple[Arrays, dict[str, Any]]:
    """Read what `save` wrote: the arrays, and what it says about them."""
    with np.load(path, allow_pickle=False) as data:
        arrays = {name: data[name] for name in data.files if name != METADATA}
        return arrays, json.loads(str(data[METADATA]))


def differences_table(differences: Mapping[str, float]) -> Table:
    """Return max |Δ| of each array; the many that are alike, such as drawn dots, in one row."""
    rows = Table(box=box.SIMPLE_HEAD, show_edge=False)
    rows.add_column("array", no_wrap=True)
    rows.add_column("max |Δ|", justify="right")
    alike: dict[str, list[float]] = {}
    for name, largest in differences.items():
        head, dot, part = name.partition(".")
        stem, _, number = head.rpartition("_")
        alike.setdefault(f"{stem}_*{dot}{part}" if number.isdigit() else name, []).append(largest)
    for name, found in alike.items():
        label = name if len(found) == 1 else f"{name} ({len(found)} arrays)"
        largest = max(found)
        style = "green" if largest == 0 else "bold red"
        rows.add_row(label, Text(number_text(largest), style=style))
    return rows

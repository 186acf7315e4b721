"""Recordings that were complete, of which bits or more have changed since."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import h5py

from robot_layouts.data.export.dataset import Export, export
from robot_layouts.data.playing.replay import open_recording, replay
from robot_layouts.data.reading.recorded_task import task_for
from robot_layouts.data.viewing import episode_cell
from tests.faults.fault import GOES_ON, Fault, each
from tests.faults.recording_files import (
    AREA,
    BODY,
    SEEDS,
    edit_json,
    episodes,
    expect_whole,
    go_on,
    recorder,
    recording,
)


def faults() -> Iterator[Fault]:
    """Go through them."""
    for where in ("actions", "rewards", "success", BODY, "episode"):
        what = f"recording: a bit of {where} flips before"
        yield Fault(AREA, f"{what} it goes on", partial(_flip_and_go_on, where), GOES_ON)
        for use in (_replay, _export_lerobot, _export_robomimic, _view):
            run = partial(_flip_and_use, where, use)
            yield Fault(AREA, f"{what} the {use.__name__.lstrip('_')}", run)
    yield from each(AREA, "recording: {}", _joined, _JOINED, GOES_ON)
    yield Fault(AREA, "recording: somebody added an array of their own", _added, GOES_ON)
    yield Fault(AREA, "recording: a group of somebody else is there", _group)


def _flip(path: Path, where: str) -> None:
    """Change one bit where an array or the text of an attribute is stored."""
    content = bytearray(path.read_bytes())
    if where == "episode":
        place = content.index(b'"elapsed_steps": 4') + 17
    else:
        with h5py.File(path) as file:
            place = file[f"traj_1/{where}"].id.get_offset()
    content[place] ^= 1
    path.write_bytes(content)


def _flip_and_go_on(where: str, folder: Path) -> str:
    path = recording(folder)
    _flip(path, where)
    return go_on(path)


def _flip_and_use(where: str, use: Callable[[Path], Any], folder: Path) -> None:
    path = recording(folder)
    _flip(path, where)
    use(path)


def _replay(path: Path) -> None:
    with open_recording(path, None) as file:
        task = task_for(file)
        for episode in file:
            replay(task, episode)


def _export_lerobot(path: Path) -> None:
    _export(path, "lerobot")


def _export_robomimic(path: Path) -> None:
    _export(path, "robomimic")


def _export(path: Path, format_name: str) -> None:
    try:
        export(Export(path, format_name, path.parent / "out", include_failures=True))
    finally:
        assert sorted(p.name for p in path.parent.iterdir()) == [path.name, "trajectory.json"]


def _view(path: Path) -> None:
    with open_recording(path, None) as file:
        episode_cell(file, 1)


def _joined(folder: Path, change: Callable[[Path], None]) -> str:
    path = recording(folder)
    change(path)
    return go_on(path)


def _added(folder: Path) -> str:
    path = recording(folder)
    _h5(lambda file: file.__setitem__("traj_0/more", [1.0, 2.0]))(path)
    _h5(lambda file: file["traj_0"].attrs.__setitem__("note", "text"))(path)
    _h5(lambda file: file.__delitem__("traj_2"))(path)
    with recorder(path, resume=True) as again:
        assert again.damaged == []
        again.add(episodes()[2])
    expect_whole(path)
    with h5py.File(path) as file:
        assert file["traj_0/more"][()].tolist() == [1.0, 2.0]
        assert file["traj_0"].attrs["note"] == "text"
    return "it is kept"


def _group(folder: Path) -> None:
    path = recording(folder)
    _h5(lambda file: file.create_group("mine"))(path)
    recorder(path, resume=True)


def _h5(edit: Callable[[h5py.File], Any]) -> Callable[[Path], None]:
    def change(path: Path) -> None:
        with h5py.File(path, "r+") as file:
            edit(file)

    return change


def _swap_groups(file: h5py.File) -> None:
    file.move("traj_0", "x")
    file.move("traj_1", "traj_0")
    file.move("x", "traj_1")


_JOINED: dict[str, Callable[[Path], None]] = {
    "an episode is deleted": _h5(lambda file: file.__delitem__("traj_1")),
    "an array is deleted": _h5(lambda file: file.__delitem__("traj_1/rewards")),
    "an episode is a link to another one": _h5(
        lambda file: (
            file.__delitem__("traj_1"),
            file.__setitem__("traj_1", h5py.SoftLink("/traj_0")),
        )
    ),
    "an array is in another file": _h5(
        lambda file: (
            file.__delitem__("traj_1/rewards"),
            file["traj_1"].create_dataset("rewards", (4,), "f4", external="/etc/passwd"),
        )
    ),
    "two episodes have each other's group": _h5(_swap_groups),
    "the checksum is another's": _h5(
        lambda file: file["traj_1"].attrs.__setitem__("checksum", file["traj_0"].attrs["checksum"])
    ),
    "the json is missing": lambda path: path.with_suffix(".json").unlink(),
    "the json lists other seeds": lambda path: edit_json(
        path, lambda summary: summary["episodes"][0].update(episode_seed=SEEDS[1])
    ),
    "the json is 100,000 deep": lambda path: (
        path.with_suffix(".json").write_text("[" * 100_000),
        None,
    )[1],
}

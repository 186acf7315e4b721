"""What a task observes: which parts, in which form, and with which cameras."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Any

import numpy as np
from gymnasium.spaces import Box, Dict, Space

from layouts import Layout
from robot_layouts.simulation import Camera, Simulation, State
from robot_layouts.simulation.cameras import (
    RAW,
    SHADERS,
    TEXTURES,
    camera_name,
    ridden,
    shaders_for,
    told_by,
)
from robot_layouts.simulation.maths import Array, Floats, all_finite
from robots import TaskError, unknown_name_message
from tasks.engine.cameras import Configs, Size, cameras_of, configured, expect_apart, resized
from tasks.engine.columns import (
    COLUMN_MODES,
    FILMED,
    LEROBOT,
    ROBOMIMIC,
    ColumnObserver,
    Viewpoint,
    picture_column,
)
from tasks.engine.divergence import NotFinite
from tasks.engine.pictures import POINTS, SHOWN, CameraRig, Pictures, as_picture, as_points
from tasks.native import controllers
from tasks.native.format import observation_keys
from tasks.randomization.noise import Noisy

JOINTS = "qpos", "qvel"  # that every robot observes of itself
TIPS = "tip_poses"  # that it observes besides if it has `robots.NativeAgent.tip_links`
STATE_FORMS = ("state", "state_dict")  # what may be joined to images
_JOINED = {"pointcloud": POINTS, "none": ()}  # what native takes in their company, too


@dataclass(frozen=True)
class ObservationMode:
    """What an ``obs_mode`` asks for.

    Attributes:
        textures: What cameras record of each pixel, in native's order; None if none observes.
            `RAW` alone stands for the images that their shaders store.
        flat: Whether everything but images is one flat part.
        privileged: Whether it includes what only a simulation knows.
        points: Whether images are observed as points of the world.
        nothing: Whether nothing is observed.
        columns: Which of `COLUMN_MODES`, if it is the columns of exported datasets that are
            observed.
    """

    textures: tuple[str, ...] | None = None
    flat: bool = False
    privileged: bool = True
    points: bool = False
    nothing: bool = False
    columns: str | None = None

    @property
    def draws(self) -> bool:
        """Whether pictures are observed."""
        return self.textures is not None or self.columns == FILMED

    @property
    def shown(self) -> tuple[str, ...]:
        """What of it people are shown as colours; if that is nothing, colours and depth."""
        textures = SHADERS["minimal"] if self.textures == (RAW,) else self.textures or ()
        return tuple(filter(SHOWN.__contains__, textures)) or ("rgb", "depth")


MODES = {
    "state": ObservationMode(flat=True),
    "state_dict": ObservationMode(),
    "none": ObservationMode(nothing=True),
    **{name: ObservationMode(columns=name) for name in COLUMN_MODES},
    **{
        f"{columns}+cameras{more}": ObservationMode(textures, columns=columns)
        for columns in (LEROBOT, ROBOMIMIC)
        for more, textures in (("", ("rgb",)), ("+depth", ("rgb", "depth")))
    },
    "rgbd": ObservationMode(("rgb", "depth"), privileged=False),
    "pointcloud": ObservationMode(POINTS, privileged=False, points=True),
    "sensor_data": ObservationMode((RAW,), privileged=False),
}
"""The modes that are no textures and forms of state joined by ``+``."""

OBS_MODES = (*MODES, "rgb", "rgb+depth+state", "depth", "rgb+segmentation")
"""Examples of observation modes; images and a form of state are joined in any order."""


def tip_links(layout: Layout) -> dict[str, tuple[str, ...]]:
    """Return the links whose poses robots observe of themselves, of those that do."""
    links = {name: place.robot.native_agent.tip_links for name, place in layout.items()}
    return {name: own for name, own in links.items() if own}


def read_mode(name: str) -> ObservationMode:
    """Return what a mode asks for: ``"state"``, ``"rgb"``, ``"rgb+depth+state_dict"``.

    Raises:
        TaskError: If there is no such mode.
    """
    if not isinstance(name, str):
        raise TaskError(unknown_name_message("obs_mode", name, OBS_MODES))
    if name in MODES:
        return MODES[name]
    parts = set(name.split("+"))
    if not parts <= {*TEXTURES, *STATE_FORMS, *_JOINED}:
        raise TaskError(
            f"{unknown_name_message('obs_mode', name, OBS_MODES)} Besides, any of"
            f" {', '.join(TEXTURES)} are joined by '+', and {' or '.join(STATE_FORMS)} to them"
        )
    wanted = parts.intersection(TEXTURES).union(*(_JOINED[p] for p in parts & _JOINED.keys()))
    textures = tuple(t for t in SHADERS[shaders_for(wanted)] if t in wanted)
    return ObservationMode(
        textures, flat="state" in parts, privileged=not parts.isdisjoint(STATE_FORMS)
    )


class Observer:
    """Puts observations together.

    Attributes:
        mode: What is asked for.
        cameras: Camera by its name in observations; none if they are not used.
    """

    def __init__(
        self,
        layout: Layout,
        mode: ObservationMode,
        cameras: Iterable[Camera],
        sensed: Sequence[str],
        viewpoint: Viewpoint,
        size: Size | None = None,
        *,
        configs: Configs | None = None,
        shown: bool = False,
    ) -> None:
        """Remember how to observe.

        Args:
            layout: The robots.
            mode: What to observe.
            cameras: The task's own cameras.
            sensed: See `tasks.MultiRobotTask`.
            viewpoint: From where people see the task.
            size: Width and height of all pictures (pixels); None: each camera's own.
            configs: What of them is otherwise; see `tasks.Scenario.sensor_configs`.
            shown: Whether people are shown what the cameras see.

        Raises:
            TaskError: If images are asked for, to observe or to show, and there is no camera, or
                two have the same name, or ``configs`` are invalid.
            SimulationError: If a camera's shaders do not tell what is asked for.
        """
        self.mode = mode
        looks = shown or mode.textures is not None
        found = cameras_of(layout, cameras) if looks or configs else {}
        found = {name: resized(camera, size) for name, camera in found.items()}
        found = configured(found, configs or {}, "sensor_configs")
        self.cameras = found if looks else {}
        if looks and not found:
            raise TaskError("there is no camera: the task declares none, nor do its robots")
        for camera in self.cameras.values():
            told_by(camera, mode.textures or ())
        self._keys, self._robots, self._sensed = observation_keys(layout), tuple(layout), sensed
        self._tips = tip_links(layout)
        self._rigs: dict[tuple[str, ...], CameraRig] = {}  # by what they take
        self._columns = ColumnObserver(layout, mode.columns, viewpoint) if mode.columns else None
        if mode.columns:
            expect_apart(name for *_, name in self._picture_columns())

    def observe(
        self,
        simulation: Simulation,
        state: State,
        parts: Mapping[str, Array],
        noisy: Noisy | None = None,
    ) -> Any:
        """Return an observation of all environments.

        Args:
            simulation: The worlds.
            state: What they look like now.
            parts: What the task observes of them; see `tasks.MultiRobotTask.observe`.
            noisy: What adds noise to named parts; None adds none.

        Raises:
            TaskError: If something that robots sense is not observed at all.
            NotFinite: If a number is not finite.
        """
        if self.mode.nothing:
            return {}
        if self._columns:
            observed = self._columns.observe(simulation, state)
            textures = self.mode.textures
            seen = self._look(simulation, textures)["sensor_data"] if textures else {}
            for camera, texture, name in self._picture_columns():
                observed[name] = seen[camera][texture]
            return observed
        if not self.mode.privileged:
            parts = self._sensible(parts)
        if noisy is not None:
            parts = {name: noisy(name, values) for name, values in parts.items()}
        if self.mode.textures is None:
            return self._state(simulation, state, parts, noisy)
        images = self._look(simulation, self.mode.textures)
        if self.mode.points:
            images = as_points(images)
        seen = self._state(simulation, state, parts, noisy)
        return {**images, "state": seen} if self.mode.flat else {**seen, **images}

    def pictures(self, simulation: Simulation) -> list[Pictures]:
        """Return what each camera sees in colours, for people, (N, H, W, 3) each."""
        shown, observed = self.mode.shown, self.mode.textures or ()
        look = self._look(simulation, observed if {*shown} <= {*observed} else shown)
        return [
            as_picture(texture, images[texture])
            for images in look["sensor_data"].values()
            for texture in shown
        ]

    def senses(self, part: str) -> bool:
        """Return whether a part of `tasks.MultiRobotTask.observe` is observed beside images."""
        return any(fnmatchcase(part, pattern) for pattern in self._sensed)

    def seen_by(self, robot: str) -> list[str]:
        """Return the names of the cameras that stand still, and of those that ride on a robot."""
        return [
            name
            for name, camera in self.cameras.items()
            if (on := ridden(camera)) is None or on[0] == robot
        ]

    def changed(self, env_ids: Iterable[int]) -> None:
        """Note that these environments do not look any more as they did."""
        for rig in self._rigs.values():
            rig.stale.update(env_ids)

    def close(self) -> None:
        """Let the cameras go, and what else was made to observe."""
        self._rigs = {}
        if self._columns:
            self._columns.close()

    def names(self, parts: Mapping[str, Array]) -> list[str]:
        """Return the names of all that noise may be added to.

        Raises:
            TaskError: If the columns of datasets are observed, which have none.
        """
        if self.mode.columns:
            raise TaskError(
                f"sensor_noise is not added to obs_mode {self.mode.columns!r}; it is to"
                f" {', '.join(STATE_FORMS)} and what is observed beside images"
            )
        own = [f"{robot}.{joints}" for robot in self._robots for joints in JOINTS]
        return [*own, *(f"{robot}.{TIPS}" for robot in self._tips), *parts]

    def slices(
        self, simulation: Simulation, state: State, parts: Mapping[str, Array]
    ) -> dict[str, slice]:
        """Return where each named part stands in the flat observation; nothing if there is none."""
        if not self.mode.flat:
            return {}
        sizes: dict[str, int] = {}
        kept = controllers.entries(simulation)
        for name in self._robots:
            sizes[f"{name}.qpos"] = sizes[f"{name}.qvel"] = state.qpos(name).shape[1]
            for entry in kept:
                if entry.robot == name:
                    key = f"{name}.{controllers.CONTROLLER}.{entry.key.replace('/', '.')}"
                    sizes[key] = sum(entry.sizes)
            if name in self._tips:
                sizes[f"{name}.{TIPS}"] = state.link_poses(name, self._tips[name]).shape[1]
        sizes.update({key: x.shape[1] if x.ndim == 2 else 1 for key, x in parts.items()})
        slices, start = dict[str, slice](), 0
        for name, size in sizes.items():
            slices[name] = slice(start, start + size)
            start += size
        return slices

    # -- inside ------------------------------------------------------------------------------

    def _look(self, simulation: Simulation, textures: tuple[str, ...]) -> dict[str, Any]:
        if textures not in self._rigs:
            self._rigs[textures] = CameraRig(simulation, self.cameras, textures)
        return self._rigs[textures].look()

    def _picture_columns(self) -> list[tuple[str, str, str]]:
        """Return camera, texture and the name of its column, of each picture of an export."""
        return [
            (
                name,
                texture,
                picture_column(str(self.mode.columns), camera_name(camera), texture),
            )
            for name, camera in self.cameras.items()
            for texture in self.mode.textures or ()
        ]

    def _state(
        self,
        simulation: Simulation,
        state: State,
        parts: Mapping[str, Array],
        noisy: Noisy | None,
    ) -> Any:
        robots = [state.native_joints(name) for name in self._robots]
        if noisy is not None:
            robots = [
                [noisy(f"{name}.{joints}", row) for joints, row in zip(JOINTS, own, strict=True)]
                for name, own in zip(self._robots, robots, strict=True)
            ]
        kept = controllers.entries(simulation)
        if kept:
            for entry, row in zip(kept, controllers.recall(simulation, kept), strict=True):
                robots[self._robots.index(entry.robot)].append(row)
        for name, links in self._tips.items():
            tips = state.link_poses(name, links)
            tips = tips if noisy is None else noisy(f"{name}.{TIPS}", tips)
            robots[self._robots.index(name)].append(tips)
        return self._flat(robots, parts) if self.mode.flat else self._named(robots, kept, parts)

    def _flat(self, robots: Sequence[Sequence[Floats]], parts: Mapping[str, Array]) -> Floats:
        joined: list[Array] = []
        for own in robots:
            joined += own
        for part in parts.values():
            joined.append(part if part.ndim == 2 else part[:, None])
        flat = np.concatenate(joined, 1, dtype=np.float32)
        if not all_finite(flat):
            raise NotFinite
        return flat

    def _named(
        self,
        robots: Sequence[Sequence[Floats]],
        kept: Sequence[controllers.Entry],
        parts: Mapping[str, Array],
    ) -> dict[str, Any]:
        numbers = [row for own in robots for row in own]
        if not all(map(all_finite, (*numbers, *parts.values()))):
            raise NotFinite
        agent: dict[str, Any] = {}
        for (name, key), own in zip(self._keys.items(), robots, strict=True):
            remembered = [f"{controllers.CONTROLLER}/{e.key}" for e in kept if e.robot == name]
            tips = (TIPS,) if name in self._tips else ()
            rows = zip((*JOINTS, *remembered, *tips), own, strict=True)
            tree = controllers.nested({row_name: row.copy() for row_name, row in rows})
            agent.update(tree if key is None else {key: tree})
        return {"agent": agent, "extra": {key: x.copy() for key, x in parts.items()}}

    def _sensible(self, parts: Mapping[str, Array]) -> dict[str, Array]:
        for name in self._sensed:
            if "*" not in name and name not in parts:
                raise TaskError(unknown_name_message("part that is sensed", name, parts))
        return {key: x for key, x in parts.items() if self.senses(key)}


def space_of(values: Any, *, batched: bool = False) -> Space[Any]:
    """Return the space of an observation, with its keys in the same order, as native has it.

    Numbers with a point may be any, integers what their type can hold, and flags 0 or 1.

    Args:
        values: Arrays or tensors, or mappings of them.
        batched: Whether the first axis of each counts environments, and is left out.
    """
    if isinstance(values, Mapping):  # Gymnasium sorts a mapping, but not a list
        return Dict([(key, space_of(part, batched=batched)) for key, part in values.items()])
    shape = tuple(values.shape[1:] if batched else values.shape)
    dtype = _dtype(values)
    if dtype.kind == "f":
        return Box(-np.inf, np.inf, shape, dtype.type)
    low, high = (0, 1) if dtype.kind == "b" else (np.iinfo(dtype).min, np.iinfo(dtype).max)
    return Box(int(low), int(high), shape, dtype.type)


def observed_dtype(values: Any) -> Any:
    """Return the dtype in which interfaces give an observation: its own, but of float64 float32."""
    dtype = _dtype(values)
    return np.float32 if dtype.kind == "f" else dtype.type


def _dtype(values: Any) -> np.dtype[Any]:
    return np.dtype(str(values.dtype).removeprefix("torch."))

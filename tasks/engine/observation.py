"""What a task observes: which parts, in which form, and with which cameras."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING, Any

import numpy as np
from gymnasium.spaces import Box, Dict, Space
from numpy.typing import NDArray

from layouts import Layout
from robot_layouts.simulation import Camera, Simulation, State
from robot_layouts.simulation.maths import Array, Floats, all_finite
from robot_layouts.simulation.scene.cameras import TEXTURES, AnyCamera, RobotCamera, camera_name
from robots import TaskError, unknown_name_message
from tasks.engine.cameras import Size, cameras_of, expect_apart, resized
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
from tasks.native import controllers
from tasks.native.format import observation_keys
from tasks.randomization.noise import Noisy

if TYPE_CHECKING:
    from robot_layouts.simulation.rendering import Observers, View

PLAIN_MODES = ("state", "state_dict", "none", *COLUMN_MODES)
SHORT_MODES = {"rgbd": "rgb+depth"}
STATE_FORMS = ("state", "state_dict")  # what may be joined to images
SEEN_COLUMNS = {  # what cameras add to the columns of exported datasets
    f"{columns}+cameras{more}": (columns, textures)
    for columns in (LEROBOT, ROBOMIMIC)
    for more, textures in (("", ("rgb",)), ("+depth", ("rgb", "depth")))
}
OBS_MODES = (
    *PLAIN_MODES,
    *SEEN_COLUMNS,
    "rgb",
    "rgbd",
    "rgb+depth+state",
    "depth",
    "rgb+segmentation",
)
"""Examples of observation modes; images and a form of state are joined in any order."""

JOINTS = "qpos", "qvel"  # that every robot observes of itself

_IMAGE_DTYPES = ("uint8", "int16")


@dataclass(frozen=True)
class ObservationMode:
    """What an ``obs_mode`` asks for.

    Attributes:
        textures: What cameras record of each pixel; none if there are no cameras.
        flat: Whether everything but images is one flat part.
        privileged: Whether it includes what only a simulation knows.
        nothing: Whether nothing is observed.
        columns: Which of `COLUMN_MODES`, if it is the columns of exported datasets that are
            observed.
    """

    textures: tuple[str, ...] = ()
    flat: bool = False
    privileged: bool = True
    nothing: bool = False
    columns: str | None = None

    @property
    def draws(self) -> bool:
        """Whether pictures are observed."""
        return bool(self.textures) or self.columns == FILMED


def read_mode(name: str) -> ObservationMode:
    """Return what a mode asks for: ``"state"``, ``"rgb"``, ``"rgb+depth+state_dict"``.

    Raises:
        TaskError: If there is no such mode.
    """
    if not isinstance(name, str):
        raise TaskError(unknown_name_message("obs_mode", name, OBS_MODES))
    if name in PLAIN_MODES:
        columns = name if name in COLUMN_MODES else None
        return ObservationMode(flat=name == "state", nothing=name == "none", columns=columns)
    if name in SEEN_COLUMNS:
        columns, textures = SEEN_COLUMNS[name]
        return ObservationMode(textures, columns=columns)
    parts = SHORT_MODES.get(name, name).split("+")
    for part in parts:
        if part not in (*TEXTURES, *STATE_FORMS):
            wrong = unknown_name_message("obs_mode", name, OBS_MODES)
            raise TaskError(
                f"{wrong} Besides, any of {', '.join(TEXTURES)} are joined by '+', and one of"
                f" {', '.join(STATE_FORMS)} to them"
            )
    textures = tuple(texture for texture in TEXTURES if texture in parts)
    forms = [form for form in STATE_FORMS if form in parts]
    if not textures or len(forms) > 1 or len(set(parts)) != len(parts):
        raise TaskError(
            f"obs_mode {name!r} is invalid; it needs at least one of {', '.join(TEXTURES)} and at"
            f" most one of {', '.join(STATE_FORMS)}, each once"
        )
    return ObservationMode(textures, flat="state" in forms, privileged=bool(forms))


class Observer:
    """Puts observations together.

    Attributes:
        mode: What is asked for.
        cameras: Camera by its name in observations; none if the mode has no images.
    """

    def __init__(
        self,
        layout: Layout,
        mode: ObservationMode,
        cameras: Iterable[Camera],
        sensed: Sequence[str],
        viewpoint: Viewpoint,
        size: Size | None = None,
    ) -> None:
        """Remember how to observe.

        Args:
            layout: The robots.
            mode: What to observe.
            cameras: The task's own cameras.
            sensed: See `tasks.MultiRobotTask`.
            viewpoint: From where people see the task.
            size: Width and height of all pictures (pixels); None: each camera's own.

        Raises:
            TaskError: If images are asked for and there is no camera, or two have the same name.
        """
        self.mode = mode
        found = cameras_of(layout, cameras) if mode.textures else {}
        self.cameras = {name: resized(camera, size) for name, camera in found.items()}
        if mode.textures and not self.cameras:
            raise TaskError("there is no camera: the task declares none, nor do its robots")
        self._keys, self._robots, self._sensed = observation_keys(layout), tuple(layout), sensed
        self._rig: _CameraRig | None = None
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
            seen = self._look(simulation)["sensor_data"] if self.cameras else {}
            for camera, texture, name in self._picture_columns():
                observed[name] = seen[camera][texture]
            return observed
        if not self.mode.privileged:
            parts = self._sensible(parts)
        if noisy is not None:
            parts = {name: noisy(name, values) for name, values in parts.items()}
        if not self.mode.textures:
            return self._state(simulation, state, parts, noisy)
        images = self._look(simulation)
        seen = self._state(simulation, state, parts, noisy)
        return {**images, "state": seen} if self.mode.flat else {**seen, **images}

    def senses(self, part: str) -> bool:
        """Return whether a part of `tasks.MultiRobotTask.observe` is observed beside images."""
        return any(fnmatchcase(part, pattern) for pattern in self._sensed)

    def seen_by(self, robot: str) -> list[str]:
        """Return the names of the cameras that stand still, and of those that ride on a robot."""
        return [
            name
            for name, camera in self.cameras.items()
            if not isinstance(camera, RobotCamera) or camera.robot == robot
        ]

    def changed(self, env_ids: Iterable[int]) -> None:
        """Note that these environments do not look any more as they did."""
        if self._rig is not None:
            self._rig.stale.update(env_ids)

    def close(self) -> None:
        """Let the cameras go, and what else was made to observe."""
        self._rig = None
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
        return [*(f"{robot}.{joints}" for robot in self._robots for joints in JOINTS), *parts]

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
        sizes.update({key: x.shape[1] if x.ndim == 2 else 1 for key, x in parts.items()})
        slices, start = dict[str, slice](), 0
        for name, size in sizes.items():
            slices[name] = slice(start, start + size)
            start += size
        return slices

    # -- inside ------------------------------------------------------------------------------

    def _look(self, simulation: Simulation) -> dict[str, Any]:
        if self._rig is None:
            self._rig = _CameraRig(simulation, self.cameras, self.mode.textures)
        return self._rig.look()

    def _picture_columns(self) -> list[tuple[str, str, str]]:
        """Return camera, texture and the name of its column, of each picture of an export."""
        return [
            (
                name,
                texture,
                picture_column(str(self.mode.columns), camera_name(camera), texture),
            )
            for name, camera in self.cameras.items()
            for texture in self.mode.textures
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
        joints = [row for own in robots for row in own]
        if not all(map(all_finite, (*joints, *parts.values()))):
            raise NotFinite
        agent: dict[str, Any] = {}
        for (name, key), own in zip(self._keys.items(), robots, strict=True):
            remembered = [f"{controllers.CONTROLLER}/{e.key}" for e in kept if e.robot == name]
            rows = zip((*JOINTS, *remembered), own, strict=True)
            tree = controllers.nested({row_name: row.copy() for row_name, row in rows})
            agent.update(tree if key is None else {key: tree})
        return {"agent": agent, "extra": {key: x.copy() for key, x in parts.items()}}

    def _sensible(self, parts: Mapping[str, Array]) -> dict[str, Array]:
        for name in self._sensed:
            if "*" not in name and name not in parts:
                raise TaskError(unknown_name_message("part that is sensed", name, parts))
        return {key: x for key, x in parts.items() if self.senses(key)}


class _CameraRig:
    """The latest images of every environment; only those that changed are drawn again."""

    def __init__(
        self,
        simulation: Simulation,
        cameras: Mapping[str, AnyCamera],
        textures: Sequence[str],
    ) -> None:
        from robot_layouts.simulation.rendering import (
            Observers,  # loaded with the first picture
        )

        self._observers: Observers = Observers(simulation, cameras, textures)
        self._rows: list[dict[str, View]] = [{}] * simulation.num_envs
        self.stale = set(range(simulation.num_envs))

    def look(self) -> dict[str, Any]:
        begun = {env: self._observers.begin(env) for env in sorted(self.stale)}
        for env, finish in begun.items():
            self._rows[env] = finish()
        self.stale.clear()
        names = list(self._rows[0])
        matrices = ("extrinsic_cv", "cam2world_gl", "intrinsic_cv")
        return {
            "sensor_param": {
                name: {m: _stacked(getattr(row[name], m) for row in self._rows) for m in matrices}
                for name in names
            },
            "sensor_data": {
                name: {
                    texture: _stacked(row[name].images[texture] for row in self._rows)
                    for texture in self._rows[0][name].images
                }
                for name in names
            },
        }


def _stacked(rows: Iterable[NDArray[Any]]) -> NDArray[Any]:
    return np.stack(list(rows))


def space_of(values: Any, *, batched: bool = False) -> Space[Any]:
    """Return the space of an observation: of numbers any, of images what their type can hold.

    Args:
        values: Arrays or tensors, or mappings of them.
        batched: Whether the first axis of each counts environments, and is left out.
    """
    if isinstance(values, Mapping):
        return Dict({key: space_of(part, batched=batched) for key, part in values.items()})
    shape = tuple(values.shape[1:] if batched else values.shape)
    dtype = observed_dtype(values)
    if np.issubdtype(dtype, np.integer):
        bounds = np.iinfo(dtype)
        return Box(int(bounds.min), int(bounds.max), shape, dtype)
    return Box(-np.inf, np.inf, shape, np.float32)


def observed_dtype(values: Any) -> Any:
    """Return an observation's dtype: that of images their own, else float32."""
    dtype = np.dtype(str(values.dtype).removeprefix("torch."))
    return dtype.type if dtype.name in _IMAGE_DTYPES else np.float32

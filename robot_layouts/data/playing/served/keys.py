"""What a policy server is sent, under which keys, and what becomes of its actions."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from os import PathLike
from typing import Annotated, Any, TypedDict, cast

import numpy as np
from numpy.typing import NDArray

from robot_layouts.core.quoting import shown
from robot_layouts.core.schema import AnyText, FieldError, Object, Text, check, whole, within
from robot_layouts.simulation.cameras import camera_name, ridden
from robot_layouts.simulation.control.joint_positions import DrivenGroup, driven_groups
from robots import TaskError, UnknownNameError
from robots.action_split import is_gripper
from robots.gripper_motion import ends_of, gripper_tree
from tasks import TaskEnv
from tasks.arrays import leaves
from tasks.description import instruction_of
from tasks.native.format import declared_joints, observation_keys
from tasks.randomization.declaration import read_data

SECONDS = 60.0  # for an answer: a server may compile its network when it is first asked
_CHW = "chw"
_TOLD = ""  # beside the paths of an observation: what is to be done

Source = Callable[[Mapping[str, Any]], Any]
"""Observation by path → what is sent under a key."""


class _GripperNumbers(TypedDict):
    closed: float
    open: float


class KeyData(TypedDict, total=False):
    """What a file of keys holds; see `load_keys`."""

    observation: Object
    actions: Text
    steps: Annotated[int, whole(1, 10_000)]
    gripper: _GripperNumbers
    control_mode: Text
    timeout: Annotated[float, within(0.1, 3600, "s")]


class _SourceData(TypedDict, total=False):
    entry: Text
    joints: list[Text]
    camera: Text
    order: Text
    text: AnyText


def load_keys(path: str | PathLike[str]) -> dict[str, Any]:
    """Return the keys that a file declares.

    Args:
        path: YAML or json. Under ``observation``, what the server is sent: key → one of
            ``{entry: extra/cube_pose}``, a part of the observation by its path, ``state`` if that
            is flat; ``{joints: [left.arm, left.gripper]}``, positions of joint groups or of whole
            robots (rad, m), one number for fingers that move together;
            ``{camera: NAME}``, a picture, (height, width, 3) uint8, or (3, height, width) with
            ``order: chw``; ``{text: instruction}``, what is to be done, or another text. A key may
            hold further keys. All but this may be left out: ``actions``, the key of the actions in
            an answer (``actions``); ``steps``, how many of each chunk are carried out (all);
            ``gripper``, the numbers for closed and open grippers, as ``{closed: 1, open: 0}``, in
            what is sent and in actions (the robot's own); ``control_mode``, in which actions are
            to be carried out; ``timeout`` (60 s), for each answer.

    Raises:
        TaskError: If the file cannot be read, or something in it is invalid; names the file.
        UnknownNameError: If it has an entry of another name.
    """
    data = read_data(path, "keys")
    if isinstance(data, dict):
        data = {**data, **({"steps": _whole(data["steps"])} if "steps" in data else {})}
    try:
        check(data, KeyData, "")
        for name in data:
            if name not in KeyData.__annotations__:
                raise UnknownNameError("entry", name, KeyData.__annotations__)
        if not data.get("observation"):
            raise FieldError("observation is missing: what the server is sent, by key")
        _expect_sources(data["observation"])
    except FieldError as error:
        raise TaskError(f"{path}: {error}") from error
    return data


def _whole(value: Any) -> Any:
    return int(value) if isinstance(value, float) and value.is_integer() else value


def _is_source(given: Mapping[str, Any]) -> bool:
    return not all(isinstance(value, dict) for value in given.values())


def _expect_sources(given: Mapping[str, Any], above: str = "observation") -> None:
    for key, value in given.items():
        name = f"{above}: {key}"
        if not isinstance(value, dict) or not value:
            raise FieldError(
                f"{name} is {shown(value)}; it must be a mapping such as {{joints: [left.arm]}}"
            )
        source = cast("dict[str, Any]", value)
        if not _is_source(source):
            _expect_sources(source, name)
            continue
        check(source, _SourceData, name)
        for word in source:
            if word not in _SourceData.__annotations__:
                raise UnknownNameError(f"source of {name}", word, _SourceData.__annotations__)
        if len(source.keys() - {"order"}) != 1 or ("order" in source and "camera" not in source):
            raise FieldError(f"{name} has {' and '.join(source)}; it must have one source")
        if source.get("order", _CHW) != _CHW:
            raise FieldError(f"{name}: order is {source['order']!r}; it must be {_CHW!r}")


def droid(task: TaskEnv) -> dict[str, Any]:
    """Return the keys of openpi's policies for DROID, of one robot with two cameras.

    Source: openpi's ``droid_policy.py``, commit 58a0c51.

    Raises:
        TaskError: If the task has several robots.
    """
    if len(task.layout) != 1:
        raise TaskError(f"the keys 'droid' are of one robot; the task has {', '.join(task.layout)}")
    (place,) = task.layout
    groups = [f"{d.robot}.{d.name}" for d in driven_groups(task.layout) if not is_gripper(d.name)]
    still, riding = _cameras(task)
    return {
        "observation": {
            "observation/exterior_image_1_left": {"camera": _first(still, "stands still", "droid")},
            "observation/wrist_image_left": {
                "camera": _first(riding.get(place, []), f"rides on {place}", "droid")
            },
            "observation/joint_position": {"joints": groups},
            "observation/gripper_position": {"joints": _grippers(task)},
            "prompt": {"text": "instruction"},
        },
        "gripper": {"closed": 1.0, "open": 0.0},
        "steps": 8,
    }


def aloha(task: TaskEnv) -> dict[str, Any]:
    """Return the keys of openpi's policies for ALOHA, of two arms.

    Source: openpi's ``examples/aloha_sim/env.py``, commit 6d5d119, and the camera names of ALOHA.

    Raises:
        TaskError: If the task has not two robots, or no camera that stands still.
    """
    if len(task.layout) != 2:
        raise TaskError(f"the keys 'aloha' are of two robots; the task has {len(task.layout)}")
    still, riding = _cameras(task)
    names = {"cam_high": _first(still, "stands still", "aloha")}
    names |= dict(zip(["cam_low"], still[1:], strict=False))
    for side, place in zip(("left", "right"), task.layout, strict=True):
        names |= {f"cam_{side}_wrist": riding[place][0]} if place in riding else {}
    return {
        "observation": {
            "state": {"joints": [*task.layout]},
            "images": {key: {"camera": name, "order": _CHW} for key, name in names.items()},
            "prompt": {"text": "instruction"},
        },
        "gripper": {"closed": 0.0, "open": 1.0},
        "control_mode": "pd_joint_pos",
    }


def vla_eval(task: TaskEnv) -> dict[str, Any]:
    """Return the keys that vla-eval recommends to benchmarks, for any task.

    Source: the package vla-eval 0.8.0, ``types``.
    """
    pictures = {name: {"camera": name} for name in _coloured(task)}
    return {
        "observation": {
            **({"images": pictures} if pictures else {}),
            "state": {"joints": [*task.layout]},
            "task_description": {"text": "instruction"},
        }
    }


PRESETS = {"aloha": aloha, "droid": droid}


def _coloured(task: TaskEnv) -> list[str]:
    """Return the names of the cameras whose colours are observed."""
    space: Any = task.single_observation_space
    paths = [path.lstrip("/").split("/") for path in _paths(space)]
    return [path[1] for path in paths if path[0] == "sensor_data" and path[-1] == "rgb"]


def _cameras(task: TaskEnv) -> tuple[list[str], dict[str, list[str]]]:
    """Return the names of cameras that stand still, and by robot of those that ride on one."""
    still, riding = list[str](), dict[str, list[str]]()
    for name, camera in task.observer.cameras.items():
        if (on := ridden(camera)) is None:
            still.append(name)
        else:
            riding.setdefault(on[0], []).append(name)
    return still, riding


def _first(cameras: list[str], what: str, preset: str) -> str:
    if not cameras:
        raise TaskError(
            f"the keys {preset!r} need a camera that {what}, and none is observed; take"
            " --obs-mode rgb and a task or --cameras with one"
        )
    return cameras[0]


def _grippers(task: TaskEnv) -> list[str]:
    return [f"{d.robot}.{d.name}" for d in driven_groups(task.layout) if is_gripper(d.name)]


@dataclass(frozen=True)
class _Scale:
    """A gripper's position and its numbers, as a server has them: from closed to open."""

    server: tuple[float, float]
    own: tuple[NDArray[np.float64], NDArray[np.float64]]

    def to_server(self, values: Any) -> Any:
        """Return a robot's numbers as the server has them."""
        (closed, opened), (low, high) = self.server, self.own
        return closed + np.clip((values - low) / (high - low), 0, 1) * (opened - closed)

    def from_server(self, values: Any) -> Any:
        """Return a server's numbers as the robot has them."""
        (closed, opened), (low, high) = self.server, self.own
        return low + np.clip((values - closed) / (opened - closed), 0, 1) * (high - low)


class Keys:
    """The keys of a policy server, for one task.

    Attributes:
        actions: The key of the actions in an answer.
        steps: How many of a chunk are carried out; None: all.
        seconds: For each answer (s).
    """

    def __init__(self, data: Mapping[str, Any] | None, task: TaskEnv) -> None:
        """Look up what the keys name.

        Args:
            data: What `load_keys` returned; None: everything that is observed, under its path, and
                what is to be done under ``prompt``.
            task: The task.

        Raises:
            UnknownNameError: If the task has no such entry, robot, joint group or camera.
            TaskError: If it is not observed, or the task has another control mode.
        """
        self._task = task
        self._data = data or {}
        self._groups = list(driven_groups(task.layout))
        self.actions: str = self._data.get("actions", "actions")
        self.steps: int | None = self._data.get("steps")
        self.seconds: float = self._data.get("timeout", SECONDS)
        self._width = task.layout.action_dim
        mode = self._data.get("control_mode")
        if mode is not None and task.control_mode != mode:
            raise TaskError(
                f"the server's actions are {mode}, and the task takes {task.control_mode}; make it"
                f" with control_mode={mode!r}, --control-mode {mode}"
            )
        given: Any = self._data.get("observation")
        self._sources: dict[str, Any] | None = None if given is None else self._tree(given)

    def sent(self, observation: Any, seed: int) -> dict[str, Any]:
        """Return what is sent in an episode.

        Args:
            observation: Of one environment, each part (1, …).
            seed: Of the episode, which chooses among several instructions.
        """
        seen, told = _by_path(observation), instruction_of(self._task.task_class, seed)
        if self._sources is None:
            return {**seen, "prompt": told}
        return _filled(self._sources, {**seen, _TOLD: told})

    def carried_out(self, chunk: NDArray[Any]) -> NDArray[np.float32]:
        """Return a server's actions, (T, A), as the task takes them, those that are carried out."""
        actions = np.array(chunk[: self.steps], np.float32)
        for driven in self._groups:
            if driven.group.size and (scale := self._number_scale(driven)) is not None:
                numbers = driven.numbers
                actions[:, numbers] = scale.from_server(chunk[: self.steps, numbers])
        return actions

    def chunk(self, answer: Mapping[Any, Any]) -> NDArray[Any]:
        """Return the actions of an answer, (T, A).

        Raises:
            ValueError: If it has none, or they have the wrong shape or are not finite.
        """
        if self.actions not in answer:
            raise ValueError(
                f"answers without {self.actions!r}; its answer has {', '.join(map(str, answer))}"
                if answer
                else f"answers without {self.actions!r}; its answer is empty"
            )
        found, least = answer[self.actions], self.steps or 1
        if not isinstance(found, np.ndarray):
            raise ValueError(f"sent {shown(found)} as actions; an array (T, {self._width}) is due")
        array = cast("NDArray[Any]", found)
        if array.ndim != 2 or array.shape[1] != self._width or len(array) < least:
            raise ValueError(
                f"sent actions of shape {array.shape}; it must be (T, {self._width}), T being"
                f" {least} or more: {_split(self._task)}"
            )
        with np.errstate(over="ignore"):
            finite = np.isfinite(array.astype(np.float32)).all()
        if array.dtype.kind == "b" or not finite:
            raise ValueError(f"sent actions that are not all finite numbers ({array.dtype})")
        return array

    def _tree(self, given: Mapping[str, Any]) -> dict[str, Any]:
        return {
            key: self._source(value) if _is_source(value) else self._tree(value)
            for key, value in given.items()
        }

    def _source(self, given: Mapping[str, Any]) -> Source:
        seen = self._observed()
        if "text" in given:
            text = given["text"]
            return _entry(_TOLD) if text == "instruction" else lambda seen: text
        if "entry" in given:
            return _entry(_known("entry of the observation", given["entry"], seen))
        if "camera" in given:
            return self._camera(given["camera"], seen, first=given.get("order") == _CHW)
        parts = [part for name in given["joints"] for part in self._joints(name, seen)]
        return lambda seen: np.concatenate([part(seen) for part in parts])

    def _observed(self) -> list[str]:
        space: Any = self._task.single_observation_space
        return [name.lstrip("/") for name in _paths(space)]

    def _camera(self, name: str, seen: list[str], *, first: bool) -> Source:
        cameras = self._task.observer.cameras
        by_place = {camera_name(camera): own for own, camera in cameras.items()}
        own = {**by_place, **{n: n for n in cameras}}[_known("camera", name, [*cameras, *by_place])]
        path = f"sensor_data/{own}/rgb"
        if path not in seen:
            raise TaskError(f"no colours of the camera {name!r} are observed; take --obs-mode rgb")
        if first:
            return lambda seen: np.ascontiguousarray(seen[path].transpose(2, 0, 1))
        return _entry(path)

    def _joints(self, name: str, seen: list[str]) -> list[Source]:
        groups = [d for d in self._groups if name in (d.robot, f"{d.robot}.{d.name}")]
        if not groups:
            known = [word for d in self._groups for word in (d.robot, f"{d.robot}.{d.name}")]
            raise UnknownNameError("robot or joint group", name, list(dict.fromkeys(known)))
        key = observation_keys(self._task.layout)[groups[0].robot]
        path = "agent/qpos" if key is None else f"agent/{key}/qpos"
        if path not in seen:
            raise TaskError(
                f"the joints of {groups[0].robot} are not observed by themselves in obs_mode"
                f" {self._task.obs_mode!r}; take --obs-mode state_dict, or rgb"
            )
        return [self._positions(driven, path) for driven in groups]

    def _positions(self, driven: DrivenGroup, path: str) -> Source:
        start = driven.joints.start - driven.own.start
        count = 1 if driven.group.mimic else len(driven.group.joints)
        joints, index = slice(start, start + count), self._task.simulation.index
        scale = self._position_scale(driven)

        def positions(seen: Mapping[str, NDArray[Any]]) -> NDArray[np.float32]:
            own = declared_joints(index, driven.robot, seen[path])[joints]
            return np.asarray(own if scale is None else scale.to_server(own), np.float32)

        return positions

    def _position_scale(self, driven: DrivenGroup) -> _Scale | None:
        if "gripper" not in self._data or not is_gripper(driven.name):
            return None
        robot = self._task.layout[driven.robot].robot
        limits = gripper_tree(robot).limits[: robot.dof]
        places = [robot.joints.index(joint) for joint in driven.group.joints]
        low, high = np.clip(ends_of(driven.group, limits, robot).T, *limits[places].T)
        count = 1 if driven.group.mimic else len(places)
        return _Scale(self._ends(), (low[:count], high[:count]))

    def _number_scale(self, driven: DrivenGroup) -> _Scale | None:
        if "gripper" not in self._data or not is_gripper(driven.name):
            return None
        ranges = ((-1.0, 1.0),) if driven.group.normalised else driven.group.ranges
        low, high = np.array(ranges, float).T
        return _Scale(self._ends(), (low, high))

    def _ends(self) -> tuple[float, float]:
        return self._data["gripper"]["closed"], self._data["gripper"]["open"]


def _by_path(observation: Any) -> dict[str, NDArray[Any]]:
    """Return the first row of each part of an observation, by its path."""
    parts = observation if isinstance(observation, Mapping) else {"state": observation}
    return {name: part[0].numpy(force=True) for name, part in leaves(parts)}


def _paths(space: Any, above: str = "") -> list[str]:
    """Return the paths of an observation's parts; of a flat one, ``state``."""
    if not hasattr(space, "spaces"):
        return [above or "state"]
    return [path for key, part in space.spaces.items() for path in _paths(part, f"{above}/{key}")]


def _known(what: str, name: str, names: list[str]) -> str:
    if name not in names:
        raise UnknownNameError(what, name, names)
    return name


def _entry(path: str) -> Source:
    return lambda seen: seen[path]


def _filled(sources: Mapping[str, Any], seen: Mapping[str, Any]) -> dict[str, Any]:
    return {
        key: _filled(source, seen) if isinstance(source, dict) else source(seen)
        for key, source in sources.items()
    }


def _split(task: TaskEnv) -> str:
    parts = task.layout.action_split.items()
    return ", ".join(f"{name} {part.start} to {part.stop - 1}" for name, part in parts)

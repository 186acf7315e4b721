"""Which cameras a task has, what they are called, and cameras that take larger pictures."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, fields, replace
from os import PathLike
from typing import Any, cast

import numpy as np
from typing_extensions import NotRequired, TypedDict

from layouts import Layout
from robot_layouts.core.bounds import FAR, checked_numbers, checked_whole, shown
from robot_layouts.core.schema import FieldError, Object, check
from robot_layouts.simulation.cameras import (
    DEFAULT_FOV,
    FIELD_OF_VIEW,
    SIZE,
    AnyCamera,
    Camera,
    RobotCamera,
    camera_name,
    checked_mount,
    lens_of,
    ridden,
)
from robots import RobotLayoutsError, TaskError, UnknownNameError
from robots.descriptor import IDENTITY, Vector3
from tasks.native.format import observation_keys
from tasks.randomization.declaration import read_data
from tasks.randomization.distributions import as_whole

Size = tuple[int, int]
"""Width and height of a picture (pixels)."""

_MOST_PIXELS = 16384  # of a side, as of `robot_layouts.simulation.Camera`


def cameras_of(layout: Layout, cameras: Iterable[Camera]) -> dict[str, AnyCamera]:
    """Return every camera of a task under native's name: its own first, then each robot's.

    Raises:
        TaskError: If two have the same name.
    """
    found: dict[str, AnyCamera] = {}
    for camera in cameras:
        if camera.name in found:
            raise TaskError(f"two cameras are called {camera.name!r}; names must differ")
        found[camera.name] = camera
    for robot, key in observation_keys(layout).items():
        for mount in layout[robot].robot.cameras:
            name = mount.name if key is None else f"{key}-{mount.name}"
            if name in found:
                raise TaskError(
                    f"a camera of the task and one of the robot {robot!r} are called {name!r};"
                    " give the task's another name"
                )
            found[name] = RobotCamera(robot, mount)
    return found


def resized(camera: AnyCamera, size: Size | None) -> AnyCamera:
    """Return a camera that takes pictures of another size; its view is as high as before."""
    if size is None:
        return camera
    width, height = size
    lens, intrinsic = lens_of(camera), camera.intrinsic
    if intrinsic is not None:
        (fx, _, cx), (_, fy, cy), last = intrinsic
        scale = height / lens.height
        middle = width / 2 + (cx - lens.width / 2) * scale
        intrinsic = (fx * scale, 0.0, middle), (0.0, fy * scale, cy * scale), last
    return _with(camera, intrinsic=intrinsic, width=width, height=height)


Configs = Mapping[str, Any]
"""What of cameras is otherwise, in the form of native's ``sensor_configs``."""

_NUMBERS = ("width", "height", "fov", "near", "far")
SETTINGS = (*_NUMBERS, "pose", "intrinsic", "shader_pack", "mount")
"""What may be otherwise, in native's words; ``mount`` takes names, native's takes a link."""


def configured(
    cameras: Mapping[str, AnyCamera], configs: Configs, argument: str
) -> dict[str, AnyCamera]:
    """Return cameras with what of them is to be otherwise.

    Args:
        cameras: Camera by its name in observations.
        configs: Settings of all cameras and, by a camera's name, mappings of its own, which come
            after those. A camera also goes by its name by place: ``left.hand_camera``.
        argument: What ``configs`` are called.

    Raises:
        TaskError: If a setting is invalid.
        UnknownNameError: If there is no such camera or setting.
    """
    if not isinstance(configs, Mapping):
        raise TaskError(f"{argument} is {shown(configs)}; a mapping of settings is needed")
    places = {camera_name(camera): name for name, camera in cameras.items()}
    own, common = dict[str, dict[str, Any]](), dict[str, Any]()
    for key, value in configs.items():
        if key in cameras or key in places:
            if not isinstance(value, Mapping):
                raise TaskError(
                    f"{argument}[{key!r}] is {shown(value)}; a mapping of settings is needed, such"
                    " as {'width': 64, 'height': 64}"
                )
            own.setdefault(key if key in cameras else places[key], {}).update(value)
        elif key in SETTINGS:
            common[key] = value
        else:
            known = [*dict.fromkeys((*cameras, *places)), *SETTINGS]
            raise UnknownNameError(f"camera or setting in {argument}", key, known)
    found: dict[str, AnyCamera] = {}
    for name, camera in cameras.items():
        what = f"{argument} of {name!r}"
        for settings in (common, own.get(name, {})):
            camera = _set(camera, settings, what)
        found[name] = camera
    return found


def _set(camera: AnyCamera, settings: Mapping[str, Any], what: str) -> AnyCamera:
    """Return a camera with other settings."""
    for key in settings:
        if key not in SETTINGS:
            raise UnknownNameError(f"setting in {what}", key, SETTINGS)
    fov, intrinsic = settings.get("fov"), settings.get("intrinsic")
    if fov is not None and intrinsic is not None:
        raise TaskError(f"{what} has both fov and intrinsic; it takes one of them")
    changed: dict[str, Any] = {k: settings[k] for k in _NUMBERS if settings.get(k) is not None}
    if fov is not None:
        changed["intrinsic"] = None
    elif intrinsic is not None:
        changed |= {"intrinsic": intrinsic, "fov": DEFAULT_FOV}
    if settings.get("shader_pack") is not None:
        changed["shader"] = settings["shader_pack"]
    if settings.get("pose") is not None:
        changed["position"], changed["quaternion"] = _pose(f"{what}: pose", settings["pose"])
    if settings.get("mount") is not None:
        changed["on"] = checked_mount(f"{what}: mount", settings["mount"], TaskError)
    try:
        return _with(camera, **changed) if changed else camera
    except RobotLayoutsError as error:
        raise TaskError(f"{what}: {error}") from error


def _pose(what: str, pose: Any) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return a position (m) and a quaternion, wxyz, of seven numbers or of what has p and q."""
    if hasattr(pose, "p") and hasattr(pose, "q"):  # sapien.Pose, or ManiSkill's of one environment
        pose = [float(x) for part in (pose.p, pose.q) for x in np.ravel(part)]
    numbers = checked_numbers(what, pose, 7, FAR, TaskError)
    return numbers[:3], numbers[3:]


def plain(settings: Any) -> Any:
    """Return settings, such as `Configs`, as plain data of which the same cameras are made."""
    if isinstance(settings, Mapping):
        return {key: plain(value) for key, value in settings.items()}
    if hasattr(settings, "p") and hasattr(settings, "q"):
        position, quaternion = _pose("pose", settings)
        return [*position, *quaternion]
    if hasattr(settings, "tolist"):  # an array or a tensor
        return settings.tolist()
    if isinstance(settings, (tuple, list)):
        return [plain(value) for value in settings]
    return settings


class CameraData(TypedDict):
    """Cameras as plain data, by the arguments of `tasks.make`."""

    cameras: NotRequired[list[Object]]
    sensor_configs: NotRequired[Object]


def load_cameras(path: str | PathLike[str]) -> dict[str, Any]:
    """Return the cameras that a file declares, as arguments of `tasks.make`.

    Args:
        path: YAML or json: under ``cameras`` a list of cameras with the fields of
            `tasks.Camera`, in the place of the task's own, under ``sensor_configs`` what of any
            camera is otherwise; see `tasks.Scenario`. Both may be left out.

    Raises:
        TaskError: If the file cannot be read, or a camera is invalid; the message names the file.
    """
    try:
        return read_cameras(read_data(path, "cameras"))
    except (FieldError, RobotLayoutsError) as error:
        raise TaskError(f"{path}: {error}") from error


def read_cameras(data: Any) -> dict[str, Any]:
    """Return what the data of a YAML file declares, as arguments of `tasks.make`; see above.

    Raises:
        RobotLayoutsError: If a camera is invalid.
        FieldError: If something is of another kind.
    """
    data = _with_whole_sizes(data)
    check(data, CameraData, "")
    for name in data:
        if name not in CameraData.__annotations__:
            raise UnknownNameError("entry", name, CameraData.__annotations__)
    return cameras_again(data)


def cameras_again(data: Mapping[str, Any]) -> dict[str, Any]:
    """Return what `CameraData` says as arguments of `tasks.make`.

    Raises:
        RobotLayoutsError: If a camera is invalid.
    """
    known = [field.name for field in fields(Camera)]
    for camera in data.get("cameras", ()):
        for name in camera:
            if name not in known:
                raise UnknownNameError("field of a camera", name, known)
        if "eye" not in camera:
            raise TaskError(f"the camera {shown(camera)} has no eye: where it is (m)")
    return {**data, "cameras": [Camera(**camera) for camera in data.get("cameras", ())]}


def describe_cameras(cameras: Sequence[Camera], configs: Configs | None) -> dict[str, Any]:
    """Return cameras as `CameraData`; nothing of what is not given."""
    data = {"cameras": [asdict(camera) for camera in cameras], "sensor_configs": plain(configs)}
    return {name: value for name, value in data.items() if value}


def _with_whole_sizes(data: Any) -> Any:
    """Return data of a YAML file, whose numbers are floats, with whole numbers of pixels."""
    if isinstance(data, list):
        return [_with_whole_sizes(value) for value in data]
    if not isinstance(data, dict):
        return data
    named = cast("dict[str, Any]", data)
    sizes = {n: as_whole(x) for n, x in named.items() if n in ("width", "height")}
    return {name: _with_whole_sizes(value) for name, value in named.items()} | sizes


def _with(camera: AnyCamera, **changed: Any) -> AnyCamera:
    """Return a camera of which something is otherwise: ``position``, ``on`` and fields of it."""
    if isinstance(camera, RobotCamera):
        own = {name: changed.pop(name) for name in ("intrinsic", "shader") if name in changed}
        robot, changed["link"] = changed.pop("on", ridden(camera))
        if robot != camera.robot:
            raise TaskError(
                f"{camera_name(camera)} is a camera of {camera.robot!r} and cannot ride on"
                f" {robot!r}; a Camera in cameras=[…] can"
            )
        return replace(camera, mount=replace(camera.mount, **changed), **own)
    for name, field in (("position", "eye"), ("on", "mount")):
        if name in changed:
            changed[field] = changed.pop(name)
    if "quaternion" in changed:
        changed["target"] = None
    elif "mount" in changed:  # at the link's own frame
        changed |= {"eye": (0.0, 0.0, 0.0), "quaternion": IDENTITY, "target": None}
    return replace(camera, **changed)


def camera_for_people(viewpoint: tuple[Vector3, Vector3], configs: Configs) -> Camera:
    """Return the camera that draws a task for people.

    Args:
        viewpoint: Its position and target (m, world).
        configs: What of it is otherwise; see `tasks.Scenario.human_render_camera_configs`.

    Raises:
        TaskError: If a setting is invalid.
        UnknownNameError: If there is no such camera or setting.
    """
    camera = Camera(*viewpoint, "render_camera", SIZE, SIZE, FIELD_OF_VIEW)
    found = configured({camera.name: camera}, configs, "human_render_camera_configs")
    return cast("Camera", found[camera.name])


def checked_size(what: str, value: Any) -> Size:
    """Return a size of pictures.

    Raises:
        TaskError: If it is not a size.
    """
    if not isinstance(value, Sequence) or isinstance(value, str) or len(value) != 2:
        raise TaskError(f"{what} is {shown(value)}; width and height (pixels) are needed")
    width, height = (checked_whole(what, side, 1, _MOST_PIXELS, TaskError) for side in value)
    return width, height


def by_place(cameras: Mapping[str, AnyCamera]) -> dict[str, AnyCamera]:
    """Return cameras by their names by place, in the same order.

    Args:
        cameras: Camera by its name in observations.

    Raises:
        TaskError: If two are called the same then.
    """
    names = list(map(camera_name, cameras.values()))
    expect_apart(names)
    return dict(zip(names, cameras.values(), strict=True))


def expect_apart(names: Iterable[str]) -> None:
    """Refuse names of which two are the same.

    Raises:
        TaskError: If so.
    """
    seen = set[str]()
    for name in names:
        if name in seen:
            raise TaskError(
                f"pictures of two cameras would both be called {name!r}; give one of the cameras"
                " another name"
            )
        seen.add(name)

"""Where episodes come from, as plain data that can be compared and that their recording keeps.

What an episode depends on besides its seed and actions, who acted, and its checksum. The recorder
writes it, the reader reads it. Robots that were guessed from a user's own URDF or MJCF are named by
that file.
"""

from __future__ import annotations

import hashlib
import json
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, fields
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from typing_extensions import NotRequired, TypedDict

from layouts import Layout
from robot_layouts.core.files import parse_json, read_regular
from robot_layouts.core.schema import (
    AnyText,
    FieldError,
    Finite,
    Name,
    Object,
    check,
    length,
    whole,
)
from robot_layouts.data.reading.json_files import FILE_NUMBER, TrajectoryError
from robot_layouts.simulation.backend import CLONING, ENGINES
from robots import (
    CONTROL_MODES,
    JointGroup,
    LocalMjcf,
    LocalUrdf,
    NativeAgent,
    RobotDescriptor,
    RobotRegistry,
    UnreadableFileError,
)
from robots.control_modes import plain_mode
from robots.mjcf.locator import is_mjcf
from robots.urdf.cleaning.cleaning import is_template
from robots.urdf.summary import MAX_URDF_BYTES, asset_fingerprint
from tasks import Scenario, TaskEnv
from tasks.engine.cameras import CameraData, describe_cameras
from tasks.language.fitting import TASK
from tasks.native.format import observation_keys
from tasks.registry import full_name

_ACTION_NUMBERS = 10_000  # of all robots
# What an episode consists of, in its group of an h5 file.
CHECKSUM = "checksum"  # attribute of an episode's group in the h5 file
STATES = "env_states/"
ARRAYS = (
    "actions",
    STATES.rstrip("/"),
    "rewards",
    "success",
    "terminated",
    "truncated",
    "actor",
    "corrections",
)
TEXTS = ("action_split", "episode")
OBSERVATIONS = "obs"  # an array, or a group of some
OBSERVED = "obs_checksum"  # the same of these, which are not read with an episode
ORDER = "order"  # of all arrays, where some are observations

# What may change from one resumption to the next, and what earlier versions did not write.
NOT_COMPARED = ("source_type", "source_desc", "guessed", FILE_NUMBER)

_SHOWN = 4  # differences that a message names
_ABSENT = "nothing"

# Fields that digests of 0.2.0 lack, with their defaults.
NEWER_FIELDS = {"no_floor_contact": (), "native_agent": NativeAgent()}
# The same of joint groups, fingers and native's agents, as they are written.
NEWER_IN_PARTS = (
    ", approximate_ik=False",
    ", opening_axes=((0.0, 1.0, 0.0), (0.0, 1.0, 0.0))",
    ", tip_links=()",
)


# What `describe_layout` and `describe_simulation` write, as far as it is read again.
class _PlaceJson(TypedDict):
    robot: Name
    position: Annotated[list[Finite], length(3)]
    quaternion: Annotated[list[Finite], length(4)]
    keyframe: Name | None
    qpos_noise: Finite | None
    action: Annotated[list[Annotated[int, whole(0, _ACTION_NUMBERS)]], length(2)]
    start_qpos: NotRequired[list[Finite]]
    joint_groups: NotRequired[Object]
    assets: NotRequired[AnyText]
    task: NotRequired[Annotated[list[Finite], length(7)]]


class _Simulation(TypedDict, total=False):
    physics: Object | None
    control_frequency: Finite
    randomization: Object
    simulator: Name
    simulator_version: Name


class _DrawnWith(CameraData):
    visuals: NotRequired[Name]


LAYOUT = dict[str, _PlaceJson] | None
SIMULATION = _Simulation | None
PICTURES = _DrawnWith | None


def describe_layout(layout: Layout) -> dict[str, dict[str, Any]]:
    """Return everything about a layout's robots that physics depends on, by robot name.

    Each has ``robot``, base ``position`` (m) and ``quaternion`` (wxyz), ``keyframe`` (None if it
    starts from positions of its own), ``start_qpos`` (rad, m), ``qpos_noise`` (rad), ``action``
    (its first and last + 1 action number), ``joint_groups`` (see `robots.JointGroup`), and
    ``assets``, a SHA-256 over its files. Where the layout says where the task lies, each has that
    as ``task``, too: place (m) and orientation (wxyz). Everything can be written as json; the order
    is that of the action numbers.

    Raises:
        AssetError: If robot files cannot be found.
    """
    split, frame = layout.robot_actions, layout.frame_poses.get(TASK)
    lies = {} if frame is None else {"task": [*frame.position, *frame.quaternion]}
    return {
        name: {
            "robot": placement.robot.name,
            "position": list(placement.base_position),
            "quaternion": list(placement.base_quaternion),
            "keyframe": placement.start_keyframe,
            "start_qpos": list(placement.start_qpos),
            "qpos_noise": placement.qpos_noise,
            "action": [split[name].start, split[name].stop],
            "joint_groups": {
                group: _describe_group(joints)
                for group, joints in placement.robot.action_split.groups.items()
            },
            "assets": asset_fingerprint(placement.robot.urdf),
            **lies,
        }
        for name, placement in layout.items()
    }


def _describe_group(group: JointGroup) -> dict[str, Any]:
    """Return a joint group's fields; those that recordings of old lack only where they count."""
    silent = set[str]() if group.asks.tcp else {"frame", "root_link"}
    silent |= set() if any(group.armatures) else {"armature"}
    silent |= {"command"} if group.command == "position" else set()
    silent |= set() if group.target else {"target"}
    silent |= set() if group.leaders else {"leaders", "lead"}
    silent |= set() if group.approximate_ik else {"approximate_ik"}
    return {name: value for name, value in asdict(group).items() if name not in silent}


def describe_simulation(task: TaskEnv) -> dict[str, Any]:
    """Return a task's physics settings (None: SAPIEN's own) and control frequency (Hz).

    And what varies in its worlds, if anything does, and what simulates them, if not SAPIEN.
    """
    physics, randomization = task.scenario.physics, task.scenario.randomization
    simulator = task.scenario.simulator
    return {
        "physics": None if physics is None else asdict(physics),
        "control_frequency": task.scenario.control_frequency,
        **({"randomization": randomization.to_json()} if randomization else {}),
        **({} if simulator == CLONING else _describe_engine(simulator)),
    }


def _describe_engine(simulator: str) -> dict[str, str]:
    return {"simulator": simulator, "simulator_version": version(ENGINES[simulator])}


def recorded_simulator(simulation: Mapping[str, Any] | None) -> str:
    """Return what simulated a recording, of what `describe_simulation` wrote."""
    return (simulation or {}).get("simulator", CLONING)


def describe_pictures(scenario: Scenario) -> dict[str, Any]:
    """Return with what cameras and meshes a task's pictures are drawn, as far as it was chosen."""
    visuals = {} if scenario.visuals == "full" else {"visuals": scenario.visuals}
    return {**visuals, **describe_cameras(scenario.cameras, scenario.sensor_configs)}


def read_described(texts: Mapping[str, str], name: str, kind: Any) -> Any:
    """Return what is written as json in one of several attributes; None if it is not there.

    Raises:
        ValueError: If it is not json, or of another kind.
    """
    if name not in texts:
        return None
    try:
        described = parse_json(texts[name])
    except ValueError as error:
        raise FieldError(f"attribute {name}: {error}") from error
    check(described, kind, name)
    return described


def action_split(described: Mapping[str, Mapping[str, Any]]) -> dict[str, slice]:
    """Return robot name → slice of the flat action, of a layout that was described.

    Raises:
        FieldError: If the slices do not follow one another.
    """
    split = {name: slice(*robot["action"]) for name, robot in described.items()}
    stop = 0
    for name, numbers in split.items():
        if numbers.start != stop or numbers.stop < stop:
            raise FieldError(
                f"layout.{name}.action is {[numbers.start, numbers.stop]}; it must begin at {stop},"
                " after the robots before it"
            )
        stop = numbers.stop
    return split


def differences(
    recorded: Mapping[str, Any],
    here: Mapping[str, Any],
    sides: tuple[str, str] = ("recorded", "here"),
) -> list[str]:
    """Return one phrase per field in which two descriptions differ; floats must be equal.

    Args:
        recorded: A description that was read from a file.
        here: The same of a task that was made.
        sides: What the phrases call these.
    """
    before, now = (dict(_fields(json.loads(json.dumps(about)))) for about in (recorded, here))
    return [
        f"{field}: {sides[0]} {before.get(field, _ABSENT)}, {sides[1]} {now.get(field, _ABSENT)}"
        for field in dict.fromkeys([*before, *now])
        if before.get(field, _ABSENT) != now.get(field, _ABSENT)
    ]


def listing(found: list[str]) -> str:
    """Return differences as the end of a sentence, the first few of them."""
    more = f"; and {len(found) - _SHOWN} more" if len(found) > _SHOWN else ""
    return "; ".join(found[:_SHOWN]) + more


def _fields(about: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, str]]:
    for name, value in about.items():
        if isinstance(value, dict):
            yield from _fields(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", json.dumps(value)


def checksum(attributes: Mapping[str, str], arrays: Mapping[str, NDArray[Any]]) -> str:
    """Return the checksum of an episode, whatever file it is in and in whatever order.

    It covers `TEXTS` and `ARRAYS`; what others may have added is left out.
    """
    return _crc(attributes, arrays, ARRAYS)


def checksums(attributes: Mapping[str, str], arrays: Mapping[str, NDArray[Any]]) -> dict[str, str]:
    """Return the checksums of an episode by the attributes that hold them."""
    found = {CHECKSUM: checksum(attributes, arrays)}
    if any(name.partition("/")[0] == OBSERVATIONS for name in arrays):
        found[OBSERVED] = observed_checksum(arrays)
    return found


def in_order(
    arrays: Mapping[str, NDArray[Any]], attributes: Mapping[str, str]
) -> dict[str, NDArray[Any]]:
    """Return an episode's arrays in the order that its attributes name.

    Raises:
        ValueError: If that is no order.
    """
    order = read_described(attributes, ORDER, list[AnyText]) or []
    ranks = {name: rank for rank, name in enumerate(order)}
    return dict(sorted(arrays.items(), key=lambda item: ranks.get(item[0], len(ranks))))


def observed_checksum(arrays: Mapping[str, NDArray[Any]]) -> str:
    """Return the checksum of what was observed in an episode."""
    return _crc({}, arrays, (OBSERVATIONS,))


def _crc(
    attributes: Mapping[str, str], arrays: Mapping[str, NDArray[Any]], kinds: Sequence[str]
) -> str:
    names = sorted(name for name in arrays if name.partition("/")[0] in kinds)
    about = [
        [(name, attributes.get(name)) for name in TEXTS],
        [(name, arrays[name].dtype.str, arrays[name].shape) for name in names],
    ]
    found = zlib.crc32(json.dumps(about).encode())
    for name in names:
        found = zlib.crc32(np.ascontiguousarray(arrays[name]).data, found)
    return f"crc32 {found:08x}"


def describe_task(
    task: TaskEnv, source: str, source_desc: str | None, *, observed: bool = False
) -> dict[str, Any]:
    """Return what every file of a recording says about all its episodes.

    Args:
        task: The task.
        source: Where the actions come from, in ManiSkill's words.
        source_desc: The same in one's own words.
        observed: Whether observations are in the file.

    Raises:
        AssetError: If robot files cannot be found.
    """
    name, guessed = full_name(task.task_class), describe_guessed(task.scenario.layout)
    simulator = task.scenario.simulator
    size = task.scenario.camera_size if observed else None
    pictures = describe_pictures(task.scenario) if observed else None
    return {
        "env_info": {
            "env_id": task.task_id,
            **({"module": name.rpartition(":")[0]} if ":" in name else {}),
            "env_kwargs": {
                "obs_mode": task.obs_mode if observed else "none",
                "reward_mode": task.reward_mode,
                "control_mode": plain_mode(task.control_mode),
                "sim_backend": "physx_cpu" if simulator == CLONING else simulator,
                **({"sensor_configs": {"width": size[0], "height": size[1]}} if size else {}),
            },
            "max_episode_steps": task.max_episode_steps,
        },
        "source_type": source,
        "source_desc": source_desc,
        "layout": describe_layout(task.layout),
        "simulation": describe_simulation(task),
        **({"pictures": pictures} if pictures else {}),
        **({"guessed": guessed} if guessed else {}),
    }


def numbered(header: Mapping[str, Any], number: int) -> dict[str, Any]:
    """Return the header of one of a recording's files; the first is not numbered."""
    return {**header, **({FILE_NUMBER: number} if number else {})}


def header_differences(
    recorded: Mapping[str, Any],
    here: Mapping[str, Any],
    sides: tuple[str, str] = ("recorded", "here"),
) -> list[str]:
    """Return one phrase per field in which two headers differ, as far as it matters."""
    return differences(_compared(recorded), _compared(here), sides)


def header_hash(header: Mapping[str, Any]) -> str:
    """Return the SHA-256 of what must not differ."""
    text = json.dumps(_compared(header), sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


def _compared(header: Mapping[str, Any]) -> dict[str, Any]:
    about = {name: value for name, value in header.items() if name not in NOT_COMPARED}
    if isinstance(info := about.get("env_info"), dict):
        about["env_info"] = {name: value for name, value in info.items() if name != "module"}
    return about


def recorded_control_mode(task: TaskEnv) -> str | dict[str, str]:
    """Return the control mode as native writes it: by robot where there are several.

    Where the arms of a robot have modes of their own, it is the mode by arm.
    """
    mode, keys = task.control_mode, observation_keys(task.layout)
    if isinstance(mode, str):
        return mode if None in keys.values() else {str(key): mode for key in keys.values()}
    modes = {task.layout.arm_name(arm): own for arm, own in mode.items()}
    by_arm = {
        arm: modes.get(arm, modes.get(task.layout.owner(arm), CONTROL_MODES[0]))
        for arm in task.layout.arms
    }
    if None in keys.values() or set(by_arm) != set(task.layout):
        return by_arm
    return {str(keys[robot]): own for robot, own in by_arm.items()}


class _Guessed(TypedDict):
    urdf: AnyText
    sha256: AnyText
    descriptor: AnyText


GUESSED = dict[str, _Guessed] | None


def describe_guessed(layout: Layout) -> dict[str, dict[str, str]]:
    """Return, by place, the URDF of each robot that no registry knows, and what is made of it.

    Each has ``urdf``, the file's absolute path, its ``sha256``, and ``descriptor``, a SHA-256 over
    the descriptor's other fields. Robots that are registered, or made of several files, are not
    among them.

    Raises:
        UnreadableFileError: If a URDF cannot be read.
    """
    return {
        place: {
            "urdf": str(path),
            "sha256": _checksum(path),
            "descriptor": descriptor_digest(placement.robot),
        }
        for place, placement in layout.items()
        if (path := _own_file(placement.robot)) is not None
    }


def guess_again(place: str, recorded: Mapping[str, str], name: str) -> RobotDescriptor:
    """Return the robot of a recording, guessed from the same file.

    The file is parsed only if it has the recorded checksum, so that another person's recording
    makes nothing of other files. A xacro template is not expanded: it is a program.

    Args:
        place: Its place.
        recorded: What `describe_guessed` returned of it.
        name: Its name.

    Raises:
        TrajectoryError: If the file, or what is guessed from it, is another one, or a template.
    """
    path = Path(recorded["urdf"])
    helps = f"name the robot, with --robots {place}=… or robots={{{place!r}: …}}"
    try:
        contents = read_regular(path, MAX_URDF_BYTES)
    except UnreadableFileError as error:
        raise TrajectoryError(
            f"the robot of {place!r} was guessed from {path}, which cannot be read"
            f" ({error.strerror}); {helps}"
        ) from error
    if hashlib.sha256(contents).hexdigest() != recorded["sha256"]:
        raise TrajectoryError(
            f"the robot of {place!r} was guessed from {path}, which has changed since; {helps}"
        )
    if not is_mjcf(path) and is_template(contents, str(path)):
        raise TrajectoryError(
            f"the robot of {place!r} was guessed from {path}, a xacro template, which is a"
            f" program and does not run because a file names it; {helps}"
        )
    robot = RobotDescriptor.from_urdf(path, name, quiet=True)
    if descriptor_digest(robot) != recorded["descriptor"]:
        raise TrajectoryError(
            f"the robot of {place!r} is not what is guessed from {path} now, with this version of"
            f" the library and these packages, or fields of it were given; {helps}"
        )
    return robot


def _own_file(robot: RobotDescriptor) -> Path | None:
    if not isinstance(robot.urdf, LocalUrdf | LocalMjcf):
        return None
    if robot.name in RobotRegistry.names() and RobotRegistry.load(robot.name) == robot:
        return None
    path = Path(robot.urdf.path).expanduser().absolute()
    if is_mjcf(path) != isinstance(robot.urdf, LocalMjcf):
        return None  # which its path alone does not tell
    return path if path.is_file() else None  # and no template with arguments


def _checksum(path: Path) -> str:
    return hashlib.sha256(read_regular(path, MAX_URDF_BYTES)).hexdigest()


def descriptor_digest(robot: RobotDescriptor) -> str:
    """Return a SHA-256, in hex, over all fields of a descriptor but where its files are.

    Newer fields count where they differ from their defaults, so that older digests stay.
    """
    counted = [f.name for f in fields(robot) if f.compare and f.name != "urdf"]
    values = {name: getattr(robot, name) for name in counted}
    for name, default in NEWER_FIELDS.items():
        if values[name] == default:
            del values[name]
    values["keyframes"] = dict(robot.keyframes)
    written = repr(values)
    for default in NEWER_IN_PARTS:
        written = written.replace(default, "")
    return hashlib.sha256(written.encode()).hexdigest()

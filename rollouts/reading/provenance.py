"""What an episode depends on besides its seed and actions, as plain data that can be compared."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from typing import Annotated, Any

from typing_extensions import NotRequired, TypedDict

from layouts import Layout
from robots import JointGroup
from robots.common.files import parse_json
from robots.common.schema import AnyText, FieldError, Finite, Name, Object, check, length, whole
from robots.fingerprint import asset_fingerprint
from tasks import MultiRobotTask

_ACTION_NUMBERS = 10_000  # of all robots


# What `describe_layout` and `describe_simulation` write, as far as it is read again.
class _Place(TypedDict):
    robot: Name
    position: Annotated[list[Finite], length(3)]
    quaternion: Annotated[list[Finite], length(4)]
    keyframe: Name | None
    qpos_noise: Finite | None
    action: Annotated[list[Annotated[int, whole(0, _ACTION_NUMBERS)]], length(2)]
    start_qpos: NotRequired[list[Finite]]
    joint_groups: NotRequired[Object]
    assets: NotRequired[AnyText]


class _Simulation(TypedDict, total=False):
    physics: Object | None
    control_frequency: Finite
    randomization: Object


LAYOUT = dict[str, _Place] | None
SIMULATION = _Simulation | None

_SHOWN = 4  # differences that a message names
_ABSENT = "nothing"


def describe_layout(layout: Layout) -> dict[str, dict[str, Any]]:
    """Return everything about a layout's robots that physics depends on, by robot name.

    Each has ``robot``, base ``position`` (m) and ``quaternion`` (wxyz), ``keyframe``,
    ``start_qpos`` (rad, m), ``qpos_noise`` (rad), ``action`` (its first and last + 1 action
    number), ``joint_groups`` (see `robots.JointGroup`), and ``assets``, a SHA-256 over its files.
    Everything can be written as json; the order is that of the action numbers.

    Raises:
        AssetError: If robot files cannot be found.
    """
    split = layout.robot_actions
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
    return {name: value for name, value in asdict(group).items() if name not in silent}


def describe_simulation(task: MultiRobotTask) -> dict[str, Any]:
    """Return a task's physics settings (None: SAPIEN's own) and control frequency (Hz).

    And what varies in its worlds, if anything does.
    """
    physics, randomization = task.scenario.physics, task.scenario.randomization
    return {
        "physics": None if physics is None else asdict(physics),
        "control_frequency": task.scenario.control_frequency,
        **({"randomization": randomization.to_json()} if randomization else {}),
    }


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


def differences(recorded: Mapping[str, Any], here: Mapping[str, Any]) -> list[str]:
    """Return one phrase per field in which two descriptions differ; floats must be equal.

    Args:
        recorded: A description that was read from a file.
        here: The same of a task that was made.
    """
    before, now = (dict(_fields(json.loads(json.dumps(about)))) for about in (recorded, here))
    return [
        f"{field}: recorded {before.get(field, _ABSENT)}, here {now.get(field, _ABSENT)}"
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

"""What a task was made with, as plain data, and the arguments to make it so again."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict
from typing import Annotated, Any

from typing_extensions import NotRequired, TypedDict

from layouts import Layout
from layouts.placement import RobotLike
from robot_layouts.core.schema import FieldError, Finite, Name, Object, check, length, whole
from robot_layouts.data.reading.guessed_robots import GUESSED, descriptor_digest
from robot_layouts.data.reading.provenance import LAYOUT, describe_layout
from robot_layouts.data.reading.recorded_task import layout_again, same_places
from robot_layouts.data.receipts.receipt import ReceiptError
from robot_layouts.simulation import Camera, PhysicsSettings
from robot_layouts.simulation.physics import Friction
from robots import RobotLayoutsError
from robots.control_modes import plain_mode
from robots.fingerprint import asset_checksums
from tasks import MultiRobotTask, Scenario
from tasks.randomization.declaration import Randomization

_MOST = 10**6


class _Making(TypedDict):
    layout: LAYOUT
    obs_mode: Name
    reward_mode: Name
    control_mode: Name | dict[str, Name] | None
    control_frequency: Finite
    max_episode_steps: Annotated[int, whole(1, 2**31 - 1)]
    physics: Object | None
    randomization: Object | None
    cameras: list[Object]
    camera_size: Annotated[list[Annotated[int, whole(1, _MOST)]], length(2)] | None
    bystanders: Name | None
    simulator: Name
    num_envs: NotRequired[Annotated[int, whole(1, _MOST)]]


_AS_THEY_ARE = (
    "obs_mode",
    "reward_mode",
    "control_mode",
    "control_frequency",
    "max_episode_steps",
    "bystanders",
    "simulator",
)  # arguments of the same name


def describe_making(
    cls: type[MultiRobotTask], scenario: Scenario, num_envs: int | None = None
) -> dict[str, Any]:
    """Return what a task is made with.

    Of each robot in ``layout`` it is what `describe_layout` says, and its ``control_mode`` there,
    a SHA-256 of its ``descriptor`` and of each of its ``files`` that physics reads.

    Args:
        cls: Class of the task.
        scenario: What it is made with.
        num_envs: How many environments play at once, where that makes a difference.

    Raises:
        AssetError: If robot files cannot be found.
    """
    mode, varied = scenario.control_mode, scenario.randomization
    described = {
        "layout": _describe_places(scenario.layout),
        "obs_mode": scenario.obs_mode,
        "reward_mode": scenario.reward_mode or cls.reward_modes[0],
        "control_mode": None if mode is None else plain_mode(mode),
        "control_frequency": scenario.control_frequency,
        "max_episode_steps": scenario.max_episode_steps or cls.max_episode_steps,
        "physics": None if scenario.physics is None else asdict(scenario.physics),
        "randomization": varied.to_json() if varied else None,
        "cameras": [asdict(camera) for camera in scenario.cameras],
        "camera_size": scenario.camera_size,
        "bystanders": scenario.bystanders,
        "simulator": scenario.simulator,
        **({} if num_envs is None else {"num_envs": num_envs}),
    }
    return json.loads(json.dumps(described))


def _describe_places(layout: Layout) -> dict[str, Any]:
    return {
        place: {
            **{name: value for name, value in about.items() if name != "assets"},
            "control_mode": layout[place].control_mode,
            "descriptor": descriptor_digest(layout[place].robot),
            "files": asset_checksums(layout[place].robot.urdf),
        }
        for place, about in describe_layout(layout).items()
    }


def make_again(
    making: Mapping[str, Any],
    guessed: Mapping[str, Any],
    cls: type[MultiRobotTask],
    robots: Mapping[str, RobotLike],
) -> dict[str, Any]:
    """Return the arguments of `tasks.registry.make_scenario` for what a receipt says.

    Args:
        making: What `describe_making` returned.
        guessed: What `robot_layouts.data.reading.guessed_robots.describe_guessed` returned then.
        cls: Class of the task.
        robots: Which robots to take, by place, where that does not say it.

    Raises:
        ReceiptError: If it is invalid, or a robot is not available here.
    """
    try:
        check(dict(making), _Making, "making")
        check(dict(guessed), GUESSED, "guessed")
        layout = layout_again(making["layout"], guessed, cls.layout, robots, "the receipt")
        physics, varied = making["physics"], making["randomization"]
        size = making["camera_size"]
        chosen = {name: making[name] for name in _AS_THEY_ARE}
        return {
            **chosen,
            "layout": cls.layout if same_layout(layout, cls.layout) else layout,
            "physics": None if physics is None else _physics(physics),
            "randomization": None if varied is None else Randomization.from_json(varied),
            "cameras": [Camera(**camera) for camera in making["cameras"]],
            "camera_size": None if size is None else tuple(size),
            "check_layout": False,  # it was played like that
        }
    except (FieldError, RobotLayoutsError, TypeError, KeyError) as error:
        raise ReceiptError(f"the receipt's task cannot be made here: {error}") from error


def same_layout(first: Layout, second: Layout) -> bool:
    """Return whether two layouts have the same robots, places and control modes."""
    modes = ([placement.control_mode for placement in each.values()] for each in (first, second))
    return same_places(first, second) and next(modes) == next(modes)


def _physics(described: Mapping[str, Any]) -> PhysicsSettings:
    settings: dict[str, Any] = {**described, "friction": Friction(**described["friction"])}
    return PhysicsSettings(**settings)

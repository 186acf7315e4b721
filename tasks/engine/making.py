"""The keywords that tasks are made with: for type checkers a misspelt one is an error, too."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypedDict

from layouts import Layout
from layouts.placement import RobotLike
from robot_layouts.simulation import Camera, PhysicsSettings
from tasks.randomization.declaration import Randomization


class ScenarioFields(TypedDict, total=False):
    """Fields of `tasks.Scenario` that `tasks.make` takes by keyword alone."""

    physics: PhysicsSettings | None
    control_mode: str | Mapping[str, str] | None
    control_frequency: float
    max_episode_steps: int | None
    render_mode: str | None
    headless: bool
    cameras: Sequence[Camera]
    camera_size: tuple[int, int] | None
    simulator: str
    check_layout: bool
    bystanders: str | None
    randomization: Randomization | None


class MakingFields(ScenarioFields, total=False):
    """What `tasks.make` takes besides the task and the number of environments."""

    robots: RobotLike | Mapping[str, RobotLike] | None
    layout: Layout | None
    obs_mode: str
    reward_mode: str | None

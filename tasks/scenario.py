"""Everything a task is made with: layout, physics, modes, number of environments."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields

from layouts import Layout
from robots import CONTROL_MODES, TaskError, UnknownNameError
from simulation import Camera, PhysicsSettings
from tasks.observation import read_mode

SIMULATORS = ("sapien3",)
RENDER_MODES = (None, "rgb_array")


@dataclass
class Scenario:
    """How to make a task. Fields may be changed until it is made; an unknown field raises.

    Attributes:
        layout: Which robots stand where.
        num_envs: Number of environments in this process.
        physics: Solver settings; None keeps SAPIEN's own defaults.
        obs_mode: ``"state"`` (flat), ``"state_dict"`` (named parts), ``"none"``, or what cameras
            see (needs a Vulkan driver): ``"rgb"``, ``"rgbd"``, or any of ``rgb``, ``depth``,
            ``segmentation`` and ``position`` joined by ``+``, and to them ``state`` or
            ``state_dict``, without which only what a real robot senses is told beside images.
        reward_mode: One of the task's modes; None takes its first.
        control_mode: ``"pd_joint_delta_pos"``, or ``"pd_joint_pos"`` for actions that are joint
            positions.
        control_frequency: Control steps per second (Hz).
        render_mode: ``"rgb_array"`` to draw pictures (needs a Vulkan driver), or None.
        headless: No window is opened; the only choice.
        cameras: Cameras to observe with, in the place of the task's own; empty takes those. Those
            of the robots come after.
        simulator: ``"sapien3"``.
        check_layout: Whether to refuse a layout whose robots collide; the task's own layout is
            never checked.
    """

    layout: Layout
    num_envs: int = 1
    physics: PhysicsSettings | None = None
    obs_mode: str = "state"
    reward_mode: str | None = None
    control_mode: str = CONTROL_MODES[0]
    control_frequency: float = 20.0
    render_mode: str | None = None
    headless: bool = True
    cameras: Sequence[Camera] = field(default_factory=list[Camera])
    simulator: str = "sapien3"
    check_layout: bool = True

    def __setattr__(self, name: str, value: object) -> None:
        """Refuse fields that a scenario does not have."""
        known = [f.name for f in fields(self)]
        if name not in known:
            raise UnknownScenarioField("scenario field", name, known)
        object.__setattr__(self, name, value)

    @property
    def draws(self) -> bool:
        """Whether anything is drawn: for people, or for cameras that observe."""
        return self.render_mode is not None or bool(read_mode(self.obs_mode).textures)

    def check(self, reward_modes: Sequence[str]) -> None:
        """Refuse values that no task can be made with.

        Args:
            reward_modes: The reward modes of the task.

        Raises:
            TaskError: If a number is out of range or a mode is not offered.
        """
        if not (isinstance(self.num_envs, int) and self.num_envs >= 1):
            raise TaskError(f"num_envs is {self.num_envs!r}; it must be an integer of 1 or more")
        if not isinstance(self.layout, Layout):
            raise TaskError(f"layout is a {type(self.layout).__name__}; a Layout is needed")
        if not (self.physics is None or isinstance(self.physics, PhysicsSettings)):
            raise TaskError(
                f"physics is a {type(self.physics).__name__}; PhysicsSettings or None is needed"
            )
        for name, choices in (
            ("simulator", SIMULATORS),
            ("control_mode", CONTROL_MODES),
            ("render_mode", RENDER_MODES),
            ("reward_mode", (None, *reward_modes)),
        ):
            value = getattr(self, name)
            if value not in choices:
                offered = ", ".join(map(repr, choices))
                raise TaskError(f"{name} {value!r} is not offered; choices: {offered}")
        read_mode(self.obs_mode)
        if not isinstance(self.check_layout, bool):
            raise TaskError(f"check_layout is {self.check_layout!r}; it must be True or False")
        if not self.headless:
            raise TaskError("headless=False is not offered: no window is opened; use render_mode")
        for camera in self.cameras:
            if not isinstance(camera, Camera):
                raise TaskError(
                    f"cameras has a {type(camera).__name__}; simulation.Camera is needed"
                )


class UnknownScenarioField(UnknownNameError, AttributeError):
    """A field that a scenario does not have (also an ``AttributeError``)."""

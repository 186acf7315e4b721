"""Everything a task is made with: layout, physics, modes, number of environments, what is felt."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any, TypedDict

import numpy as np
from numpy.typing import NDArray

from layouts import Layout
from layouts.placement import RobotLike
from robot_layouts.core.bounds import checked_choice, checked_flag, checked_whole, shown
from robot_layouts.core.operating_system import memory
from robot_layouts.simulation import SAPIEN_DEFAULTS, Camera, PhysicsSettings, State
from robot_layouts.simulation.backend import ON_DEVICES, SIMULATORS
from robot_layouts.simulation.maths import Floats
from robot_layouts.simulation.physics import substeps
from robot_layouts.simulation.rotations import rotation_matrix
from robot_layouts.simulation.world import Visuals
from robots import TaskError, UnknownNameError
from tasks.engine.cameras import checked_size
from tasks.engine.display import scenario_html, scenario_text
from tasks.engine.observation import read_mode
from tasks.language.needs import ACT, HOLD
from tasks.randomization.declaration import Randomization

SENSOR_RENDER_MODES = ("sensors", "all")  # that show what cameras see
RENDER_MODES = ("rgb_array", *SENSOR_RENDER_MODES)
VISUALS = ("full", "light")
LEAST_BYTES = 400_000  # of an environment: that of PickCube-v1, one of the smallest, takes 435 kB
TOUCH = "touch"  # between the arm and the link in the names of what is felt


def touch_links(layout: Layout, declared: Any) -> dict[str, tuple[str, ...]]:
    """Return the links that feel, by arm.

    Args:
        layout: The robots.
        declared: See `tasks.Scenario.touch`.

    Raises:
        UnknownNameError: If it names an arm that does not exist.
        TaskError: If it is invalid, or an arm whose fingers are to feel has none.
    """
    if not declared:
        return {}
    if declared is True:
        declared = {arm: True for arm, place in layout.arms.items() if place.robot.fingers}
        if not declared:
            raise TaskError(
                "touch is True, but no robot has known fingers; name links, such as"
                f" touch={{{next(iter(layout))!r}: ('palm', 'thumb_tip')}}"
            )
    if not isinstance(declared, Mapping):
        raise TaskError(f"touch is {shown(declared)}; True, or links by arm are needed")
    return {arm: _links(layout, arm, links) for arm, links in declared.items()}


def _links(layout: Layout, arm: str, links: Any) -> tuple[str, ...]:
    known = {**layout, **layout.arms}
    if arm not in known:
        raise UnknownNameError("arm for touch", arm, known)
    if links is True:
        if (fingers := known[arm].robot.fingers) is None:
            raise TaskError(f"touch of {arm!r} is True, but its fingers are not known; name links")
        return fingers.links
    named = isinstance(links, Sequence) and not isinstance(links, str) and bool(links)
    if not named or not all(isinstance(link, str) for link in links):
        raise TaskError(f"touch of {arm!r} is {shown(links)}; True, or names of links are needed")
    if len(set(links)) < len(links):
        raise TaskError(f"touch of {arm!r} names a link twice: {shown(links)}")
    return tuple(links)


class Touch:
    """Reads the contact forces on links.

    Attributes:
        names: What they are called in observations: ``left.touch.panda_leftfinger``.
    """

    def __init__(self, links: Mapping[str, Sequence[str]]) -> None:
        """Take the links by arm; none feel nothing."""
        self._links = {f"{arm}.{TOUCH}.{ln}": (arm, ln) for arm, own in links.items() for ln in own}
        self.names = tuple(self._links)

    def read(self, state: State, elapsed: NDArray[np.int32]) -> dict[str, Floats]:
        """Return the force of all that touches each link, (N, 3) (N), in the link's frame.

        It is that of the last step of physics, and 0 after a reset, before there was one.

        Args:
            state: The worlds now.
            elapsed: Control steps since the reset, (N,).

        Raises:
            UnknownNameError: If a robot has no such link.
        """
        felt: dict[str, Floats] = {}
        for name, (arm, link) in self._links.items():
            force = state.contact_force(arm, link)
            turned = rotation_matrix(state.link_pose(arm, link)[:, 3:])
            own = np.add.reduce(turned * force[:, :, None], 1)
            felt[name] = np.where((elapsed > 0)[:, None], own, np.float32(0))
        return felt


@dataclass
class Scenario:
    """How to make a task. Fields may be changed until it is made; an unknown field raises.

    Attributes:
        layout: Which robots stand where.
        num_envs: Number of environments in this process; each takes about 0.5 MB and more.
        physics: Solver settings; None keeps SAPIEN's own defaults.
        obs_mode: ``"state"`` (flat), ``"state_dict"`` (named parts), ``"none"``, or what cameras
            see (needs a Vulkan driver): ``"rgb"``, ``"rgbd"``, ``"pointcloud"``,
            ``"sensor_data"`` (raw), or any of ``rgb``, ``depth``, ``segmentation``, ``position``,
            ``normal`` and ``albedo`` joined by ``+``, and to them ``state`` or ``state_dict``,
            without which images come only with what a real robot senses.
            ``"lerobot"`` and ``"robomimic"`` give the columns that exports in these formats hold,
            under their names, so that a policy trained on one plays here as it is;
            ``"lerobot+video"`` gives the pictures of exports with video, too; ``"lerobot+cameras"``
            and ``"robomimic+cameras"`` those of all cameras, and ``+depth`` after that what these
            tell of depth.
        reward_mode: One of the task's modes; None takes its first.
        control_mode: One of `robots.CONTROL_MODES`, or of the robots' own; or a mapping from arms
            to modes. An arm is a robot, or a limb of one. Arms that are left out, and all if this
            is None, are in the mode that their place in the layout says, and where it says none,
            in ``"pd_joint_delta_pos"``.
        control_frequency: Control steps per second (Hz); a whole number of physics steps each.
        max_episode_steps: Control steps until an episode is truncated; None takes the task's.
        render_mode: ``"rgb_array"`` to draw pictures for people (needs a Vulkan driver),
            ``"sensors"`` to show them what the cameras see, ``"all"`` for both, or None.
        headless: No window is opened; the only choice.
        cameras: Cameras to observe with, in the place of the task's own; empty takes those. Those
            of the robots come after.
        camera_size: Width and height (pixels) of what all these cameras see; None: each camera's
            own.
        visuals: ``"full"`` draws robots as their files have them, ``"light"`` with meshes of fewer
            triangles that are less than 1 mm from these, which is several times faster.
        simulator: ``"sapien3"``, or ``"mujoco"``, in which a clone of a task of ManiSkill's is the
            same task with other physics.
        bystanders: What the layout's robots do that have no place in the task: ``"hold"`` still and
            take no action number, or ``"act"``, with action numbers of their own. None refuses
            them.
        randomization: What varies from episode to episode; None for nothing. See
            `tasks.Randomization`.
        check_layout: Whether to refuse a layout whose robots collide, be it another one or the
            task's own; those of this library's tasks are checked by its tests.
        sensor_configs: What of the cameras that observe is otherwise, as in native: of all of them
            ``width``, ``height`` (pixels), ``fov`` (rad) or ``intrinsic`` (3, 3), ``near``, ``far``
            (m), ``pose`` (position and quaternion, wxyz, of the world or of the link), ``mount``
            (robot and link) and ``shader_pack`` (``"minimal"``, ``"default"``, ``"rt"``,
            ``"rt-med"`` or ``"rt-fast"``), and by a camera's name a mapping of its own.
        human_render_camera_configs: Likewise of the camera that draws for people,
            ``"render_camera"``.
        enable_shadow: Whether the first light casts shadows, as in native.
        touch: Which links feel what touches them: True for the fingers of all arms, or a mapping
            from arms to names of links, or to True for their fingers. Each link's contact force is
            a part of the observation, ``left.touch.panda_leftfinger``, (N, 3) (N), in the link's
            frame. None for none, as in native.
    """

    layout: Layout
    num_envs: int = 1
    physics: PhysicsSettings | None = None
    obs_mode: str = "state"
    reward_mode: str | None = None
    control_mode: str | Mapping[str, str] | None = None
    control_frequency: float = 20.0
    max_episode_steps: int | None = None
    render_mode: str | None = None
    headless: bool = True
    cameras: Sequence[Camera] = field(default_factory=list[Camera])
    camera_size: tuple[int, int] | None = None
    visuals: str = "full"
    simulator: str = "sapien3"
    bystanders: str | None = None
    randomization: Randomization | None = None
    check_layout: bool = True
    sensor_configs: Mapping[str, Any] | None = None
    human_render_camera_configs: Mapping[str, Any] | None = None
    enable_shadow: bool = False
    touch: bool | Mapping[str, Sequence[str] | bool] | None = None

    def __setattr__(self, name: str, value: object) -> None:
        """Refuse fields that a scenario does not have."""
        known = [f.name for f in fields(self)]
        if name not in known:
            raise UnknownScenarioField("scenario field", name, known)
        object.__setattr__(self, name, value)

    def __repr__(self) -> str:
        """Show the fields that differ from their defaults."""
        return scenario_text(self)

    def _repr_html_(self) -> str:
        """Show a notebook the same, with the layout's picture."""
        return scenario_html(self)

    @property
    def draws(self) -> Visuals:
        """Whether anything is drawn, for people or for cameras that observe, and what meshes."""
        if self.render_mode is None and not read_mode(self.obs_mode).draws:
            return False
        return "light" if self.visuals == "light" else True

    def check(self, reward_modes: Sequence[str]) -> None:
        """Refuse values that no task can be made with.

        Args:
            reward_modes: The reward modes of the task.

        Raises:
            TaskError: If a number is out of range or a mode is not offered.
            SimulationError: If a control step is no whole number of physics steps.
        """
        _check_count(self.num_envs)
        if not isinstance(self.layout, Layout):
            raise TaskError(f"layout is a {type(self.layout).__name__}; a Layout is needed")
        if not (self.physics is None or isinstance(self.physics, PhysicsSettings)):
            raise TaskError(
                f"physics is a {type(self.physics).__name__}; PhysicsSettings or None is needed"
            )
        if not (self.randomization is None or isinstance(self.randomization, Randomization)):
            raise TaskError(
                f"randomization is {shown(self.randomization)}; a tasks.Randomization or None is"
                " needed"
            )
        if self.simulator == ON_DEVICES:
            raise TaskError(
                f"simulator {ON_DEVICES!r} steps whole vectors on a device: gymnasium.make_vec("
                f"'RobotLayouts/…', num_envs=…, simulator={ON_DEVICES!r}, device='cuda:0')"
            )
        for name, choices in (
            ("simulator", (*SIMULATORS, ON_DEVICES)),
            ("visuals", VISUALS),
            ("render_mode", (None, *RENDER_MODES)),
            ("bystanders", (None, HOLD, ACT)),
            ("reward_mode", (None, *reward_modes)),
        ):
            checked_choice(name, getattr(self, name), choices, TaskError)
        if self.control_mode is not None:
            check_control_mode(self.layout, self.control_mode)
        if read_mode(self.obs_mode).columns and touch_links(self.layout, self.touch):
            raise TaskError(f"obs_mode {self.obs_mode!r} has no columns for touch")
        for name in ("check_layout", "headless", "enable_shadow"):
            checked_flag(name, getattr(self, name), TaskError)
        if not self.headless:
            raise TaskError("headless=False is not offered: no window is opened; use render_mode")
        if self.max_episode_steps is not None:
            most = np.iinfo(np.int32).max
            checked_whole("max_episode_steps", self.max_episode_steps, 1, most, TaskError)
        substeps(self.physics or SAPIEN_DEFAULTS, self.control_frequency)
        _check_cameras(self.cameras)
        if self.camera_size is not None:
            checked_size("camera_size", self.camera_size)


class ScenarioFields(TypedDict, total=False):
    """Fields of `Scenario` that `tasks.make` takes by keyword alone, for type checkers."""

    physics: PhysicsSettings | None
    control_mode: str | Mapping[str, str] | None
    control_frequency: float
    max_episode_steps: int | None
    render_mode: str | None
    headless: bool
    cameras: Sequence[Camera]
    camera_size: tuple[int, int] | None
    visuals: str
    simulator: str
    check_layout: bool
    bystanders: str | None
    randomization: Randomization | str | None
    sensor_configs: Mapping[str, Any] | None
    human_render_camera_configs: Mapping[str, Any] | None
    enable_shadow: bool
    touch: bool | Mapping[str, Sequence[str] | bool] | None


class MakingFields(ScenarioFields, total=False):
    """What `tasks.make` takes besides the task and the number of environments."""

    robots: RobotLike | Mapping[str, RobotLike] | None
    layout: Layout | None
    obs_mode: str
    reward_mode: str | None


def check_control_mode(layout: Layout, mode: object) -> None:
    """Refuse what is no control mode of a layout's robots.

    Raises:
        TaskError: If it is not a control mode, or names an arm that does not exist.
    """
    if not isinstance(mode, Mapping):
        known = dict.fromkeys(m for p in layout.values() for m in p.robot.modes)
        checked_choice("control_mode", mode, tuple(known), TaskError)
        return
    for arm, own in mode.items():
        try:
            robot = layout[layout.owner(arm)].robot
        except UnknownNameError as error:
            raise TaskError(f"control_mode: {error}") from None
        checked_choice(f"control_mode of {arm!r}", own, robot.modes, TaskError)


def _check_count(num_envs: object) -> None:
    count = checked_whole("num_envs", num_envs, 1, None, TaskError)
    present = memory()
    if present is not None and count * LEAST_BYTES > present:
        raise TaskError(
            f"num_envs is {count}; that takes {count * LEAST_BYTES / 1e9:.3g} GB at least, and this"
            f" machine has {present / 1e9:.3g} GB"
        )


def _check_cameras(cameras: Any) -> None:
    if not isinstance(cameras, Sequence) or isinstance(cameras, str):
        raise TaskError(f"cameras is {shown(cameras)}; a list of simulation.Camera is needed")
    for camera in cameras:
        if not isinstance(camera, Camera):
            raise TaskError(f"cameras has a {type(camera).__name__}; simulation.Camera is needed")


class UnknownScenarioField(UnknownNameError, AttributeError):
    """A field that a scenario does not have (also an ``AttributeError``)."""

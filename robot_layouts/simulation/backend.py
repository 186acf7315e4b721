"""The seam between this library and a simulator: what a backend has to do, in batched verbs.

Everything above it (`Simulation`, `State`, `World`, tasks) is plain data and arithmetic; what a
simulator calls its scenes, bodies and joints is known only below, in a folder of its own such as
`robot_layouts.simulation.sapien3`. `SIMULATORS` names them.

Conventions, whatever the simulator's own are: joints in the order of each robot's descriptor, the
robots in that of the layout; poses as position (m) and quaternion (wxyz) in the world frame; the
first axis of a row-wise argument counts the entries of ``env_ids``, that of a result is named with
it. Arrays are float32, NumPy's of today's backend.

`velocities` and `forces` are read only if asked for, and what a state asks for is always the same
tuple until another quantity joins, so a backend prepares a query once for each tuple.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pkgutil import resolve_name
from typing import Any, Literal, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from layouts import Layout
from robot_layouts.simulation.cameras import AnyCamera, View
from robot_layouts.simulation.maths import Flags, Floats
from robot_layouts.simulation.solvers import InverseKinematics as PoseSolver
from robot_layouts.simulation.solvers import PointReach as PointSolver
from robot_layouts.simulation.variation import Variation
from robot_layouts.simulation.world import Part as Part
from robot_layouts.simulation.world import Placements, World
from robots import SimulationError, UnknownNameError
from robots.urdf.model import UrdfModel

Rows = Mapping[str, Floats]
"""State rows by name, a row for each world that is meant."""

Joints = NDArray[np.float64]


class Readout(NamedTuple):
    """What is read after every step.

    Attributes:
        poses: Of every frame, (F, N, 7).
        joint_positions: Of all robots, (N, dof) (rad, m).
        joint_velocities: Likewise (rad/s, m/s).
    """

    poses: Floats
    joint_positions: Floats
    joint_velocities: Floats


class Velocity(NamedTuple):
    """A velocity of a body, in the world frame (m/s or rad/s)."""

    body: str
    kind: Literal["linear", "angular"]


class Pair(NamedTuple):
    """A link and a body, and the contact force of the body on the link (N, world frame).

    Without a body it is the force of everything that touches the link.
    """

    robot: str
    link: str
    body: str | None


class Overlap(NamedTuple):
    """Two parts that are inside each other, and how far at the deepest point (m)."""

    one: Part
    other: Part
    depth: float

    def __str__(self) -> str:
        """Say so in a few words."""
        return f"{self.one} and {self.other} overlap by {self.depth * 1e3:.3g} mm"


@dataclass(frozen=True)
class BuiltRobot:
    """What is known of a robot once it is built.

    Attributes:
        links: Frame of each link by name, the root first.
        limits: Lower and upper limit of each joint, (dof, 2) (rad, m).
        speeds: What is taken as the limit of each joint's speed: that of the robot's file, if it
            has one and that makes sense, (dof,) (rad/s, m/s).
        loaded_order: For each joint in the order in which SAPIEN's loader numbers those of the
            robot's file, which is native's, its place among the descriptor's.
    """

    links: Mapping[str, int]
    limits: NDArray[np.float32]
    speeds: NDArray[np.float32]
    loaded_order: tuple[int, ...]

    @property
    def root(self) -> str:
        """Name of the root link."""
        return next(iter(self.links))


@dataclass(frozen=True)
class Built:
    """Where everything stands in the read-outs of worlds that were built alike.

    A frame is anything with a pose.

    Attributes:
        frames: Number of frames F.
        bodies: Frame of each body.
        robots: Robot by name, in layout order.
        joints: Names of the joints of each body that has some.
    """

    frames: int
    bodies: Mapping[str, int]
    robots: Mapping[str, BuiltRobot]
    joints: Mapping[str, tuple[str, ...]]


class PoseFollower(Protocol):
    """Finds the joints of an arm that bring a link to a pose, from where they are."""

    def follow(self, position: Floats, quaternion: Floats, qpos: Floats, /) -> Joints | None:
        """Return the arm's joints, in the order asked for, or None if none were found.

        Args:
            position: Of the link in the root link's frame, (3,) (m).
            quaternion: Likewise, wxyz.
            qpos: All joints of the robot in its descriptor's order, (dof,) (rad, m).
        """
        ...


SIMULATORS = {
    "sapien3": "robot_layouts.simulation.sapien3.backend:SapienBackend",
    "mujoco": "robot_layouts.simulation.mujoco.backend:MujocoBackend",
}
"""Where each simulator's backend is, by the name that ``simulator=`` takes."""

EXPORTS = {
    "mjcf": "robot_layouts.simulation.mujoco.export:write_mjcf_world",
    "usd": "robot_layouts.simulation.exported:write_usd_world",
    "ros2": "robot_layouts.simulation.exported:write_ros2_world",
}
"""What writes a world of any simulator for other programs, by the format."""

ON_DEVICES = "mujoco_warp"
"""The simulator of whole vectors on a device, which is no `Backend`: `tasks.interfaces.device`."""

CLONING = "sapien3"
"""The simulator in which clones of ManiSkill's tasks have its bits; in others their physics is
another."""

ENGINES = {"sapien3": "sapien", "mujoco": "mujoco"}
"""The package that computes physics, by simulator."""


def open_backend(simulator: str) -> Backend:
    """Return a simulator's backend, without worlds.

    Raises:
        UnknownNameError: If there is no such simulator.
    """
    if simulator not in SIMULATORS:
        raise UnknownNameError("simulator", simulator, SIMULATORS)
    return resolve_name(SIMULATORS[simulator])()


class Backend(Protocol):
    """N worlds of one layout in a simulator."""

    def build(self, worlds: Mapping[int, World]) -> Built:
        """Build some worlds, anew where they stand already, and forget their past.

        Args:
            worlds: What each is to hold, by its number; all of them at the first call.

        Raises:
            AssetError: If a robot's or a body's files cannot be found or read.
            DescriptorError: If a descriptor names joints or links that its file lacks.
            SimulationError: If pictures are wanted and cannot be drawn.
        """
        ...

    def clear(self, env_ids: Sequence[int]) -> None:
        """Begin a reset: zero all velocities and forces, and put anchored bodies back."""
        ...

    def vary(self, variations: Mapping[int, Variation]) -> None:
        """Let worlds differ from what was built, from a reset on.

        Args:
            variations: How each does, by its number; always of the same parts.
        """
        ...

    def place(self, placements: Placements) -> None:
        """Stand robots at their base pose and given joints, at rest, and move bodies and joints."""
        ...

    def drive(self, targets: Floats, env_ids: Sequence[int]) -> None:
        """Set every joint's drive target; ``targets`` has a row for each world, (N, dof)."""
        ...

    def drive_velocities(self, velocities: Floats, env_ids: Sequence[int]) -> None:
        """Set every joint's target of velocity, likewise (rad/s, m/s); 0 until it is set."""
        ...

    def step(self, env_ids: Sequence[int], substeps: int) -> None:
        """Advance worlds by some steps of physics."""
        ...

    def read(self) -> Readout:
        """Return poses and joints of all worlds; they stay as they are when the worlds move on."""
        ...

    def velocities(self, wanted: tuple[Velocity, ...]) -> Floats:
        """Return velocities, (K, N, 3); those of bodies that physics does not move are zero."""
        ...

    def root_velocities(self) -> Floats:
        """Return linear and angular velocity of each robot's root, (R, N, 6) (m/s, rad/s)."""
        ...

    def body_joints(self, body: str) -> Floats:
        """Return positions, then velocities of a body's joints, (N, 2 · joints) (m, rad, …/s)."""
        ...

    def forces(self, pairs: tuple[Pair, ...]) -> Floats | None:
        """Return contact forces of the last step of physics, (P, N, 3); None if all are zero."""
        ...

    def write(self, env_ids: Sequence[int], bodies: Rows, robots: Rows) -> None:
        """Put worlds into a state.

        Args:
            env_ids: Which worlds.
            bodies: Pose, linear and angular velocity, (K, 13); only dynamic ones take velocities.
                Those with joints have the joints' positions and velocities as well.
            robots: The same of the root, then joint positions and velocities, (K, 13 + 2 · dof).
        """
        ...

    def look(
        self, env: int, cameras: Mapping[str, AnyCamera], textures: Sequence[str], *, markers: bool
    ) -> Callable[[], list[View]]:
        """Begin to draw what each camera sees in one world now, all at the same moment.

        Until it is returned, nothing may move in that world; others may be looked at.

        Args:
            env: Which world.
            cameras: Camera by name.
            textures: What to tell of each pixel, some of `TEXTURES`.
            markers: Whether bodies that are there for people only are seen.

        Returns:
            What waits until it is drawn, and returns it.

        Raises:
            SimulationError: If this process is a fork of one that drew.
        """
        ...

    def describe_graphics(self) -> dict[str, str]:
        """Return on what pictures are drawn, as plain data: device, driver, and its settings."""
        ...

    def segments(self) -> dict[int, Part]:
        """Return what the numbers of a segmentation stand for, the same in every world."""
        ...

    def inverse_kinematics(self, robot: str) -> PoseSolver:
        """Return a solver for poses of a robot's TCP, where it stands in the first environment."""
        ...

    def point_reach(self, robot: str) -> PointSolver:
        """Return a solver for points of a robot's TCP link, likewise."""
        ...

    def pose_follower(
        self, robot: str, link: str, root_link: str | None, joints: Sequence[str]
    ) -> PoseFollower:
        """Return what follows poses of a robot's link with some of its joints, in any world.

        Args:
            robot: The robot's name in the layout.
            link: The link.
            root_link: Link whose frame poses are in, whatever holds it; the robot's root if None.
            joints: Those that may move.
        """
        ...

    def contact_counts(self) -> NDArray[np.int64]:
        """Return how many pairs of bodies touch or are about to, (N,)."""
        ...

    def overlaps(self, env: int) -> list[Overlap]:
        """Return which parts of a world were inside each other in the last step of physics."""
        ...

    def watch_arms(self) -> None:
        """Look from now on, in every step of physics, at which arms touch each other."""
        ...

    def arms_touching(self, env: int) -> list[tuple[Part, Part]]:
        """Return which links of different arms touched since it was last asked.

        Raises:
            SimulationError: If arms are not watched; see `watch_arms`.
        """
        ...

    def touching(self) -> Flags:
        """Tell where a link pressed on a dynamic body in the last step of physics, (N,)."""
        ...

    def extents(self, env: int) -> dict[Part, Floats]:
        """Return the box around each link and body of a world that collides, but for planes.

        Along the axes of the world: its lowest and its highest corner, (2, 3) (m).
        """
        ...

    def collision_shapes(self, env: int, body: str) -> list[tuple[str | float | list[float], ...]]:
        """Return the kind, pose and sizes of what a body collides with, as it was built."""
        ...


class EachWorld:
    """What backends share whose worlds are things of their own, each with the same verbs.

    Attributes:
        worlds: The worlds.
    """

    worlds: list[Any]

    def __init__(self) -> None:
        """Begin without worlds."""
        self.worlds = []
        self._watchers: dict[Any, Any] | None = None  # what `seen` which arms touch, by world

    def _keep(self, built: Mapping[int, Any]) -> None:
        """Let worlds that were built take the place of earlier ones."""
        count = max(len(self.worlds), len(built))
        self.worlds = [built.get(i) or self.worlds[i] for i in range(count)]

    def _arm(self, robot: str) -> Any:
        """Return what solvers are to move: an arm where it stands in the first world."""
        raise NotImplementedError

    def clear(self, env_ids: Sequence[int]) -> None:
        """Begin a reset; see `Backend`."""
        for i in env_ids:
            self.worlds[i].clear()

    def vary(self, variations: Mapping[int, Variation]) -> None:
        """Let worlds differ from what was built; see `Backend`."""
        for i, variation in variations.items():
            self.worlds[i].vary(variation)

    def place(self, placements: Placements) -> None:
        """Stand robots and move bodies; see `Backend`."""
        for name, rows in placements.robots.items():
            for i, qpos in rows.items():
                self.worlds[i].stand(name, qpos)
        for name, rows in placements.bodies.items():
            for i, pose in rows.items():
                self.worlds[i].place(name, pose)
        for name, rows in placements.joints.items():
            for i, positions in rows.items():
                self.worlds[i].set_joints(name, positions)

    def inverse_kinematics(self, robot: str) -> PoseSolver:
        """Return a solver for poses; see `Backend`."""
        return PoseSolver(self._arm(robot))

    def point_reach(self, robot: str) -> PointSolver:
        """Return a solver for points; see `Backend`."""
        return PointSolver(self._arm(robot))

    def arms_touching(self, env: int) -> list[tuple[Part, Part]]:
        """Return which links of different arms touched since it was last asked; see `Backend`."""
        if self._watchers is None:
            raise SimulationError("contacts between arms are not watched; call watch_arms() first")
        watcher = self._watchers[self.worlds[env]]
        seen, watcher.seen = list(watcher.seen), {}
        return seen


def arms_of(layout: Layout, models: Mapping[str, UrdfModel]) -> dict[Part, tuple[str, str]]:
    """Return the arm of each link: the robot and, if it has limbs, the limb.

    A link is of the limb that has the last joint on the way to it; what is of no limb is left out
    if there are limbs.

    Args:
        layout: The robots.
        models: What their files describe, by their names in the layout.
    """
    found: dict[Part, tuple[str, str]] = {}
    for name, model in models.items():
        robot = layout[name].robot
        limbs = {joint: limb for limb in robot.limbs for joint in robot.parts[limb].joints}
        for link in model.links:
            own = [limbs[joint.name] for joint in model.path_to(link) if joint.name in limbs]
            if own or not limbs:
                found[Part(name, link)] = name, own[-1] if own else ""
    return found

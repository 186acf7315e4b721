"""Many worlds of one layout, stepped and read together."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from os import PathLike
from pathlib import Path
from pkgutil import resolve_name
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from layouts import Layout
from objects import ObjectDescriptor
from robot_layouts.simulation.backend import EXPORTS, Backend, Rows, open_backend
from robot_layouts.simulation.cameras import AnyCamera, View
from robot_layouts.simulation.control.joint_positions import JointPositionController
from robot_layouts.simulation.control.modes import ModeController
from robot_layouts.simulation.maths import Array, Floats
from robot_layouts.simulation.physics import SAPIEN_DEFAULTS, PhysicsSettings, substeps
from robot_layouts.simulation.readout import Moment, ReadoutIndex
from robot_layouts.simulation.state import State
from robot_layouts.simulation.variation import Variation
from robot_layouts.simulation.world import Placements, Visuals, World
from robots import RobotDescriptor, SimulationError
from robots.descriptor import IDENTITY, Quaternion


class Simulation:
    """N worlds with the same layout and bodies.

    Attributes:
        layout: The layout of every world.
        num_envs: Number of worlds N.
        worlds: What each of them holds.
        substeps: Physics steps per control step.
        backend: What simulates them; asked directly for contacts, overlaps, extents and solvers.
        index: Where each frame and joint stands in a read-out.
        drive_targets: What the joints were last driven to, robots in layout order, joints in the
            descriptors', (N, dof) (rad, m).
        links_pass: See `robot_layouts.simulation.World`.
        modes: What drives the robots, if their control modes ask for more than joint positions.
    """

    def __init__(
        self,
        layout: Layout,
        build: Callable[[World, int], None],
        num_envs: int,
        physics: PhysicsSettings | None = None,
        *,
        control_frequency: float = 20.0,
        visuals: Visuals = False,
        links_pass: bool = False,
        simulator: str = "sapien3",
        shadows: bool = False,
    ) -> None:
        """Build the worlds.

        Args:
            layout: Which robots stand where.
            build: Called with each world and its number; adds the task's bodies.
            num_envs: Number of worlds.
            physics: Solver settings; None keeps SAPIEN's own defaults.
            control_frequency: Control steps per second (Hz).
            visuals: Whether to build what pictures need.
            links_pass: See `robot_layouts.simulation.World`.
            simulator: What simulates them, one of `robot_layouts.simulation.backend.SIMULATORS`.
            shadows: Whether the first light casts shadows in pictures.

        Raises:
            SimulationError: If a control step is not a whole number of physics steps.
            UnknownNameError: If there is no such simulator.
            AssetError: If robot files cannot be found.
        """
        self.substeps = substeps(physics or SAPIEN_DEFAULTS, control_frequency)
        self.layout, self.num_envs = layout, num_envs
        self._everywhere: Sequence[int] = range(num_envs)
        self._physics = physics
        self._visuals: Visuals = visuals
        self.links_pass = links_pass
        self.backend: Backend = open_backend(simulator)
        self._shadows = shadows
        self._moment = Moment(self.backend)
        self._latest: State | None = None  # of this moment, if control modes look at it
        self._placements = Placements()
        self._controller = JointPositionController(layout)
        self.drive_targets: Floats = np.zeros((num_envs, self._controller.dof), np.float32)
        self.modes: ModeController | None = None
        if ModeController.needed(layout):
            self.modes = ModeController(layout, self._controller)
        self.worlds: list[World] = []
        self._fresh = set(self._everywhere)  # worlds that have not moved since their reset
        self.rebuild(self._everywhere, build)

    def rebuild(self, env_ids: Sequence[int], build: Callable[[World, int], None]) -> None:
        """Build some worlds anew; what PhysX remembered of their past is gone.

        Args:
            env_ids: Which worlds.
            build: As when the simulation was made. It is not kept from then: a task's own would
                keep the task, and with it these worlds, until Python looks for circles.
        """
        fresh = {i: self._describe(i, build) for i in env_ids}
        self._placements.forget(env_ids)
        _expect_alike({**dict(enumerate(self.worlds)), **fresh})
        built = self.backend.build(fresh)
        self.worlds = [fresh.get(i) or self.worlds[i] for i in self._everywhere]
        self.index = ReadoutIndex(self.layout, built)
        self._fresh.update(env_ids)
        if self.modes is not None:
            self.modes.build(self.backend, self.index)
        self._change()

    def descriptor(self, robot: str) -> RobotDescriptor:
        """Return what the robot of that name is."""
        return self.layout[robot].robot

    def step(
        self,
        action: NDArray[np.float32],
        joint_positions: NDArray[np.float32],
        env_ids: Iterable[int] | None = None,
    ) -> None:
        """Advance worlds by one control step.

        Args:
            action: Shape (N, A), finite.
            joint_positions: Joint positions before the step, shape (N, dof) (rad, m).
            env_ids: Which worlds; all if None. The others stand still.
        """
        self.backend.step(self._drive(action, joint_positions, env_ids), self.substeps)

    def rest(self, state: State, env_ids: Sequence[int]) -> None:
        """Drive all joints of worlds to where they are, until a step drives them elsewhere.

        Args:
            state: The worlds as they are now; it stays the present one.
            env_ids: Which worlds.
        """
        self.drive_targets[env_ids] = state.joint_positions[env_ids]
        self.backend.drive(self.drive_targets, env_ids)
        self.backend.drive_velocities(np.zeros_like(self.drive_targets), env_ids)

    def coast(self, env_ids: Sequence[int]) -> None:
        """Advance worlds by one control step without driving them anew."""
        self._change()
        self.backend.step(env_ids, self.substeps)

    def timed_step(
        self, action: NDArray[np.float32], clock: Callable[[], float] = perf_counter
    ) -> float:
        """Advance like `step` and return the time that physics alone took (s).

        The floor that any task's step is measured against.

        Args:
            action: Shape (N, A), finite.
            clock: Tells the time (s).
        """
        moving = self._drive(action, self.read().joint_positions, None)
        start = clock()
        self.backend.step(moving, self.substeps)
        return clock() - start

    def clear(self, env_ids: Sequence[int]) -> None:
        """Begin a reset of some worlds: everything rests, and anchored bodies are put back."""
        self._change()
        self._fresh.update(env_ids)
        self.backend.clear(env_ids)

    def vary(self, variations: Mapping[int, Variation]) -> None:
        """Let worlds differ from what was built; see `vary`."""
        self._change()
        self.backend.vary(variations)

    def hold(self, state: State) -> None:
        """End a reset: targets that control modes remember are where the robots are now."""
        if self.modes is not None and self._fresh:
            self.modes.begin(state, sorted(self._fresh))
        self._fresh.clear()

    def place(
        self,
        bodies: str | Sequence[str],
        positions: Array,
        quaternion: Quaternion = IDENTITY,
        *,
        where: Array,
    ) -> None:
        """Move a body in some worlds; `read` sees it.

        Args:
            bodies: Its name, or one name for each world.
            positions: Shape (N, 3) (m, world).
            quaternion: How it is turned, wxyz.
            where: In which worlds, (N,) bool.

        Raises:
            UnknownNameError: If there is no such body.
            SimulationError: If there are more rows than worlds, or fewer, or a pose is invalid.
        """
        count, given = self.num_envs, (np.shape(positions), np.shape(where))
        if given != ((count, 3), (count,)):
            raise SimulationError(
                f"place takes positions of shape {(count, 3)} and where of shape {(count,)}, a row"
                f" for each environment; given: {given[0]} and {given[1]}"
            )
        names = [bodies] * count if isinstance(bodies, str) else bodies
        rows = zip(self.worlds, names, positions.tolist(), where.tolist(), strict=True)
        for world, name, position, moved in rows:
            if moved:
                world.set_pose(name, position, quaternion)

    def write(self, env_ids: Sequence[int], bodies: Rows, robots: Rows) -> None:
        """Put worlds into a state; see `robot_layouts.simulation.backend.Backend.write`."""
        self._change()
        self.backend.write(env_ids, bodies, robots)

    def read(self) -> State:
        """Return what all worlds look like now."""
        if self._placements:
            self._change()
        state = State(self.backend.read(), self.index, self._moment)
        if self.modes is not None:
            self._latest = state
        return state

    def touched(self) -> None:
        """Note that a world was changed by hand, so that earlier states count as past."""
        self._change()

    def look(
        self, env: int, cameras: Mapping[str, AnyCamera], textures: Sequence[str], *, markers: bool
    ) -> list[View]:
        """Return what cameras see in a world now; see `look`."""
        return self.begin_look(env, cameras, textures, markers=markers)()

    def begin_look(
        self, env: int, cameras: Mapping[str, AnyCamera], textures: Sequence[str], *, markers: bool
    ) -> Callable[[], list[View]]:
        """Begin to draw what cameras see now; see `look`."""
        if self._placements:
            self._change()
        return self.backend.look(env, cameras, textures, markers=markers)

    def export(
        self,
        written_as: str,
        state: State,
        path: str | PathLike[str],
        things: Iterable[ObjectDescriptor] = (),
    ) -> Path:
        """Write the first world in a state for other programs.

        Args:
            written_as: The format, one of `EXPORTS`; see `tasks.TaskEnv.to_mjcf`, ``to_usd`` and
                ``to_ros2``.
            state: The state.
            path: Where to write it.
            things: Whose licences are named beside those of robots.
        """
        return resolve_name(EXPORTS[written_as])(self.worlds[0], state, path, things)

    def describe_graphics(self) -> dict[str, str]:
        """Return on what pictures are drawn; see `Backend.describe_graphics`."""
        return self.backend.describe_graphics()

    # -- inside ------------------------------------------------------------------------------

    def _drive(
        self, action: Floats, joint_positions: Floats, env_ids: Iterable[int] | None
    ) -> Sequence[int]:
        """Set the drive targets of worlds, and return which."""
        if self.modes is not None:
            return self._drive_modes(self.modes, action, env_ids)
        self._change()
        targets = self._controller.targets(action, joint_positions)
        if env_ids is None:
            moving, self.drive_targets = self._everywhere, targets
        else:
            moving = list(env_ids)
            self.drive_targets[moving] = targets[moving]
        self.backend.drive(targets, moving)
        return moving

    def _drive_modes(
        self, modes: ModeController, action: Floats, env_ids: Iterable[int] | None
    ) -> Sequence[int]:
        state = self._latest
        if state is None or self._placements:
            state = self.read()
        moving = self._everywhere if env_ids is None else list(env_ids)
        if self._fresh:
            self.hold(state)
        self._change()
        targets, velocities = modes.command(action, state, moving)
        if env_ids is None:
            self.drive_targets = targets
        else:
            self.drive_targets[moving] = targets[moving]
        self.backend.drive(targets, moving)
        if velocities is not None:
            self.backend.drive_velocities(velocities, moving)
        return moving

    def _change(self) -> None:
        """Place what is to be placed, and let states that were read be past."""
        if self._placements:
            self.backend.place(self._placements)
            self._placements.clear()
        self._moment.past = True
        self._moment = Moment(self.backend)
        self._latest = None

    def _describe(self, index: int, build: Callable[[World, int], None]) -> World:
        world = World(
            self.layout,
            self._physics,
            visuals=self._visuals,
            number=index,
            placements=self._placements,
            links_pass=self.links_pass,
            shadows=self._shadows,
        )
        build(world, index)
        return world


def _expect_alike(worlds: Mapping[int, World]) -> None:
    """Refuse worlds with other bodies than the first, since all are read as one array."""
    bodies = list(worlds[min(worlds)].bodies)
    for number, world in worlds.items():
        if list(world.bodies) != bodies:
            raise SimulationError(
                f"environment {number} has the bodies {list(world.bodies)}, environment"
                f" {min(worlds)} {bodies}; all have the same ones, added in the same order"
            )

"""MuJoCo behind the seam: every verb of `Backend`."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from layouts import Layout
from robot_layouts.simulation.backend import (
    Built,
    EachWorld,
    Overlap,
    Pair,
    Part,
    PoseFollower,
    Readout,
    Rows,
    Velocity,
    arms_of,
)
from robot_layouts.simulation.cameras import AnyCamera, View
from robot_layouts.simulation.control.joint_positions import linkages
from robot_layouts.simulation.maths import Flags, Floats
from robot_layouts.simulation.mujoco import mujoco
from robot_layouts.simulation.mujoco.model import Inventory, RobotModels, substeps_of
from robot_layouts.simulation.mujoco.pictures import Pictures
from robot_layouts.simulation.mujoco.world import (
    ArmWatcher,
    ForceReader,
    MujocoWorld,
    extent_of,
    overlaps_in,
    presses_on_object,
)
from robot_layouts.simulation.physics import PhysicsSettings
from robot_layouts.simulation.solvers import TreeArm, TreeFollower
from robot_layouts.simulation.world import World, WorldBody

# What does not fit is seen in the state, which is no number then; MuJoCo would write a file of it.
mujoco.set_mju_user_warning(lambda message: None)


class MujocoBackend(EachWorld):
    """N worlds of one layout, each with a state of its own; alike ones share a model.

    A clone of a task of ManiSkill's is the same task here, with other physics.

    Attributes:
        worlds: The worlds.
    """

    worlds: list[MujocoWorld]

    def __init__(self) -> None:
        """Begin without worlds."""
        super().__init__()
        self._robots: RobotModels | None = None
        self._threads = Threads()
        self._pictures = Pictures()

    def build(self, worlds: Mapping[int, World]) -> Built:
        """Build worlds; see `Backend`."""
        first = next(iter(worlds.values()))
        if self._robots is None:
            self._robots = RobotModels(first.layout, visuals=bool(first.visuals))
        robots = self._robots
        models: dict[tuple[PhysicsSettings, tuple[WorldBody, ...]], Any] = {}
        built: dict[int, MujocoWorld] = {}
        for number, world in worlds.items():
            alike = world.physics, tuple(world.bodies.values())
            if alike not in models:
                models[alike] = robots.compile(world)
                self._index = Inventory(models[alike], world, robots.cell)
            inner = substeps_of(world.physics.timestep, robots.timestep)
            built[number] = MujocoWorld(world, models[alike], self._index, inner)
        self._keep(built)
        self._pictures.keep(self.worlds)
        self._drives = JointDrives(self.worlds, first.layout, self._index)
        self._forces: dict[tuple[Pair, ...], ForceReader] = {}
        if self._watchers is not None:
            self.watch_arms()
        return self._index.built

    def drive(self, targets: Floats, env_ids: Sequence[int]) -> None:
        """Set drive targets; see `Backend`."""
        self._drives.positions[env_ids] = targets[env_ids]

    def drive_velocities(self, velocities: Floats, env_ids: Sequence[int]) -> None:
        """Set targets of velocity; see `Backend`."""
        self._drives.velocities[env_ids] = velocities[env_ids]

    def step(self, env_ids: Sequence[int], substeps: int) -> None:
        """Advance worlds; see `Backend`."""
        for i in env_ids:
            self._drives.pull(i)
        self._threads.run([partial(self.worlds[i].step, substeps) for i in env_ids])

    def read(self) -> Readout:
        """Return poses and joints; see `Backend`."""
        joints, count = self._index.joints, len(self.worlds)
        poses = np.empty((count, self._index.built.frames, 7), np.float32)
        qpos, qvel = np.empty((2, count, len(joints.qpos)), np.float32)
        for i, world in enumerate(self.worlds):
            world.update()
            data = world.data
            poses[i, :, :3], poses[i, :, 3:] = data.xpos[1:], data.xquat[1:]
            self._index.turned.turn(poses[i, :, 3:], data.qpos)
            qpos[i], qvel[i] = data.qpos[joints.qpos], data.qvel[joints.qvel]
        return Readout(poses.swapaxes(0, 1), qpos, qvel)

    def velocities(self, wanted: tuple[Velocity, ...]) -> Floats:
        """Return velocities of bodies; see `Backend`."""
        bodies = [self._mover(name) for name, _ in wanted]
        columns = [slice(3, 6) if kind == "linear" else slice(0, 3) for _, kind in wanted]
        found = np.empty((len(wanted), len(self.worlds), 3), np.float32)
        for i, world in enumerate(self.worlds):
            rows = world.velocities(bodies)
            for number, column in enumerate(columns):
                found[number, i] = rows[number, column]
        return found

    def root_velocities(self) -> Floats:
        """Return velocities of the robots' roots, which are fixed; see `Backend`."""
        return np.zeros((len(self._index.robots), len(self.worlds), 6), np.float32)

    def body_joints(self, body: str) -> Floats:
        """Return joints of a body; see `Backend`."""
        joints = self._index.jointed[body]
        rows = [(w.data.qpos[joints.qpos], w.data.qvel[joints.qvel]) for w in self.worlds]
        return np.array(rows, np.float32).reshape(len(rows), -1)

    def forces(self, pairs: tuple[Pair, ...]) -> Floats | None:
        """Return contact forces of pairs; see `Backend`."""
        if pairs not in self._forces:
            self._forces[pairs] = ForceReader(self.worlds[0], pairs)
        return self._forces[pairs].read(self.worlds)

    def write(self, env_ids: Sequence[int], bodies: Rows, robots: Rows) -> None:
        """Put worlds into a state; see `Backend`."""
        for row, i in enumerate(env_ids):
            world = self.worlds[i]
            for name, values in bodies.items():
                if world.declared.bodies[name].part_of is None:
                    world.restore_body(name, values[row])
            for name, values in robots.items():
                world.restore_robot(name, values[row])

    def look(
        self, env: int, cameras: Mapping[str, AnyCamera], textures: Sequence[str], *, markers: bool
    ) -> Callable[[], list[View]]:
        """Begin to draw what cameras see; see `Backend`."""
        views = self._pictures.look(self.worlds[env], cameras, textures, markers=markers)
        return lambda: views

    def describe_graphics(self) -> dict[str, str]:
        """Return on what pictures are drawn; see `Backend`."""
        return {"engine": f"MuJoCo {mujoco.__version__}", "driver": os.environ.get("MUJOCO_GL", "")}

    def segments(self) -> dict[int, Part]:
        """Return what segmentation's numbers stand for; see `Backend`."""
        return dict(self._index.parts)

    def pose_follower(
        self, robot: str, link: str, root_link: str | None, joints: Sequence[str]
    ) -> PoseFollower:
        """Return what follows poses of a link; see `Backend`."""
        layout = self.worlds[0].declared.layout
        return TreeFollower(layout[robot].robot, link, root_link, joints)

    def contact_counts(self) -> NDArray[np.int64]:
        """Return how many pairs of bodies touch; see `Backend`."""
        return np.array([world.data.ncon for world in self.worlds])

    def overlaps(self, env: int) -> list[Overlap]:
        """Return which parts are inside each other; see `Backend`."""
        return overlaps_in(self.worlds[env])

    def watch_arms(self) -> None:
        """Look at which arms touch from now on; see `Backend`."""
        assert self._robots is not None
        models = {name: s.source.model for name, s in self._robots.cell.robots.items()}
        known, arms = self._watchers or {}, arms_of(self.worlds[0].declared.layout, models)
        self._watchers = {w: known.get(w) or ArmWatcher(w, arms) for w in self.worlds}
        for world, watcher in self._watchers.items():
            world.after_each = watcher.look

    def touching(self) -> Flags:
        """Tell where a link pressed on a dynamic body; see `Backend`."""
        return np.array([presses_on_object(world) for world in self.worlds])

    def extents(self, env: int) -> dict[Part, Floats]:
        """Return the box around what collides; see `Backend`."""
        world = self.worlds[env]
        world.update()
        boxes = {
            part: extent_of(world.model, world.data, body)
            for body, part in self._index.parts.items()
        }
        return {part: box for part, box in boxes.items() if box is not None}

    def collision_shapes(self, env: int, body: str) -> list[tuple[Any, ...]]:
        """Return what a body collides with; see `Backend`."""
        model, number = self.worlds[env].model, self._index.body(None, body)
        first = model.body_geomadr[number]
        return [
            (
                mujoco.mjtGeom(model.geom_type[geom]).name,
                *model.geom_pos[geom].tolist(),
                *model.geom_quat[geom].tolist(),
                model.geom_size[geom].tolist(),
            )
            for geom in range(first, first + model.body_geomnum[number])
            if model.geom_contype[geom]
        ]

    def _mover(self, name: str) -> int | None:
        moves = self.worlds[0].declared.bodies[name].kind == "dynamic"
        return self._index.body(None, name) if moves else None

    def _arm(self, robot: str) -> TreeArm:
        """Return an arm that stands where it does in the first world."""
        (first, *_), layout = self.worlds, self.worlds[0].declared.layout
        owner = layout.owner(robot)
        return TreeArm(layout, robot, first.base_of(owner))


class Threads:
    """As many threads as torch may use in this process; those of a fork are its own."""

    def __init__(self) -> None:
        """Begin without threads."""
        self._pool: ThreadPoolExecutor | None = None
        self._made_for = (0, 0)

    def run(self, works: Sequence[Callable[[], None]]) -> None:
        """Do all of it, and return when all is done."""
        count = torch.get_num_threads()
        if count < 2 or len(works) < 2:
            for work in works:
                work()
            return
        if self._pool is None or self._made_for != (os.getpid(), count):
            self._pool, self._made_for = ThreadPoolExecutor(count), (os.getpid(), count)
        for _ in self._pool.map(lambda work: work(), works):
            pass


class JointDrives:
    """The targets of all joints, robots in layout order, joints in the descriptors'.

    A drive pulls with stiffness · (target - position) + damping · (target - velocity), as far as
    its limit lets it; what depends on the targets is its control.

    Attributes:
        positions: Targets of position, (N, dof) (rad, m).
        velocities: Targets of velocity, (N, dof) (rad/s, m/s).
    """

    def __init__(self, worlds: Sequence[MujocoWorld], layout: Layout, index: Inventory) -> None:
        """Hold all joints where the layout starts them."""
        start = [qpos for placement in layout.values() for qpos in placement.start_qpos]
        self.positions = np.tile(np.array(start), (len(worlds), 1))
        self.velocities = np.zeros_like(self.positions)
        self._worlds, self._joints = worlds, index.joints
        self._linkages = linkages(layout)
        if self._linkages:
            for i, world in enumerate(worlds):
                world.before_each = lambda i=i: self.pull(i)

    def pull(self, env: int) -> None:
        """Set what the drives of a world do in its next step."""
        model, data = self._worlds[env].model, self._worlds[env].data
        positions, velocities = self.positions[env], self.velocities[env]
        if self._linkages:
            positions, velocities = positions.copy(), velocities.copy()
        for linkage in self._linkages:
            at = linkage.places
            qpos, qvel = data.qpos[self._joints.qpos[at]], data.qvel[self._joints.qvel[at]]
            positions[at], velocities[at] = linkage.targets(positions[at][0], qpos, qvel)
        springs, dampers = model.actuator_biasprm[:, 1], model.actuator_biasprm[:, 2]
        data.ctrl[:] = -springs * positions - dampers * velocities

"""SAPIEN 3 behind the seam: every verb of `Backend`, world by world."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot_layouts.simulation.backend import (
    Built,
    BuiltRobot,
    EachWorld,
    Overlap,
    Pair,
    Part,
    Readout,
    Rows,
    Velocity,
    arms_of,
)
from robot_layouts.simulation.cameras import AnyCamera, View
from robot_layouts.simulation.maths import Flags, Floats
from robot_layouts.simulation.sapien3.arms import PinocchioFollower, SapienArm
from robot_layouts.simulation.sapien3.blueprint import Blueprint
from robot_layouts.simulation.sapien3.bodies import described_shapes
from robot_layouts.simulation.sapien3.contacts import (
    ArmContacts,
    PairForces,
    components_of,
    extents_of,
    overlaps_in,
    presses_on_object,
)
from robot_layouts.simulation.sapien3.device import describe_graphics
from robot_layouts.simulation.sapien3.world import BuiltWorld, build_world
from robot_layouts.simulation.world import World
from robots import RobotDescriptor

_STILL = np.zeros(3, np.float32)


class SapienBackend(EachWorld):
    """N worlds of one layout, each a scene of its own.

    Attributes:
        worlds: The worlds.
    """

    worlds: list[BuiltWorld]

    def __init__(self) -> None:
        """Begin without worlds."""
        super().__init__()
        self._blueprints: dict[RobotDescriptor, Blueprint] = {}

    def build(self, worlds: Mapping[int, World]) -> Built:
        """Build worlds; see `Backend`."""
        built = {i: build_world(world, self._blueprints) for i, world in worlds.items()}
        self._keep(built)
        robots = [robot for world in self.worlds for robot in world.robots.values()]
        self._articulations: list[Any] = [robot.articulation for robot in robots]
        self._setters: list[list[Callable[[float], None]]] = [
            [set_target for robot in world.robots.values() for set_target in robot.setters]
            for world in self.worlds
        ]
        self._velocity_setters: list[list[Callable[[float], None]]] = [
            [
                joint.set_drive_velocity_target
                for robot in world.robots.values()
                for joint in robot.driven
            ]
            for world in self.worlds
        ]
        self._packers = [world.scene.pack_poses for world in self.worlds]
        self._steps = [world.stepper() for world in self.worlds]
        if self._watchers is not None:
            self.watch_arms()
        self._places = _pose_places(len(self.worlds), len(self.worlds[0].scene.entities))
        self._order = _declared_order(self.worlds[0])
        self._forces: dict[tuple[Pair, ...], PairForces] = {}
        self._movers: dict[tuple[Velocity, ...], list[tuple[Any, str]]] = {}
        return _inventory(self.worlds[0])

    def drive(self, targets: Floats, env_ids: Sequence[int]) -> None:
        """Set drive targets; see `Backend`."""
        for i in env_ids:
            for set_target, target in zip(self._setters[i], targets[i].tolist(), strict=True):
                set_target(target)

    def drive_velocities(self, velocities: Floats, env_ids: Sequence[int]) -> None:
        """Set targets of velocity; see `Backend`."""
        for i in env_ids:
            setters = self._velocity_setters[i]
            for set_target, velocity in zip(setters, velocities[i].tolist(), strict=True):
                set_target(velocity)

    def step(self, env_ids: Sequence[int], substeps: int) -> None:
        """Advance worlds; see `Backend`."""
        for i in env_ids:
            step = self._steps[i]
            for _ in range(substeps):
                step()

    def read(self) -> Readout:
        """Return poses and joints; see `Backend`."""
        packed = np.frombuffer(b"".join([pack() for pack in self._packers]), np.float32)
        qpos = self._rows([robot.qpos for robot in self._articulations])
        qvel = self._rows([robot.qvel for robot in self._articulations])
        if self._order is not None:
            qpos, qvel = qpos.take(self._order, 1), qvel.take(self._order, 1)
        return Readout(packed[self._places], qpos, qvel)

    def velocities(self, wanted: tuple[Velocity, ...]) -> Floats:
        """Return velocities of bodies; see `Backend`."""
        movers = self._movers.get(wanted)
        if movers is None:
            movers = self._movers[wanted] = self._find_movers(wanted)
        rows = [_STILL if body is None else getattr(body, kind) for body, kind in movers]
        return np.concatenate(rows).reshape(len(wanted), -1, 3)

    def root_velocities(self) -> Floats:
        """Return velocities of the robots' roots; see `Backend`."""
        roots = [[robot.root for robot in world.robots.values()] for world in self.worlds]
        rows = [[(*r.linear_velocity, *r.angular_velocity) for r in world] for world in roots]
        return np.array(rows, np.float32).swapaxes(0, 1)

    def body_joints(self, body: str) -> Floats:
        """Return joints of a body; see `Backend`."""
        return np.stack([world.jointed(body).joints for world in self.worlds])

    def forces(self, pairs: tuple[Pair, ...]) -> Floats | None:
        """Return contact forces of pairs; see `Backend`."""
        forces = self._forces.get(pairs)
        if forces is None:
            forces = self._forces[pairs] = PairForces(self.worlds, pairs)
        return forces.read()

    def write(self, env_ids: Sequence[int], bodies: Rows, robots: Rows) -> None:
        """Put worlds into a state; see `Backend`."""
        for row, i in enumerate(env_ids):
            world = self.worlds[i]
            for name, values in bodies.items():
                world.bodies[name].restore(values[row])
            for name, values in robots.items():
                world.robots[name].restore(values[row])

    def look(
        self, env: int, cameras: Mapping[str, AnyCamera], textures: Sequence[str], *, markers: bool
    ) -> Callable[[], list[View]]:
        """Begin to draw what cameras see; see `Backend`."""
        from robot_layouts.simulation.sapien3.studio import (
            look,  # what draws is loaded by the first picture
        )

        return look(self.worlds[env], cameras, textures, markers=markers)

    def describe_graphics(self) -> dict[str, str]:
        """Return on what pictures are drawn; see `Backend`."""
        return describe_graphics(self.worlds[0].scene.render_system.device.name)

    def segments(self) -> dict[int, Part]:
        """Return what segmentation's numbers stand for; see `Backend`."""
        return {
            component.entity.per_scene_id: part for part, component in components_of(self.worlds[0])
        }

    def pose_follower(
        self, robot: str, link: str, root_link: str | None, joints: Sequence[str]
    ) -> PinocchioFollower:
        """Return what follows poses of a link; see `Backend`."""
        world = self.worlds[0]
        urdf = self._blueprints[world.layout[robot].robot].contents
        return PinocchioFollower(world.robots[robot], urdf, link, root_link, joints)

    def contact_counts(self) -> NDArray[np.int64]:
        """Return how many pairs of bodies touch; see `Backend`."""
        return np.array([len(world.system.get_contacts()) for world in self.worlds])

    def overlaps(self, env: int) -> list[Overlap]:
        """Return which parts are inside each other; see `Backend`."""
        return overlaps_in(self.worlds[env])

    def watch_arms(self) -> None:
        """Look at which arms touch from now on; see `Backend`."""
        known, layout = self._watchers or {}, self.worlds[0].layout
        models = {name: self._blueprints[own.robot].model for name, own in layout.items()}
        arms = arms_of(layout, models)
        self._watchers = {w: known.get(w) or ArmContacts(w, arms) for w in self.worlds}
        self._steps = [watcher.step for watcher in self._watchers.values()]

    def touching(self) -> Flags:
        """Tell where a link pressed on a dynamic body; see `Backend`."""
        return np.array(
            [presses_on_object(w.system.get_contacts(), w.articulations) for w in self.worlds]
        )

    def extents(self, env: int) -> dict[Part, Floats]:
        """Return the box around what collides; see `Backend`."""
        return extents_of(self.worlds[env])

    def collision_shapes(self, env: int, body: str) -> list[tuple[Any, ...]]:
        """Return what a body collides with; see `Backend`."""
        return described_shapes(self.worlds[env].bodies[body].component)

    def _rows(self, joints: list[Floats]) -> Floats:
        """Return joints of all robots of all worlds as one row for each world."""
        if len(joints) == 1:
            return joints[0][None]
        return np.concatenate(joints).reshape(len(self.worlds), -1)

    def _arm(self, robot: str) -> SapienArm:
        return SapienArm(self.worlds[0], robot)

    def _find_movers(self, wanted: tuple[Velocity, ...]) -> list[tuple[Any, str]]:
        return [
            (body.component if body.declared.kind == "dynamic" else None, f"{kind}_velocity")
            for name, kind in wanted
            for body in (world.bodies[name] for world in self.worlds)
        ]


def _inventory(world: BuiltWorld) -> Built:
    place = {entity: i for i, entity in enumerate(world.scene.entities)}
    robots = {
        name: BuiltRobot(
            links={link: place[part.entity] for link, part in robot.links.items()},
            limits=np.concatenate([joint.limits for joint in robot.driven]),
            speeds=robot.speeds,
            loaded_order=tuple(robot.loaded_order),
        )
        for name, robot in world.robots.items()
    }
    bodies = {name: place[body.entity] for name, body in world.bodies.items()}
    joints = {
        name: tuple(joint.name for joint in body.declared.joints)
        for name, body in world.bodies.items()
        if body.declared.joints
    }
    return Built(len(place), bodies, robots, joints)


def _pose_places(worlds: int, frames: int) -> NDArray[np.intp]:
    """Return where each number of the pose table, (F, N, 7), stands in what SAPIEN packs.

    It packs one world after the other, and the quaternion before the position.
    """
    packed = np.arange(worlds * frames * 7).reshape(worlds, frames, 7).swapaxes(0, 1)
    return np.ascontiguousarray(packed[:, :, [4, 5, 6, 0, 1, 2, 3]])


def _declared_order(world: BuiltWorld) -> NDArray[np.intp] | None:
    """Return where each joint of the descriptors stands in SAPIEN's; None if in its own place."""
    order: list[int] = []
    for robot in world.robots.values():
        order += [len(order) + i for i in robot.active_index]
    return None if order == sorted(order) else np.array(order)


def worlds_below(simulation: Any) -> list[BuiltWorld]:
    """Return what SAPIEN holds of a simulation's worlds: for what lives below the seam, and tests.

    Args:
        simulation: A `robot_layouts.simulation.Simulation` with this backend.
    """
    return simulation.backend.worlds

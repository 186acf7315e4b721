"""One environment's world: a SAPIEN scene with a layout's robots and a task's bodies."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Literal

import sapien
import sapien.physx as physx

from layouts import Layout
from robots import SimulationError, UnknownNameError
from robots.descriptor import IDENTITY, Quaternion, Vector3
from simulation.blueprint import Blueprint, read_blueprint
from simulation.physics import SAPIEN_DEFAULTS, PhysicsSettings, apply
from simulation.rendering.device import expect_render_device, outlive_forks
from simulation.robot import SimulatedRobot
from simulation.shapes import Shape, add_collision

BodyKind = Literal["dynamic", "kinematic", "static"]


@dataclass(frozen=True)
class SimulatedBody:
    """A body that a task put into the world.

    Attributes:
        name: Its name, also in the state dict.
        entity: SAPIEN's entity.
        component: Its physics component.
        kind: Whether physics, only the task, or nothing moves it.
        start_pose: Pose it was built at.
        anchored: Whether every reset puts it back to ``start_pose``.
        shapes: What it is made of.
        marker: Whether cameras that observe do not see it.
    """

    name: str
    entity: sapien.Entity
    component: Any
    kind: BodyKind
    start_pose: sapien.Pose
    anchored: bool
    shapes: tuple[Shape, ...] = ()
    marker: bool = False


class World:
    """Robots first, in the layout's order, then bodies in the order in which they are added.

    The order of dynamic bodies decides the order in which PhysX solves contacts, so it is part of
    what a task declares.

    Attributes:
        layout: Which robots stand where.
        physics: Settings the world was built with.
        scene: SAPIEN's scene.
        system: Its physics system.
        robots: Robot by name in the layout.
        articulations: The robots' articulations, in layout order.
        links: Robot and link name of each link, by the identity of its component.
        bodies: Body by name.
        design: Geometry drawn for the coming episodes, if the task draws any.
    """

    def __init__(
        self,
        layout: Layout,
        physics: PhysicsSettings | None = None,
        *,
        visuals: bool = False,
        blueprints: dict[str, Blueprint] | None = None,
    ) -> None:
        """Build the robots of a layout.

        Args:
            layout: Which robots stand where.
            physics: Solver settings; None keeps SAPIEN's own defaults.
            visuals: Whether to build what pictures need (a Vulkan driver must be present).
            blueprints: What was read of the robots for an earlier world that is like this one,
                by name; what is missing is read and added.

        Raises:
            AssetError: If a robot's files cannot be found.
            SimulationError: If pictures are wanted and there is no Vulkan driver.
        """
        self.layout = layout
        self.physics = SAPIEN_DEFAULTS if physics is None else physics
        self.visuals = visuals
        apply(self.physics)
        self.system = physx.PhysxCpuSystem()
        systems: list[Any] = [self.system]
        if visuals:
            systems.append(_render_system())
            outlive_forks(self)
        self.scene = sapien.Scene(systems)
        self.system.timestep = self.physics.timestep
        blueprints = {} if blueprints is None else blueprints
        self.robots: dict[str, SimulatedRobot] = {}
        for name, placement in layout.items():
            if name not in blueprints:
                blueprints[name] = read_blueprint(placement.robot, visuals=visuals)
            self.robots[name] = SimulatedRobot(self.scene, name, placement, blueprints[name])
        self.articulations = [robot.articulation for robot in self.robots.values()]
        self.links = {
            id(link): (name, link_name)
            for name, robot in self.robots.items()
            for link_name, link in robot.links.items()
        }
        self.bodies: dict[str, SimulatedBody] = {}
        self.design: Any = None

    def add(
        self,
        name: str,
        *shapes: Shape,
        kind: BodyKind = "dynamic",
        position: Vector3 = (0.0, 0.0, 0.0),
        quaternion: Quaternion = IDENTITY,
        anchored: bool = False,
        marker: bool = False,
    ) -> SimulatedBody:
        """Add a body made of shapes.

        Args:
            name: A name no other body of this world has.
            shapes: Its shapes, in the body's frame.
            kind: ``"dynamic"`` moves by physics, ``"kinematic"`` by the task, ``"static"`` never.
            position: Where it is built (m, world).
            quaternion: How it is turned, wxyz.
            anchored: Whether every reset puts it back there.
            marker: Whether it is there for people only: cameras that observe do not see it.

        Raises:
            SimulationError: If the name is taken.
        """
        if name in self.bodies:
            raise SimulationError(f"this world already has a body called {name!r}")
        builder = self.scene.create_actor_builder()
        for shape in shapes:
            add_collision(builder, shape)
        builder.set_physx_body_type(kind)
        pose = sapien.Pose(list(position), list(quaternion))
        builder.set_initial_pose(pose)
        entity = builder.build(name)
        if self.visuals:
            _draw(entity, shapes)
        component = entity.find_component_by_type(
            physx.PhysxRigidStaticComponent
            if kind == "static"
            else physx.PhysxRigidDynamicComponent
        )
        body = SimulatedBody(name, entity, component, kind, pose, anchored, shapes, marker)
        self.bodies[name] = body
        return body

    def body(self, name: str) -> SimulatedBody:
        """Return a body by name.

        Raises:
            UnknownNameError: If the world has no such body.
        """
        if name not in self.bodies:
            raise UnknownNameError("body of this world", name, self.bodies)
        return self.bodies[name]

    def settle(self) -> None:
        """End the build: set every start pose once more, as native does."""
        for body in self.bodies.values():
            if body.kind != "static":
                body.entity.set_pose(body.start_pose)
        for robot in self.robots.values():
            robot.articulation.set_root_pose(robot.base_pose)

    def clear(self) -> None:
        """Begin a reset: zero every velocity and force, and put anchored bodies back.

        PhysX keeps its contact caches: a reset world remembers, a rebuilt one does not.
        """
        for body in self.bodies.values():
            if body.kind == "dynamic":
                body.component.set_linear_velocity([0.0, 0.0, 0.0])
                body.component.set_angular_velocity([0.0, 0.0, 0.0])
        for robot in self.robots.values():
            robot.stop()
        for body in self.bodies.values():
            if body.anchored:
                body.entity.set_pose(body.start_pose)

    def set_pose(self, name: str, position: Any, quaternion: Any = IDENTITY) -> None:
        """Move a body.

        Args:
            name: Body name.
            position: Three numbers (m, world).
            quaternion: Four numbers, wxyz.
        """
        self.set_poses((name,), position, quaternion)

    def set_poses(self, names: Iterable[str], position: Any, quaternion: Any = IDENTITY) -> None:
        """Move several bodies to the same pose; see `set_pose`."""
        pose = sapien.Pose(_floats(position), _floats(quaternion))
        for name in names:
            self.body(name).entity.set_pose(pose)


def _floats(values: Any) -> list[float]:
    return values.tolist() if hasattr(values, "tolist") else [float(x) for x in values]


def _draw(entity: sapien.Entity, shapes: tuple[Shape, ...]) -> None:
    from simulation.rendering.visuals import visual_component

    component = visual_component(shapes)
    if component is not None:
        entity.add_component(component)


def _render_system() -> Any:
    from sapien.render import RenderSystem

    expect_render_device()
    try:
        return RenderSystem()
    except RuntimeError as error:
        raise SimulationError(
            f"pictures need a Vulkan driver, and none works here ({error}); without pictures"
            " (render_mode=None, obs_mode='state') everything else works"
        ) from error

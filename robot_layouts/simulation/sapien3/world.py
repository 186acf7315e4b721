"""One world in SAPIEN: a scene with a layout's robots and a task's bodies."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

import numpy as np
import sapien
import sapien.physx as physx
from numpy.typing import NDArray

from layouts import Layout
from robot_layouts.core.portable import is_portable
from robot_layouts.simulation.physics import SAPIEN_DEFAULTS, PhysicsSettings
from robot_layouts.simulation.sapien3.blueprint import Blueprint, read_blueprint
from robot_layouts.simulation.sapien3.bodies import BuiltBody, JointedBody, build_bodies
from robot_layouts.simulation.sapien3.device import expect_render_device, outlive_forks
from robot_layouts.simulation.sapien3.exact_division import divide_exactly
from robot_layouts.simulation.sapien3.robot import SimulatedRobot
from robot_layouts.simulation.variation import AS_DECLARED, Variation
from robot_layouts.simulation.world import Part, Visuals, World, WorldBody
from robots import RobotDescriptor, SimulationError

_Value = TypeVar("_Value")


def apply_settings(settings: PhysicsSettings) -> None:
    """Write the settings into SAPIEN's process-wide configuration.

    They bind when a scene, a body or a shape is made, so this runs before every build: another
    world's build may have changed them since.
    """
    physx.set_shape_config(contact_offset=settings.contact_offset, rest_offset=settings.rest_offset)
    physx.set_body_config(
        solver_position_iterations=settings.position_iterations,
        solver_velocity_iterations=settings.velocity_iterations,
        sleep_threshold=settings.sleep_threshold,
    )
    gravity: Any = settings.gravity  # SAPIEN takes any sequence
    physx.set_scene_config(
        gravity=gravity,
        bounce_threshold=settings.bounce_threshold,
        enable_pcm=settings.persistent_contacts,
        enable_tgs=settings.temporal_gauss_seidel,
        enable_ccd=settings.continuous_collision,
        enable_enhanced_determinism=settings.enhanced_determinism,
        enable_friction_every_iteration=settings.friction_every_iteration,
        cpu_workers=0,  # more workers are slower for scenes this small
    )
    friction = settings.friction
    physx.set_default_material(friction.static, friction.dynamic, friction.restitution)


class BuiltWorld:
    """Robots first, in the layout's order, then bodies in the order declared.

    Attributes:
        layout: Which robots stand where.
        physics: Settings it was built with.
        visuals: Whether it has what pictures need.
        scene: SAPIEN's scene.
        system: Its physics system.
        robots: Robot by name in the layout.
        articulations: The robots' articulations, in layout order.
        bodies: Body by name.
        studio: Its cameras and lights, once a picture was taken.
        built: What varied parts were built with; see `vary`.
        looks: What differs in its pictures.
        shadows: Whether the first light casts shadows in them.
    """

    studio: Any = None  # as long as the world lives, also in a fork

    def __init__(
        self,
        layout: Layout,
        physics: PhysicsSettings | None = None,
        *,
        visuals: Visuals = False,
        blueprints: dict[RobotDescriptor, Blueprint] | None = None,
        links_pass: bool = False,
    ) -> None:
        """Build the robots of a layout.

        Args:
            layout: Which robots stand where.
            physics: Solver settings; None keeps SAPIEN's own defaults.
            visuals: Whether to build what pictures need (a Vulkan driver must be present).
            blueprints: What was read of the robots for an earlier world that is like this one,
                by descriptor; what is missing is read and added.
            links_pass: See `robot_layouts.simulation.World`.

        Raises:
            AssetError: If a robot's files cannot be found.
            SimulationError: If pictures are wanted and there is no Vulkan driver, or this process
                was begun to be portable and cannot be.
        """
        self.layout = layout
        self.physics = SAPIEN_DEFAULTS if physics is None else physics
        self.visuals: Visuals = visuals
        if is_portable():
            divide_exactly()
        apply_settings(self.physics)
        self.system = physx.PhysxCpuSystem()
        systems: list[Any] = [self.system]
        if visuals:
            systems.append(_render_system())
            outlive_forks(self)
        self.scene = sapien.Scene(systems)
        self.system.timestep = self.physics.timestep
        blueprints = {} if blueprints is None else blueprints
        self.robots: dict[str, SimulatedRobot] = {}
        for number, (name, placement) in enumerate(layout.items()):
            robot = placement.robot
            if robot not in blueprints:
                blueprints[robot] = read_blueprint(robot, visuals=visuals)
            self.robots[name] = SimulatedRobot(
                self.scene, name, placement, blueprints[robot], number, links_pass=links_pass
            )
        self.articulations = [robot.articulation for robot in self.robots.values()]
        self.bodies: dict[str, BuiltBody] = {}
        self.built: dict[tuple[Part, str], Any] = {}
        self.looks, self.shadows = AS_DECLARED, False

    def __del__(self) -> None:
        """Wait for pictures that were begun: a scene that goes before ends the process."""
        if self.studio is not None:
            self.studio.wait()

    def add(self, body: WorldBody) -> BuiltBody:
        """Build a body, and the parts that its joints move."""
        built, *parts = build_bodies(self.scene, body, visuals=bool(self.visuals))
        if body.scale != 1.0:
            built.start_pose = _on_its_place(body, built.component, built.start_pose)
        for each in (built, *parts):
            self.bodies[each.declared.name] = each
        return built

    def settle(self) -> None:
        """End the build: set every start pose once more, as native does."""
        for body in self.bodies.values():
            if body.declared.kind != "static":
                body.set_pose(body.start_pose)
        for robot in self.robots.values():
            robot.articulation.set_root_pose(robot.base_pose)

    def clear(self) -> None:
        """Begin a reset: zero every velocity and force, and put anchored bodies back.

        PhysX keeps its contact caches: a reset world remembers, a rebuilt one does not.
        """
        for body in self.bodies.values():
            body.stop()
        for robot in self.robots.values():
            robot.stop()
        for body in self.bodies.values():
            if body.declared.anchored:
                body.set_pose(body.start_pose)

    def stepper(self) -> Callable[[], None]:
        """Return what advances physics by one step."""
        linkages = [linkage for robot in self.robots.values() for linkage in robot.linkages]
        step: Callable[[], None] = self.system.step
        if not linkages:
            return step

        def pulled() -> None:
            for linkage in linkages:
                linkage.pull()
            step()

        return pulled

    def set_pose(self, name: str, row: list[float]) -> None:
        """Move a body to a position (m) and quaternion (wxyz), (7,)."""
        self.bodies[name].set_pose(sapien.Pose(row[:3], row[3:]))

    def place(self, name: str, row: list[float]) -> None:
        """Move a body to where the task wants it; see `scale`."""
        self.set_pose(name, row)
        body = self.bodies[name]
        if body.declared.scale != 1.0:
            pose = sapien.Pose(row[:3], row[3:])
            body.set_pose(_on_its_place(body.declared, body.component, pose))

    def stand(self, robot: str, qpos: Sequence[float] | NDArray[np.float64]) -> None:
        """Stand a robot at joint positions (rad, m), at rest."""
        self.robots[robot].reset(qpos)

    def jointed(self, name: str) -> JointedBody:
        """Return a body that has joints."""
        body = self.bodies[name]
        assert isinstance(body, JointedBody)
        return body

    def set_joints(self, name: str, positions: Mapping[str, float]) -> None:
        """Move some joints of a body, at rest."""
        self.jointed(name).set_joints(positions)

    def vary(self, variation: Variation) -> None:
        """Let it differ from what was built, as far as SAPIEN can change one in place.

        Every value is set from the one that was built, so it does not depend on what was set
        before. SAPIEN 3.0.3 has no way to change a shape's size once it is attached, nor the
        gravity of a system that exists: for these, worlds are built anew.

        Robots move when they are placed next, and pictures differ from the next one on.
        """
        if variation.looks is not None:
            self.looks = variation.looks
        for part, weightless in variation.weightless.items():
            _component(self, part).disable_gravity = weightless
        for part, factor in variation.mass.items():
            component = _component(self, part)
            mass, inertia = _as_built(self, part, "mass", lambda c=component: (c.mass, c.inertia))
            component.set_mass(mass * factor)
            component.set_inertia(inertia * factor)
        for part, coefficient in variation.friction.items():
            for material in _as_built(self, part, "friction", lambda p=part: _materials(self, p)):
                material.set_static_friction(coefficient)
                material.set_dynamic_friction(coefficient)
        for part in dict.fromkeys([*variation.stiffness, *variation.damping]):
            stiffness = variation.stiffness.get(part, 1.0)
            _set_drive(self, part, stiffness, variation.damping.get(part, 1.0))
        for part, coefficient in variation.joint_friction.items():
            _joint(self, part).set_friction(coefficient)
        for name, (position, quaternion) in variation.bases.items():
            self.robots[name].base_pose = sapien.Pose(list(position), list(quaternion))


def build_world(world: World, blueprints: dict[RobotDescriptor, Blueprint]) -> BuiltWorld:
    """Build what a task declared; see `BuiltWorld` for the arguments and errors."""
    built = BuiltWorld(
        world.layout,
        world.physics,
        visuals=world.visuals,
        blueprints=blueprints,
        links_pass=world.links_pass,
    )
    built.shadows = world.shadows
    for body in world.bodies.values():
        if body.part_of is None:
            built.add(body)
    built.settle()
    return built


def _on_its_place(body: WorldBody, component: Any, pose: sapien.Pose) -> sapien.Pose:
    """Return a pose at which a body that stands at ``pose`` has its lowest point as declared."""
    if not component.collision_shapes:
        return pose
    lowest = float(component.compute_global_aabb_tight()[0][2])
    x, y, z = (float(value) for value in pose.p)
    return sapien.Pose([x, y, z + (z - lowest) * (body.scale - 1) / body.scale], pose.q)


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


def build_scene(
    layout: Layout, physics: PhysicsSettings | None = None, *, visuals: Visuals = False
) -> sapien.Scene:
    """Build a SAPIEN scene with a layout's robots and nothing else.

    Each robot is an articulation that is called as in the layout, stands at its keyframe and holds
    it by its drives. ``scene.step()`` advances by the settings' timestep.

    Args:
        layout: Which robots stand where.
        physics: Solver settings; None keeps SAPIEN's own defaults.
        visuals: Whether to build what pictures need (a Vulkan driver must be present).

    Raises:
        AssetError: If a robot's files cannot be found.
        SimulationError: If pictures are wanted and there is no Vulkan driver.
    """
    world = BuiltWorld(layout, physics, visuals=visuals)
    world.settle()
    for name, robot in world.robots.items():
        robot.articulation.name = name
        start = layout[name].start_qpos
        robot.reset(start)
        for joint, position in zip(robot.driven, start, strict=True):
            joint.set_drive_target(position)
    return world.scene


def _set_drive(world: BuiltWorld, part: Part, stiffness: float, damping: float) -> None:
    joint = _joint(world, part)
    built = _as_built(world, part, "drive", lambda: (joint.stiffness, joint.damping))
    joint.set_drive_properties(
        built[0] * stiffness, built[1] * damping, joint.force_limit, joint.drive_mode
    )


def _materials(world: BuiltWorld, part: Part) -> list[Any]:
    """Give each shape of a part a material of its own, which others do not share, and return it."""
    materials: list[Any] = []
    for shape in _component(world, part).collision_shapes:
        shared = shape.physical_material
        friction = shared.static_friction, shared.dynamic_friction
        materials.append(physx.PhysxMaterial(*friction, shared.restitution))
        shape.set_physical_material(materials[-1])
    return materials


def _component(world: BuiltWorld, part: Part) -> Any:
    if part.robot is None:
        return world.bodies[part.name].component
    return world.robots[part.robot].link(part.name)


def _joint(world: BuiltWorld, part: Part) -> Any:
    assert part.robot is not None
    robot = world.robots[part.robot]
    return robot.driven[robot.descriptor.joints.index(part.name)]


def _as_built(world: BuiltWorld, part: Part, what: str, read: Callable[[], _Value]) -> _Value:
    """Return what a part was built with: what it has when it is asked for the first time."""
    if (part, what) not in world.built:
        world.built[part, what] = read()
    return world.built[part, what]

"""Models that MuJoCo steps: a layout's robots, as they are exported, with a task's bodies."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from layouts import Layout
from layouts.export.cell import ExportedCell, RobotSource, Standing
from layouts.export.mjcf import mjcf_of
from objects.shapes import Plane
from robot_layouts.simulation.backend import Built, BuiltRobot, Part
from robot_layouts.simulation.control.joint_positions import joint_speeds
from robot_layouts.simulation.maths import Floats
from robot_layouts.simulation.mujoco import mujoco
from robot_layouts.simulation.mujoco.bodies import PREFIX, BodyMaker, add_lamps
from robot_layouts.simulation.physics import PhysicsSettings
from robot_layouts.simulation.world import World, part_name
from robots import SimulationError

# Without these nothing that is light stays between fingers: friction that gives less than what
# presses, and cones that are round.
_IMPRATIO = 10.0


class RobotModels:
    """What was read of a layout's robots once, for any number of worlds.

    Attributes:
        cell: The robots.
        timestep: The longest one at which all drives are stable (s).
        meshes: Their meshes, by the names of files that they would have.
    """

    def __init__(self, layout: Layout, *, visuals: bool) -> None:
        """Read the robots' files.

        Raises:
            AssetError: If they cannot be found or read.
            DescriptorError: If a descriptor contradicts its URDF.
        """
        self.cell = ExportedCell.read(layout, visuals=visuals)
        with tempfile.TemporaryDirectory(prefix="robot-layouts-") as name:
            folder = Path(name)
            model = mjcf_of(self.cell, "worlds", folder, visuals=visuals)
            files = [path for path in folder.rglob("*") if path.is_file()]
            self.meshes = {file.relative_to(folder).as_posix(): file.read_bytes() for file in files}
        self.timestep = model.timestep
        self._spec: Any = mujoco.MjSpec.from_string(model.text(""), assets=self.meshes)

    def compile(self, world: World) -> Any:
        """Return MuJoCo's model of a world.

        Raises:
            SimulationError: If its physics settings ask for what MuJoCo does not have.
        """
        model = self.describe(world, drawn=bool(world.visuals)).compile()
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
        _drive_by_force(model)
        rub_joints(model, world)
        return model

    def describe(self, world: World, *, drawn: bool) -> Any:
        """Return MuJoCo's description of a model of a world.

        Args:
            world: The world.
            drawn: Whether it has what pictures need.

        Raises:
            SimulationError: If its physics settings ask for what MuJoCo does not have.
        """
        settings = checked_settings(world.physics)
        spec = self._spec.copy()
        step = settings.timestep / substeps_of(settings.timestep, self.timestep)
        solref = [2 * step, 1.0]
        option = spec.option
        option.timestep, option.gravity = step, settings.gravity
        option.cone, option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, _IMPRATIO
        for joint in spec.joints:
            joint.solref_limit = solref
        self._set_friction(spec, settings.friction.static)
        maker = BodyMaker(spec, settings.friction, solref, drawn=drawn)
        for body in world.bodies.values():
            if body.part_of is None:
                maker.add(body)
        if drawn:
            add_lamps(spec, shadows=world.shadows)
        set_friction(spec, world, settings.friction.static, solref)
        self._let_floors_through(spec, world)
        return spec

    def _set_friction(self, spec: Any, friction: float) -> None:
        """Give links whose descriptor names no material that of the world."""
        for place, standing in self.cell.robots.items():
            for link in standing.source.model.collisions:
                if standing.source.friction_of(link) is None:
                    for geom in spec.body(f"{place}/{link}").geoms:
                        geom.friction[0] = friction

    def _let_floors_through(self, spec: Any, world: World) -> None:
        floors = [
            body.name
            for body in world.bodies.values()
            if any(isinstance(shape, Plane) for shape in body.shapes)
        ]
        for place, standing in self.cell.robots.items():
            for link in standing.source.robot.no_floor_contact:
                for floor in floors:
                    spec.add_exclude(bodyname1=f"{place}/{link}", bodyname2=PREFIX + floor)


def checked_settings(settings: PhysicsSettings) -> PhysicsSettings:
    """Return physics settings.

    Raises:
        SimulationError: If MuJoCo cannot do what they ask for.
    """
    if settings.continuous_collision:
        raise SimulationError(
            "continuous_collision is True; MuJoCo looks at contacts once in each of its steps, so"
            " make the timestep shorter instead"
        )
    if settings.rest_offset != 0:
        raise SimulationError(
            f"rest_offset is {settings.rest_offset} m; in MuJoCo bodies rest where their shapes"
            " touch, at 0"
        )
    return settings


def substeps_of(timestep: float, longest: float) -> int:
    """Return into how many steps MuJoCo divides one that may be too long for it (s)."""
    return math.ceil(timestep / longest * (1 - 1e-9))


def _drive_by_force(model: Any) -> None:
    """Let drives take a force besides what their springs and dampers add to it.

    So they can be driven to positions and to speeds. The descriptor's damper takes the place of
    the URDF's, as in SAPIEN.
    """
    model.actuator_gainprm[:, 0] = 1.0
    model.actuator_ctrllimited[:] = 0
    driven = model.jnt_dofadr[model.actuator_trnid[:, 0]]
    model.dof_damping[driven] = model.dof_frictionloss[driven] = 0.0


def rub_joints(model: Any, world: World) -> None:
    """Let joints of things rub with their coefficient of the weight that they carry.

    PhysX takes what they bear at every moment; of a drawer that lies level that is the same.
    """
    strength = float(np.linalg.norm(world.physics.gravity))
    for body in world.bodies.values():
        for joint in body.joints:
            part = model.body(PREFIX + part_name(body.name, joint.name))
            model.dof_frictionloss[part.dofadr] = joint.friction * part.subtreemass * strength


@dataclass(frozen=True)
class Joints:
    """Where joints stand in MuJoCo's arrays.

    Attributes:
        qpos: In that of positions.
        qvel: In that of velocities.
    """

    qpos: NDArray[np.intp]
    qvel: NDArray[np.intp]

    @classmethod
    def of(cls, model: Any, names: Sequence[str]) -> Joints:
        """Look joints up."""
        numbers = [model.joint(name).id for name in names]
        return cls(
            np.array(model.jnt_qposadr[numbers], np.intp),
            np.array(model.jnt_dofadr[numbers], np.intp),
        )


class Turned:
    """Which of the two quaternions of a turn is told: PhysX's, so that observations are the same.

    Each joint turns what it carries by a quaternion whose w is not negative. Beyond half a turn
    that is minus the one of its angle, and so are those of all that the joint carries.

    Attributes:
        hinges: Where the positions of hinges stand among MuJoCo's.
        carried: How often each of them carries a body, (bodies, hinges).
    """

    def __init__(self, model: Any) -> None:
        """Look up which frames each joint carries."""
        hinges = np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE)
        self.hinges = model.jnt_qposadr[hinges]
        self.carried = np.zeros((model.nbody, len(hinges)), np.int32)
        for body, parent in enumerate(model.body_parentid.tolist()):
            self.carried[body] = self.carried[parent] + (model.jnt_bodyid[hinges] == body)

    def turn(self, quaternions: Floats, qpos: Floats) -> None:
        """Turn quaternions round, in place.

        Args:
            quaternions: Those of a world's frames, (F, 4).
            qpos: All of MuJoCo's positions of that world.
        """
        beyond = np.cos(qpos[self.hinges] / 2) < 0
        if beyond.any():
            odd = self.carried[1:] @ beyond % 2 == 1
            quaternions[odd] *= -1


class Inventory:
    """Where everything stands in models that were built alike; a frame is a body but the world's.

    Attributes:
        built: The same above the seam.
        parts: Link or body of each of MuJoCo's bodies but the first, which is the world.
        robots: Joints of each robot, in the descriptor's order.
        joints: Those of all robots.
        jointed: Joints of each body that has some.
        turned: Which quaternions are told of frames.
    """

    def __init__(self, model: Any, world: World, cell: ExportedCell) -> None:
        """Look everything up."""
        self.parts: dict[int, Part] = {}
        self.robots: dict[str, Joints] = {}
        robots: dict[str, BuiltRobot] = {}
        for place, standing in cell.robots.items():
            links = {link: model.body(f"{place}/{link}").id for link in _links(standing)}
            self.parts.update({number: Part(place, link) for link, number in links.items()})
            names = [f"{place}/{joint}" for joint in standing.source.robot.joints]
            self.robots[place] = Joints.of(model, names)
            robots[place] = _built_robot(standing.source, links)
        bodies = {name: model.body(PREFIX + name).id for name in world.bodies}
        self.parts.update({number: Part(None, name) for name, number in bodies.items()})
        self.jointed = {
            name: Joints.of(model, [f"{PREFIX}{name}.{joint.name}" for joint in body.joints])
            for name, body in world.bodies.items()
            if body.joints
        }
        every = self.robots.values()
        self.joints = Joints(
            np.concatenate([own.qpos for own in every]), np.concatenate([own.qvel for own in every])
        )
        self.turned = Turned(model)
        frames = {name: number - 1 for name, number in bodies.items()}
        named = {
            name: tuple(joint.name for joint in world.bodies[name].joints) for name in self.jointed
        }
        self.built = Built(model.nbody - 1, frames, robots, named)

    def body(self, robot: str | None, name: str) -> int:
        """Return MuJoCo's number of a link, or of a body of its own."""
        if robot is None:
            return self.built.bodies[name] + 1
        return self.built.robots[robot].links[name] + 1


def _links(standing: Standing) -> list[str]:
    model = standing.source.model
    return [model.root, *(joint.child for joint in model.ordered)]


def _built_robot(source: RobotSource, links: Mapping[str, int]) -> BuiltRobot:
    descriptor = source.robot
    moving = {joint.name: joint for joint in source.model.moving}
    joints = [moving[name] for name in descriptor.joints]
    limits = [
        (-np.inf, np.inf) if j.lower is None or j.upper is None else (j.lower, j.upper)
        for j in joints
    ]
    return BuiltRobot(
        links={link: number - 1 for link, number in links.items()},
        limits=np.array(limits, np.float32),
        speeds=joint_speeds(descriptor, source.model),
        loaded_order=_loaded_order(source),
    )


def _loaded_order(source: RobotSource) -> tuple[int, ...]:
    """Return the joints' order in state dicts, which is SAPIEN's: level by level from the root."""
    levels: dict[str, int] = {source.model.root: 0}
    for joint in source.model.ordered:
        levels[joint.child] = levels[joint.parent] + 1
    moving = [joint for joint in source.model.ordered if joint.moves]
    ordered = sorted(moving, key=lambda joint: levels[joint.child])
    return tuple(source.robot.joints.index(joint.name) for joint in ordered)


_REST = (0.005, 0.0001)  # against twisting and rolling; MuJoCo's own


def set_friction(spec: Any, world: World, usual: float, solref: list[float]) -> None:
    """Let surfaces rub, at a contact, with the mean of both coefficients, as in SAPIEN.

    MuJoCo itself takes the larger of both, or that of the geom of higher priority. So a surface
    whose coefficient is not the world's usual one has priority and the mean of both; where two such
    surfaces may meet, MuJoCo is given the mean of theirs as that of the pair.

    Args:
        spec: Description of a model whose geoms have their own coefficients.
        world: What the model is of.
        usual: The world's usual coefficient.
        solref: How soft contacts are, in MuJoCo's numbers.
    """
    solid = [geom for geom in spec.geoms if geom.contype]
    unusual = [geom for geom in solid if geom.friction[0] != usual]
    owners = {PREFIX + name: body.part_of or name for name, body in world.bodies.items()}
    moving = [geom for geom in solid if _moves(owners.get(geom.parent.name), world)]
    for number, geom in enumerate([*moving, *unusual]):
        geom.name = geom.name or f"{PREFIX}geom{number}"
    names = {geom.name: geom for geom in unusual}
    done = set[frozenset[str]]()
    for one, other in product([*moving, *unusual], unusual):
        own = owners.get(one.parent.name), owners.get(other.parent.name)
        pair = frozenset((one.name, other.name))
        if own[0] == own[1] or pair in done:  # of one body, or both of robots
            continue
        if None not in own and not any(_moves(owner, world) for owner in own):
            continue
        done.add(pair)
        mean = (one.friction[0] + other.friction[0]) / 2
        spec.add_pair(
            geomname1=one.name,
            geomname2=other.name,
            friction=[mean, mean, _REST[0], _REST[1], _REST[1]],
            solref=solref,
        )
    for geom in names.values():
        geom.priority, geom.friction[0] = 1, (geom.friction[0] + usual) / 2


def _moves(owner: str | None, world: World) -> bool:
    return owner is not None and world.bodies[owner].kind == "dynamic"


def vary_friction(model: Any, coefficients: dict[int, float], usual: float) -> None:
    """Change the coefficients of bodies.

    Args:
        model: MuJoCo's model.
        coefficients: By MuJoCo's number of the body.
        usual: The world's usual coefficient.
    """
    own = _coefficients(model, usual)
    for body, coefficient in coefficients.items():
        geoms = model.geom_bodyid == body
        own[geoms], model.geom_priority[geoms] = coefficient, 1
        model.geom_friction[geoms, 0] = (coefficient + usual) / 2
    means = (own[model.pair_geom1] + own[model.pair_geom2]) / 2
    model.pair_friction[:, :2] = means[:, None]


def _coefficients(model: Any, usual: float) -> Floats:
    """Return the coefficient of each geom itself, (geoms,)."""
    taken: NDArray[np.float64] = model.geom_friction[:, 0]
    return np.where(model.geom_priority > 0, 2 * taken - usual, taken)

"""One world in MuJoCo: its model, where everything in it is, and what touches."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from layouts.frames import Pose
from robot_layouts.kinematics.rotations import rotation_of
from robot_layouts.simulation.backend import Overlap, Pair, Part
from robot_layouts.simulation.maths import Floats
from robot_layouts.simulation.mujoco import mujoco
from robot_layouts.simulation.mujoco.model import Inventory, vary_friction
from robot_layouts.simulation.variation import AS_DECLARED, Variation
from robot_layouts.simulation.world import World, WorldBody
from robots import SimulationError

_FREE = 6  # numbers of a velocity; a pose has one more


class MujocoWorld:
    """What stands in a world, and how it moves.

    Attributes:
        declared: What the task declared.
        model: MuJoCo's model.
        as_built: The same before the world was varied; worlds that are alike share it.
        data: MuJoCo's state of it.
        index: Where everything stands.
        inner: How many steps of MuJoCo's make one of physics.
    """

    def __init__(self, declared: World, model: Any, index: Inventory, inner: int) -> None:
        """Put everything where it was declared.

        Args:
            declared: What the task declared.
            model: MuJoCo's model of that.
            index: Where everything stands.
            inner: How many steps of MuJoCo's make one of physics.
        """
        self.declared, self.index = declared, index
        self.model = self.as_built = model
        self.data: Any = mujoco.MjData(model)
        self.inner, self._current = inner, False
        self.before_each: Callable[[], None] | None = None
        self.after_each: Callable[[], None] | None = None
        for name, body in declared.bodies.items():
            if body.part_of is None:
                self._start(name, body)
        self.update()

    # -- motion ------------------------------------------------------------------------------

    def step(self, substeps: int) -> None:
        """Advance by steps of physics; what the solver remembers is not carried over."""
        data, self._current = self.data, False
        data.qacc_warmstart[:] = 0.0
        count = substeps * self.inner
        if self.before_each is None and self.after_each is None:
            mujoco.mj_step(self.model, data, nstep=count)
            return
        for _ in range(count):
            if self.before_each is not None:
                self.before_each()
            mujoco.mj_step(self.model, data)
            if self.after_each is not None:
                self.after_each()

    def update(self) -> None:
        """Compute where all bodies are, unless that is known."""
        if not self._current:
            mujoco.mj_kinematics(self.model, self.data)
            self._current = True

    def velocities(self, bodies: list[int | None]) -> NDArray[np.float64]:
        """Return angular, then linear velocities of centres of mass in the world, (K, 6)."""
        self.update()
        mujoco.mj_comPos(self.model, self.data)
        mujoco.mj_comVel(self.model, self.data)
        found = np.zeros((len(bodies), _FREE))
        for row, body in zip(found, bodies, strict=True):
            if body is not None:
                mujoco.mj_objectVelocity(
                    self.model, self.data, mujoco.mjtObj.mjOBJ_BODY, body, row, 0
                )
        return found

    def base_of(self, robot: str) -> Pose:
        """Return where the base of a robot stands."""
        root = self.index.body(robot, self.index.built.robots[robot].root)
        x, y, z = self.model.body_pos[root].tolist()
        w, i, j, k = self.model.body_quat[root].tolist()
        return Pose((x, y, z), (w, i, j, k))

    # -- placing -----------------------------------------------------------------------------

    def clear(self) -> None:
        """Begin a reset: all rests, nothing touches, and what is anchored is where it was built."""
        data = self.data
        data.ncon = 0
        data.qvel[:] = data.qfrc_applied[:] = data.qacc[:] = data.qacc_warmstart[:] = 0.0
        data.xfrc_applied[:] = 0.0
        for name, body in self.declared.bodies.items():
            if body.joints:
                self._set_joints(name, {joint.name: joint.start for joint in body.joints})
            if body.anchored and body.part_of is None:
                self._start(name, body)
        self._current = False

    def place(self, name: str, pose: list[float]) -> None:
        """Move a body to a position (m) and quaternion (wxyz), (7,); it goes on as fast."""
        body = self.declared.bodies[name]
        self._set_pose(name, pose)
        if body.scale != 1.0:
            self._raise_scaled(name, body, pose)

    def stand(self, robot: str, qpos: NDArray[np.float64]) -> None:
        """Stand a robot at joint positions (rad, m), at rest."""
        joints = self.index.robots[robot]
        self.data.qpos[joints.qpos], self.data.qvel[joints.qvel] = qpos, 0.0
        self._current = False

    def set_joints(self, name: str, positions: Mapping[str, float]) -> None:
        """Move some joints of a body, at rest."""
        self.data.qvel[self.index.jointed[name].qvel] = 0.0
        self._set_joints(name, positions)

    def restore_body(self, name: str, row: Floats) -> None:
        """Take over a state row; see `Backend.write`."""
        pose, linear, angular = row[:7].tolist(), row[7:10], row[10:13]
        self._set_pose(name, pose)
        free = self._free(name)
        if free is not None:
            number = self.index.body(None, name)
            turn = rotation_of(pose[3:])
            middle = turn @ self.model.body_ipos[number]
            velocity = self.data.qvel[free : free + _FREE]
            velocity[:3] = linear - np.cross(angular, middle)
            velocity[3:] = turn.T @ angular
        joints = self.index.jointed.get(name)
        if joints is not None:
            self.data.qpos[joints.qpos], self.data.qvel[joints.qvel] = np.split(row[13:], 2)

    def restore_robot(self, name: str, row: Floats) -> None:
        """Take over a state row; its base stands where the layout or a variation says."""
        joints = self.index.robots[name]
        self.data.qpos[joints.qpos], self.data.qvel[joints.qvel] = np.split(row[13:], 2)
        self._current = False

    def _set_pose(self, name: str, pose: list[float]) -> None:
        number, free = self.index.body(None, name), self._free(name)
        if free is not None:
            at = self.model.jnt_qposadr[self.model.body_jntadr[number]]
            self.data.qpos[at : at + _FREE + 1] = pose
        else:
            held = self.model.body_mocapid[number]
            self.data.mocap_pos[held], self.data.mocap_quat[held] = pose[:3], pose[3:]
        self._current = False

    def _start(self, name: str, body: WorldBody) -> None:
        pose = [*body.position, *body.quaternion]
        self.place(name, pose)
        if body.joints:
            self._set_joints(name, {joint.name: joint.start for joint in body.joints})

    def _set_joints(self, name: str, positions: Mapping[str, float]) -> None:
        joints = self.declared.bodies[name].joints
        for joint, at in zip(joints, self.index.jointed[name].qpos, strict=True):
            self.data.qpos[at] = positions.get(joint.name, self.data.qpos[at])
        self._current = False

    def _free(self, name: str) -> int | None:
        """Return where a body's own velocity stands, if physics moves it."""
        number = self.index.body(None, name)
        held = self.model.body_mocapid[number] >= 0
        return None if held else int(self.model.body_dofadr[number])

    def _raise_scaled(self, name: str, body: WorldBody, pose: list[float]) -> None:
        """Put the lowest point of a body where that of the declared one would be."""
        self.update()
        lowest = lowest_of(self.model, self.data, self.index.body(None, name))
        if lowest is not None:
            x, y, z, *turn = pose
            raised = z + (z - lowest) * (body.scale - 1) / body.scale
            self._set_pose(name, [x, y, raised, *turn])

    # -- variation ---------------------------------------------------------------------------

    def vary(self, variation: Variation) -> None:
        """Let the world differ from what was built, by a model of its own."""
        if variation.joint_friction:
            raise SimulationError(
                "MuJoCo knows no coefficient of friction of joints, which joint_friction varies;"
                " leave it out of the randomization, or take simulator='sapien3'"
            )
        if variation.looks not in (None, AS_DECLARED):
            raise SimulationError(
                "simulator 'mujoco' draws everything as it is declared; leave what varies in"
                " pictures out of the randomization, or take simulator='sapien3'"
            )
        self.model = model = copy.copy(self.as_built)
        find = self.index.body
        for part, factor in variation.mass.items():
            body = find(part.robot, part.name)
            model.body_mass[body] *= factor
            model.body_inertia[body] *= factor
        varied = {find(part.robot, part.name): own for part, own in variation.friction.items()}
        vary_friction(model, varied, self.declared.physics.friction.static)
        for part, weightless in variation.weightless.items():
            model.body_gravcomp[find(part.robot, part.name)] = float(weightless)
        for factors, column in ((variation.stiffness, 1), (variation.damping, 2)):
            for part, factor in factors.items():
                model.actuator(f"{part.robot}/{part.name}").biasprm[column] *= factor
        for name, (position, quaternion) in variation.bases.items():
            root = find(name, self.index.built.robots[name].root)
            model.body_pos[root], model.body_quat[root] = position, quaternion
        mujoco.mj_setConst(model, mujoco.MjData(model))
        self._current = False


_TYPE = mujoco.mjtGeom


def extent_of(model: Any, data: Any, body: int) -> Floats | None:
    """Return the box around what collides of a body, (2, 3) (m, world); None if nothing does.

    Planes are left out. Where the bodies are must have been computed.
    """
    boxes = [_box(model, data, geom) for geom in _solids(model, body)]
    if not boxes:
        return None
    lows, highs = zip(*boxes, strict=True)
    return np.array([np.min(lows, 0), np.max(highs, 0)], np.float32)


def lowest_of(model: Any, data: Any, body: int) -> float | None:
    """Return the height of the lowest point of a body (m, world), likewise."""
    lows = [_box(model, data, geom)[0][2] for geom in _solids(model, body)]
    return min(lows) if lows else None


def _solids(model: Any, body: int) -> list[int]:
    first = model.body_geomadr[body]
    geoms = range(first, first + model.body_geomnum[body])
    return [
        geom
        for geom in geoms
        if model.geom_contype[geom] and model.geom_type[geom] != _TYPE.mjGEOM_PLANE
    ]


def _box(model: Any, data: Any, geom: int) -> tuple[Floats, Floats]:
    """Return the lowest and the highest corner of the box around a geom, each (3,) (m, world)."""
    place, turn = data.geom_xpos[geom], data.geom_xmat[geom].reshape(3, 3)
    size = model.geom_size[geom]
    along = np.abs(turn[:, 2])  # of its own z axis, on each axis of the world
    match model.geom_type[geom]:
        case _TYPE.mjGEOM_MESH:
            mesh = model.geom_dataid[geom]
            first = model.mesh_vertadr[mesh]
            corners = model.mesh_vert[first : first + model.mesh_vertnum[mesh]] @ turn.T + place
            return corners.min(0), corners.max(0)
        case _TYPE.mjGEOM_BOX:
            reach = np.abs(turn) @ size
        case _TYPE.mjGEOM_SPHERE:
            reach = np.full(3, size[0])
        case _TYPE.mjGEOM_CAPSULE:
            reach = size[0] + along * size[1]
        case _:  # a cylinder
            reach = size[0] * np.sqrt(np.maximum(0.0, 1 - along**2)) + along * size[1]
    return place - reach, place + reach


class ForceReader:
    """Reads the contact forces of the same pairs, step after step."""

    def __init__(self, world: MujocoWorld, pairs: Sequence[Pair]) -> None:
        """Look the pairs up; all worlds have the same numbers of bodies."""
        find = world.index.body
        self._count = len(pairs)
        self._pairs: dict[tuple[int, int], tuple[int, int]] = {}
        self._alone: dict[int, int] = {}
        for number, (robot, link, body) in enumerate(pairs):
            pressed = find(robot, link)
            if body is None:
                self._alone[pressed] = number
            else:
                pressing = find(None, body)
                self._pairs[pressing, pressed] = number, 1  # a force acts on the second
                self._pairs[pressed, pressing] = number, -1

    def read(self, worlds: Sequence[MujocoWorld]) -> Floats | None:
        """Return the forces, (P, N, 3) (N, world frame), or None if no pair touches."""
        forces: NDArray[np.float64] | None = None
        for env, world in enumerate(worlds):
            for contact, bodies in _touching(world):
                counted = list(self._counted(*bodies))
                if counted:
                    if forces is None:
                        forces = np.zeros((self._count, len(worlds), 3))
                    force = force_of(world, contact)
                    for number, sign in counted:
                        forces[number, env] += sign * force
        return None if forces is None else forces.astype(np.float32)

    def _counted(self, first: int, second: int) -> Iterator[tuple[int, int]]:
        if (first, second) in self._pairs:
            yield self._pairs[first, second]
        if second in self._alone:
            yield self._alone[second], 1
        if first in self._alone:
            yield self._alone[first], -1


def _touching(world: MujocoWorld) -> list[tuple[int, list[int]]]:
    """Return the numbers of the contacts that carry forces, with those of both bodies."""
    found = world.data.contact
    bodies = world.model.geom_bodyid[found.geom].tolist()
    rows = enumerate(zip(found.efc_address.tolist(), bodies, strict=True))
    return [(contact, both) for contact, (row, both) in rows if row >= 0]


def force_of(world: MujocoWorld, contact: int) -> NDArray[np.float64]:
    """Return the force on the second body of a contact, (3,) (N, world frame)."""
    wrench = np.zeros(6)
    mujoco.mj_contactForce(world.model, world.data, contact, wrench)
    return wrench[:3] @ world.data.contact.frame[contact].reshape(3, 3)


def presses_on_object(world: MujocoWorld) -> bool:
    """Tell whether a contact that carries force joins a link and a body that physics moves."""
    for contact, bodies in _touching(world):
        kinds = sorted(_kind(world, body) for body in bodies)
        if kinds == ["link", "movable"] and force_of(world, contact).any():
            return True
    return False


def _kind(world: MujocoWorld, body: int) -> str:
    if world.index.parts[body].robot is not None:
        return "link"
    return "movable" if world.model.body_weldid[body] else "fixed"


def overlaps_in(world: MujocoWorld) -> list[Overlap]:
    """Return which parts of a world are inside each other, by the contacts of the last step."""
    deepest: dict[tuple[Part, Part], float] = {}
    found = world.data.contact
    bodies = world.model.geom_bodyid[found.geom].tolist()
    for both, distance in zip(bodies, found.dist.tolist(), strict=True):
        if distance < 0:
            one, other = (world.index.parts[body] for body in both)
            deepest[one, other] = max(-distance, deepest.get((one, other), 0.0))
    return [Overlap(one, other, depth) for (one, other), depth in deepest.items()]


class ArmWatcher:
    """Looks after each of MuJoCo's steps at which links of different arms touch.

    Attributes:
        seen: Which did.
    """

    def __init__(self, world: MujocoWorld, arms: Mapping[Part, tuple[str, str]]) -> None:
        """Take the arm of each link."""
        self._world, parts = world, world.index.parts
        self._arms = {number: arms[part] for number, part in parts.items() if part in arms}
        self.seen: dict[tuple[Part, Part], None] = {}

    def look(self) -> None:
        """Remember what touches now."""
        world = self._world
        for _, (first, second) in _touching(world):
            one, other = self._arms.get(first), self._arms.get(second)
            if one and other and one != other:
                self.seen[world.index.parts[first], world.index.parts[second]] = None

"""Which joints of an MJCF follow others: by equalities, by tendons, and in closed loops.

A URDF is a tree whose joints may mimic others in proportion. Equalities between joints that are
linear, or nearly so, are taken as they are. Of a closed loop, such as that of a parallel gripper
whose fingers stay parallel, MuJoCo itself says where the joints go that nothing drives: it is
stepped, without gravity and contacts, while the joint that leads stands at one place after the
other of its range.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from copy import copy
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np

from robot_layouts.core.errors import AssetError
from robot_layouts.kinematics.rotations import Floats
from robots.mjcf.reading import Model, mujoco, name_of, without_log
from robots.mjcf.robot import JOINT, JOINT_IN_PARENT, SLIDE, TENDON, MjcfRobot, tendon_joints

CONNECT, WELD, BETWEEN_JOINTS = range(3)  # MuJoCo's kinds of equalities
PLACES = 9  # of a leader's range, at which its followers are looked at
EXACT = 1e-4  # rad, m; what counts as no deviation
STILL = {"rad": 0.02, "m": 5e-4}  # what a follower may move by and still count as fixed
FARTHEST_OFF = {"rad": 0.15, "m": 0.005}  # of a follower from the straight line
SETTLING = 1500  # steps of `STEP` until a closed loop has come to rest
STEP = 0.001  # s
SAME = 0.02  # of a range; how much those of joints on one tendon may differ


@dataclass(frozen=True)
class Coupling:
    """A joint that goes to multiplier · leader + offset (rad, m).

    Attributes:
        leader: The joint that it follows.
        multiplier: Factor.
        offset: Added (rad, m).
    """

    leader: int
    multiplier: float
    offset: float


@dataclass
class Couplings:
    """What follows what.

    Attributes:
        of: By joint that follows.
        fixed: Joints that an equality keeps in one place, with that place (rad, m).
        notes: One sentence each.
    """

    of: dict[int, Coupling] = field(default_factory=dict)
    fixed: dict[int, float] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


def find_couplings(robot: MjcfRobot, path: Path) -> Couplings:
    """Tell which joints of a robot follow others.

    Args:
        robot: The robot.
        path: The MJCF, for messages.

    Raises:
        AssetError: If a joint follows another in no nearly straight line, or a closed loop has no
            single joint that leads.
    """
    return _CouplingSearch(robot, path).run()


class _CouplingSearch:
    """The search for what follows what in one robot."""

    def __init__(self, robot: MjcfRobot, path: Path) -> None:
        self._robot, self._model, self._path = robot, robot.model, path
        self._moving = set(robot.moving)
        self._driven = {
            int(robot.model.actuator_trnid[i, 0])
            for i in range(robot.model.nu)
            if robot.model.actuator_trntype[i] in (JOINT, JOINT_IN_PARENT)
        }
        self._made = Couplings()

    def run(self) -> Couplings:
        active = [i for i in range(self._model.neq) if self._model.eq_active0[i]]
        for equality in active:
            if self._model.eq_type[equality] == BETWEEN_JOINTS:
                self._equality(equality)
        for actuator in range(self._model.nu):
            if self._model.actuator_trntype[actuator] == TENDON:
                self._tendon(int(self._model.actuator_trnid[actuator, 0]))
        self._loops([i for i in active if self._model.eq_type[i] in (CONNECT, WELD)])
        return self._made

    def _equality(self, equality: int) -> None:
        follower, leader = (
            int(ids[equality]) for ids in (self._model.eq_obj1id, self._model.eq_obj2id)
        )
        coefficients = self._model.eq_data[equality, :5]
        if follower not in self._moving or (leader >= 0 and leader not in self._moving):
            return
        at = self._reference(follower)
        if leader < 0:
            self._made.fixed[follower] = at + float(coefficients[0])
            self._made.notes.append(f"joint {self._name(follower)} is fixed by an equality")
            return
        places = self._places(leader)
        values = np.polynomial.polynomial.polyval(places - self._reference(leader), coefficients)
        self._couple(follower, leader, places, values + at, "by an equality")

    def _tendon(self, tendon: int) -> None:
        joints = [(j, c) for j, c in tendon_joints(self._model, tendon) if j in self._moving]
        leads = {self._lead(joint) for joint, _ in joints}
        if len(joints) < 2 or len(leads) < 2:
            return
        (first, factor), *others = joints
        spans = [self._span(joint) for joint, _ in joints]
        alike = all(abs(abs(c) - abs(factor)) < 1e-9 for _, c in others)
        alike &= np.ptp([high - low for low, high in spans]) <= SAME * (spans[0][1] - spans[0][0])
        name = name_of(self._model, "tendon", tendon) or "a tendon"
        if not alike or any(joint in self._made.of for joint, _ in joints):
            listing = ", ".join(self._name(joint) for joint, _ in joints)
            self._made.notes.append(
                f"the tendon {name} pulls {listing} by different amounts; each is driven on its own"
            )
            return
        for (joint, coefficient), (low, _) in zip(others, spans[1:], strict=True):
            same = coefficient * factor > 0
            offset = low - spans[0][0] if same else low + spans[0][1]
            places = self._places(first)
            values = places * (1.0 if same else -1.0) + offset
            self._couple(joint, first, places, values, f"as the tendon {name} pulls both alike")

    def _loops(self, equalities: Sequence[int]) -> None:
        """Couple the joints of closed loops that nothing drives."""
        waiting: list[tuple[set[int], set[int]]] = []  # of each loop: idle joints, all others
        for equality in equalities:
            bodies = self._ends(equality)
            if not all(body in self._robot.links for body in bodies):
                continue  # to the ground, or to what is moved by hand in a scene
            joints = self._between(*bodies)
            idle = {j for j in joints if j not in self._driven and self._lead(j) == j}
            idle -= {coupling.leader for coupling in self._made.of.values()}
            if idle:
                waiting.append((idle, joints - idle))
        for idle, others in waiting:
            leads = {self._lead(joint) for joint in others}
            if len(leads) != 1:
                listing = ", ".join(self._name(joint) for joint in sorted(idle))
                what = f"{len(leads)} joints lead" if leads else "no joint leads"
                raise AssetError(
                    f"{self._path}: {listing} close a loop in which {what}; a URDF is a tree,"
                    " whose joints can only follow one that leads"
                )
        leads = {self._lead(joint) for _, others in waiting for joint in others}
        for leader in sorted(leads):
            idle = {j for i, others in waiting if leader in map(self._lead, others) for j in i}
            self._settle(leader, sorted(idle))

    def _settle(self, leader: int, idle: Sequence[int]) -> None:
        places = self._places(leader)
        rows = np.array([self._settled(leader, place) for place in places])
        for joint in idle:
            values = rows[:, int(self._model.jnt_qposadr[joint])]
            self._couple(joint, leader, places, values, "as the loop that it closes makes it")

    def _settled(self, leader: int, place: float) -> Floats:
        """Return the positions (nq,) at which MuJoCo comes to rest while a joint stands still."""
        library = mujoco()
        model = self._quiet
        data = library.MjData(model)
        held = {joint: self._at(joint, leader, place) for joint in self._made.of}
        held = {joint: value for joint, value in held.items() if value is not None}
        held[leader] = place
        with without_log():
            for _ in range(SETTLING):
                for joint, value in held.items():
                    data.qpos[model.jnt_qposadr[joint]] = value
                    data.qvel[model.jnt_dofadr[joint]] = 0.0
                library.mj_step(model, data)
        return np.array(data.qpos)

    def _at(self, joint: int, leader: int, place: float) -> float | None:
        """Return where a joint is that follows a leader, also by way of others."""
        multiplier, offset = 1.0, 0.0
        while joint in self._made.of:
            coupling = self._made.of[joint]
            offset += multiplier * coupling.offset
            multiplier *= coupling.multiplier
            joint = coupling.leader
        return multiplier * place + offset if joint == leader else None

    @cached_property
    def _quiet(self) -> Model:
        """The model without gravity, contacts and drives, and slow to swing."""
        library, still = mujoco(), copy(self._model)
        flags = library.mjtDisableBit
        still.opt.disableflags |= flags.mjDSBL_CONTACT | flags.mjDSBL_GRAVITY
        still.opt.disableflags |= flags.mjDSBL_ACTUATION
        still.opt.timestep = STEP
        still.opt.integrator = library.mjtIntegrator.mjINT_IMPLICITFAST
        return still

    def _couple(self, follower: int, leader: int, places: Floats, values: Floats, why: str) -> None:
        """Have a joint follow another on the line through values, or the other way round."""
        names = self._name(follower), self._name(leader)
        if follower in self._made.of or (follower in self._driven and leader not in self._driven):
            follower, leader, places, values = leader, follower, values, places
        if follower in self._made.of or self._lead(leader) == follower:
            return  # said twice
        matrix = np.stack([places, np.ones_like(places)], axis=1)
        (multiplier, offset), *_ = np.linalg.lstsq(matrix, values, rcond=None)
        off = float(np.abs(matrix @ (multiplier, offset) - values).max())
        unit = "m" if self._model.jnt_type[follower] == SLIDE else "rad"
        if not off <= FARTHEST_OFF[unit]:
            raise AssetError(
                f"{self._path}: joint {names[0]} follows {names[1]} {why}, but by up to"
                f" {off:.2g} {unit} in no straight line; a URDF's joints follow in proportion"
            )
        if abs(multiplier) * np.ptp(places) < STILL[unit]:
            self._made.fixed[follower] = float(values.mean())
            self._made.notes.append(f"joint {names[0]} stays where it is, {why}, so it is fixed")
            return
        self._made.of[follower] = Coupling(leader, _tidy(multiplier), _tidy(offset))
        about = f", up to {off:.2g} {unit} off" if off > EXACT else ""
        self._made.notes.append(
            f"joint {self._name(follower)} follows {self._name(leader)}, {why}{about}"
        )

    def _between(self, one: int, other: int) -> set[int]:
        """Return the joints on the way from one body to another."""
        ways = [self._way(body) for body in (one, other)]
        apart = set(ways[0]) ^ set(ways[1])
        return {joint for body in apart for joint in self._robot.joints.get(body, ())}

    def _way(self, body: int) -> Iterable[int]:
        found: list[int] = []
        while body:
            found.append(body)
            body = int(self._model.body_parentid[body])
        return found

    def _ends(self, equality: int) -> tuple[int, int]:
        """Return the bodies that an equality holds together, which may be given by sites."""
        library, model = mujoco(), self._model
        ends = [int(ids[equality]) for ids in (model.eq_obj1id, model.eq_obj2id)]
        if model.eq_objtype[equality] == library.mjtObj.mjOBJ_SITE:
            ends = [int(model.site_bodyid[site]) for site in ends]
        return ends[0], ends[1]

    def _lead(self, joint: int) -> int:
        while joint in self._made.of:
            joint = self._made.of[joint].leader
        return joint

    def _reference(self, joint: int) -> float:
        return float(self._model.qpos0[self._model.jnt_qposadr[joint]])

    def _span(self, joint: int) -> tuple[float, float]:
        if not self._model.jnt_limited[joint]:
            return self._reference(joint) - 1.0, self._reference(joint) + 1.0
        low, high = self._model.jnt_range[joint].tolist()
        return low, high

    def _places(self, joint: int) -> Floats:
        return np.linspace(*self._span(joint), PLACES)

    def _name(self, joint: int) -> str:
        return self._robot.names[joint]


def _tidy(value: float) -> float:
    """Return a number without the dust of a fit, and without a negative zero."""
    return round(float(value), 9) + 0.0

"""The drives of joints, by the inertia that hangs on them, and how far they go in one step."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from robot_layouts.kinematics.rotations import Floats
from robot_layouts.kinematics.tree import Tree
from robots.guessing.doubt import Doubt
from robots.guessing.hints import DriveHint
from robots.guessing.stance import Stance
from robots.urdf.model import ModelJoint, UrdfModel

CONTROL_STEP = 0.05  # s; at 20 control steps a second, the default
STIFFNESS = 1e3  # N·m/rad, N/m; the least, as of ManiSkill's Panda
FORCE = 100.0  # N·m, N; the least where a URDF gives no effort, as of ManiSkill's Panda
LONGEST_STEP = 0.1  # rad, m; of an arm's joint in one control step, as of ManiSkill's Panda
SHORTEST_STEP = 0.04  # rad, m; what ManiSkill's Panda truly goes in one control step
# A critically damped joint with this frequency covers 96 % of a small step in CONTROL_STEP, when
# physics advances by 0.01 s; with a force that is `JUST_ENOUGH`, 94 %.
FREQUENCY = 150.0  # rad/s
JUST_ENOUGH = 6.0  # of inertia · step / CONTROL_STEP²; 4 is the least there is
SETTLING = {"m": 0.1, "rad": 0.2}  # s; of a finger that goes to a place
# Of a joint's frequency (rad/s). Physics in single precision shakes light links that are driven
# more stiffly; and fingers, which touch each other, fly off.
STIFFEST, STIFFEST_FINGER = 1e3, 2 * FREQUENCY
MOST_DAMPED = 7e3  # 1/s, of a finger's damping by its inertia, as a Panda's has
LIGHTEST = 1e-6  # kg·m², kg; of what hangs on a joint, if a URDF gives nothing that weighs
# Links push each other: where two axes line up, one joint's motion turns the other by as much, and
# PhysX parts light joints from heavy ones only roughly. Motors and gears have inertia of their own;
# a gear that is chosen well makes the joint feel as much of it as of its load. Half is enough.
ARMATURE = 0.5  # of the inertia that hangs on the joint
HOLDING = 10.0  # times the force that an arm's joint would have
POSTURES = 16  # in which the inertia is looked at
# What a drive that is given must do to be taken: the share of a step that it covers in time. With
# those of Menagerie's Panda, which cover 60 %, an expert that counts on its steps drops cubes.
SHARE, IN_TIME = 0.9, 2 * CONTROL_STEP
PHYSICS_STEP = 0.01  # s
WATER = 1000.0  # kg/m³; of shapes whose weight nothing gives


@dataclass(frozen=True)
class Drive:
    """How one joint is driven.

    Attributes:
        stiffness: N·m/rad or N/m.
        damping: N·m·s/rad or N·s/m.
        force_limit: N·m or N.
        armature: kg·m² or kg.
        step: How far it goes in one control step (rad or m).
    """

    stiffness: float
    damping: float
    force_limit: float
    armature: float
    step: float


class Drives:
    """The drives of a robot's joints."""

    def __init__(
        self,
        stance: Stance,
        masses: Masses,
        known: Mapping[str, DriveHint] | None = None,
        source: str = "",
    ) -> None:
        """Look at what hangs on the joints in some postures, the same every time.

        Args:
            stance: The robot.
            masses: What its links weigh.
            known: What is known of drives, by joint.
            source: What says so.
        """
        generator = np.random.default_rng(0)
        low, high = np.array([joint.span for joint in stance.leaders]).reshape(-1, 2).T
        postures = generator.uniform(low, high, (POSTURES, len(stance.leaders)))
        postures[0] = stance.middle
        moving = stance.model.moving
        links = [stance.tree.link(joint.child) for joint in moving]
        inertia = hanging_inertia(stance.tree, masses, stance.poses(postures), links)
        self._hanging: Mapping[str, float] = {
            joint.name: max(float(value), LIGHTEST)
            for joint, value in zip(moving, inertia, strict=True)
        }
        self._known, self._source = known or {}, source
        self._raised: list[str] = []  # names of joints
        self._taken: dict[str, bool] = {}  # joints whose drive is known, and whether it was taken

    def reasons(self) -> list[str]:
        """Return what was done about the drives that were asked for, one sentence each."""
        reasons = [
            *self._about_known(),
            "drives: stiffness from the inertia that hangs on each joint, critically damped, so"
            f" that a control step of {CONTROL_STEP:g} s covers what the action asks for; forces"
            " from the URDF's efforts",
            "armature: motors and gears add half of the inertia that hangs on each joint",
            f"action: arm joints move per control step by up to {LONGEST_STEP:g} rad or m, or as"
            " far as their force brings them",
        ]
        if self._raised:
            reasons.append(
                Doubt(
                    f"forces: more than the URDF's efforts for {', '.join(self._raised)}, which"
                    f" would not bring them {SHORTEST_STEP:g} rad or m in a control step"
                )
            )
        return reasons

    def _about_known(self) -> list[str]:
        """Return what became of drives that are known."""
        taken = [joint for joint, was_taken in self._taken.items() if was_taken]
        slow = [joint for joint, was_taken in self._taken.items() if not was_taken]
        reasons: list[str] = []
        if taken:
            reasons.append(
                f"drives of {', '.join(taken)}: stiffness and damping of {self._source}, at least"
                " critically damped"
            )
        if slow:
            reasons.append(
                f"drives of {', '.join(slow)}: not those of {self._source}, which cover less than"
                f" {SHARE:.0%} of a step in {IN_TIME:g} s"
            )
        if any(hint.armature for hint in self._known.values()):
            reasons.append(f"armature: that of {self._source}, where it gives one")
        return reasons

    def of(self, joint: ModelJoint) -> Drive:
        """Return the drive of a joint that an action moves."""
        return self._noted(joint, STIFFEST)

    def finger(self, joint: ModelJoint) -> Drive:
        """Return the drive of a finger's joint that an action moves by steps."""
        return self._noted(joint, STIFFEST_FINGER)

    def _noted(self, joint: ModelJoint, stiffest: float) -> Drive:
        drive, raised = self._drive(joint, stiffest)
        self._note(joint, raised)
        return self._as_known(joint, drive, stiffest)

    def _note(self, joint: ModelJoint, raised: bool) -> None:
        if raised and joint.name not in self._raised:
            self._raised.append(joint.name)

    def _drive(self, joint: ModelJoint, stiffest: float) -> tuple[Drive, bool]:
        """Return a drive, and whether its force is more than the URDF's effort."""
        inertia = self.moved_by(joint)
        needed = JUST_ENOUGH * inertia / CONTROL_STEP**2  # N·m, N; per rad or m of a step
        force = joint.effort or max(FORCE, needed * SHORTEST_STEP)
        step = min(LONGEST_STEP, force / needed)
        raised = step < SHORTEST_STEP
        if raised:
            force, step = needed * SHORTEST_STEP, SHORTEST_STEP
        # What only just has the force to stop in time must begin to brake in time.
        stiffest = stiffest if step == LONGEST_STEP else 2 * FREQUENCY
        stiffness = max(STIFFNESS, inertia * FREQUENCY**2)
        stiffness = min(stiffness, inertia * stiffest**2)
        damping = 2 * (stiffness * inertia) ** 0.5
        armature = self._armature(joint)
        numbers = map(_rounded, (stiffness, damping, force, armature))
        return Drive(*numbers, step=_down(step)), raised

    def _as_known(self, joint: ModelJoint, drive: Drive, stiffest: float) -> Drive:
        """Return a drive with the stiffness that is known, if it brings the joint on in time."""
        known = self._known.get(joint.name)
        if known is None or known.stiffness is None:
            return drive
        inertia = self.moved_by(joint)
        stiffness = min(known.stiffness, inertia * stiffest**2)
        damping = (known.damping or 0.0) * stiffness / known.stiffness
        damping = max(damping, 2 * (stiffness * inertia) ** 0.5)
        taken = _covered(stiffness, damping, inertia) >= SHARE
        self._taken[joint.name] = taken
        if not taken:
            return drive
        return replace(drive, stiffness=_rounded(stiffness), damping=_rounded(damping))

    def moved_by(self, joint: ModelJoint) -> float:
        """Return the inertia that a joint's drive moves, with motor and gear (kg·m², kg)."""
        return self._hanging[joint.name] + self._armature(joint)

    def _armature(self, joint: ModelJoint) -> float:
        known = self._known.get(joint.name)
        if known is not None and known.armature is not None:
            return known.armature
        return ARMATURE * self._hanging[joint.name]

    def gripping(self, joint: ModelJoint) -> Drive:
        """Return the drive of a joint whose targets are places, far away at times: it takes time.

        ManiSkill's Panda drives its fingers, which slide, with a damping of a tenth of the
        stiffness. Fingers that turn go a longer way, and hit harder.
        """
        (drive, raised), settling = self._drive(joint, STIFFEST), SETTLING[joint.unit]
        self._note(joint, raised)
        inertia = self.moved_by(joint)
        damping = min(max(drive.damping, drive.stiffness * settling), inertia * MOST_DAMPED)
        stiffness = min(drive.stiffness, damping / settling)
        force = min(drive.force_limit, FORCE)
        return replace(
            drive, stiffness=_rounded(stiffness), damping=_rounded(damping), force_limit=force
        )

    def geared(
        self,
        joint: ModelJoint,
        inertia: float,
        stiffness: float,
        force: float,
        settling: float = 0.0,
    ) -> Drive:
        """Return the drive of a joint that one motor turns with others, at least critically damped.

        Args:
            joint: The joint.
            inertia: What the motor moves in all, as the joint feels it (kg·m², kg).
            stiffness: Of the drive (N·m/rad, N/m).
            force: The largest (N·m, N).
            settling: Time in which it goes as far as its target is ahead (s).
        """
        more = max(inertia - self.moved_by(joint), 0.0)
        critical = 2 * (stiffness * (self.moved_by(joint) + more)) ** 0.5
        damping = max(critical, stiffness * settling)
        numbers = (stiffness, damping, force, self._armature(joint) + more)
        return Drive(*map(_rounded, numbers), step=LONGEST_STEP)

    def holding(self, joint: ModelJoint) -> Drive:
        """Return the drive of a joint that stays where it starts."""
        drive, _ = self._drive(joint, STIFFEST)
        force = max(drive.force_limit, FORCE) * HOLDING
        return replace(drive, force_limit=_rounded(force))


def drive_fields(drives: Sequence[Drive]) -> dict[str, Any]:
    """Return the fields of a JointGroup that drive its joints."""
    return {
        name: alike([getattr(drive, name) for drive in drives])
        for name in ("stiffness", "damping", "force_limit", "armature")
    }


def alike(numbers: Sequence[float]) -> float | tuple[float, ...]:
    """Return one number if all are the same, else all of them."""
    return numbers[0] if len(set(numbers)) == 1 else tuple(numbers)


def _covered(stiffness: float, damping: float, inertia: float) -> float:
    """Return the share of a small step that a drive covers in `IN_TIME`, as physics takes it."""
    position = speed = 0.0
    for _ in range(round(IN_TIME / PHYSICS_STEP)):
        pull = inertia * speed + PHYSICS_STEP * stiffness * (1 - position)
        speed = pull / (inertia + PHYSICS_STEP * damping + PHYSICS_STEP**2 * stiffness)
        position += PHYSICS_STEP * speed
    return position


def _rounded(value: float) -> float:
    return float(f"{value:.3g}")


def _down(step: float) -> float:
    """Return a step rounded down to 5 mrad or 5 mm."""
    return round(int(step / 0.005 + 1e-9) * 0.005, 6)


@dataclass(frozen=True, eq=False)
class Masses:
    """Masses of the links of a tree, in its order.

    Attributes:
        mass: (links,) (kg); 0 of a link without numbers and without shapes.
        centre: Centres of mass in the links' frames, (links, 3) (m).
        inertia: About those, turned as the links, (links, 3, 3) (kg·m²).
    """

    mass: Floats
    centre: Floats
    inertia: Floats


def read_masses(model: UrdfModel, tree: Tree, bodies: Mapping[int, Sequence[Floats]]) -> Masses:
    """Return what the links of a URDF weigh; without numbers, as much as their shapes in water.

    Args:
        model: What the URDF describes.
        tree: Its links.
        bodies: Corners of the convex bodies of links, by index, in their frames (m).
    """
    rows: list[tuple[float, Floats, Floats]] = []
    for i, link in enumerate(tree.links):
        inertial = model.inertials.get(link)
        if inertial is None or not inertial.mass:
            rows.append(_of_shapes(bodies.get(i, ())))
        else:
            turn = inertial.origin[:3, :3]
            rows.append((inertial.mass, inertial.origin[:3, 3], turn @ inertial.tensor @ turn.T))
    mass, centre, inertia = (np.array(column) for column in zip(*rows, strict=True))
    return Masses(mass, centre, inertia)


def _of_shapes(bodies: Sequence[Floats]) -> tuple[float, Floats, Floats]:
    """Return mass, centre and inertia of bodies with the density of water, as SAPIEN takes it."""
    if not bodies:
        return 0.0, np.zeros(3), np.zeros((3, 3))
    import trimesh

    hulls: list[Any] = [trimesh.convex.convex_hull(corners) for corners in bodies]
    mass = np.array([hull.volume * WATER for hull in hulls])
    centres = np.array([hull.center_mass for hull in hulls])
    centre = mass @ centres / mass.sum()
    inertia = np.zeros((3, 3))
    for hull, weight, off in zip(hulls, mass, centres - centre, strict=True):
        inertia += hull.moment_inertia * WATER
        inertia += weight * (off @ off * np.eye(3) - np.outer(off, off))
    return float(mass.sum()), centre, inertia


def hanging_inertia(tree: Tree, masses: Masses, poses: Floats, links: Iterable[int]) -> Floats:
    """Return the inertia that each joint moves, with the others held, (links given,).

    Of a joint that turns about its axis (kg·m²), of one that slides the mass (kg); the largest of
    some postures.

    Args:
        tree: The links.
        masses: What they weigh.
        poses: Of the links in each posture, (postures, links, 4, 4) (m).
        links: Indices of the links that the joints carry.
    """
    behind = [[i] for i in range(len(tree.links))]
    for i in range(len(tree.links) - 1, 0, -1):
        behind[tree.parents[i]] += behind[i]
    return np.array([_about(tree, masses, poses, link, behind[link]) for link in links])


def _about(tree: Tree, masses: Masses, poses: Floats, link: int, behind: list[int]) -> float:
    mass = masses.mass[behind]
    if tree.slides[link]:
        return float(mass.sum())
    turned = poses[:, behind, :3, :3]
    centre = (turned @ masses.centre[behind][..., None])[..., 0] + poses[:, behind][..., :3, 3]
    axis = poses[:, link, :3, :3] @ tree.axes[link]
    arm = centre - poses[:, link, None, :3, 3]
    off = arm - (arm @ axis[..., None]) * axis[:, None]
    local = (np.swapaxes(turned, -1, -2) @ axis[:, None, :, None])[..., 0]
    own = np.einsum("pli,lij,plj->pl", local, masses.inertia[behind], local)
    return float((own + mass * (off**2).sum(axis=-1)).sum(axis=-1).max())

"""Which grasps of a thing a gripper can do, and how its TCP link is placed then."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from objects import Grasp, ObjectDescriptor
from robot_layouts.experts.hands import Hand
from robot_layouts.experts.script import Pose, Scene
from robot_layouts.kinematics.rotations import Floats, pose_matrix, rotation_about
from robot_layouts.simulation.world import part_name
from robots import TaskError

AJAR = 0.008  # m; between each pad and what it is to hold, before it closes
SPLAYED = 0.6  # rad; between pads that are turned more a thing slips out
FIRM, FIRM_PER_MASS = 30.0, 60.0  # N and N/kg: how hard a thing is held
GENTLE = 15.0  # N instead, where drives are so quick that they push fingers into it
PRESSING, ENOUGH = 0.2, 8.0  # share of that, and N, which a thing feels before it is moved


@dataclass(frozen=True, eq=False)
class Hold:
    """A grasp of a thing, as a gripper does it.

    Attributes:
        grasp: The grasp.
        thing: The thing's name in the world.
        body: The body it belongs to: the thing, or the part of it that a joint moves.
        own: Pose of the gripper's frame, between its pads, in that body's, (4, 4) (m).
        pads: Pose of the gripper's frame in its TCP link's as it comes, (4, 4) (m).
        shut: The same once it holds the thing: where one jaw moves alone, elsewhere.
        share: How far the gripper is open as it comes, from 0 to 1.
    """

    grasp: Grasp
    thing: str
    body: str
    own: Floats
    pads: Floats
    shut: Floats
    share: float

    def at(self, scene: Scene) -> Floats:
        """Return where the gripper's frame is with the body where it is now, (4, 4) (m)."""
        return self.on(scene, scene.body(self.body))

    def pitched(self, angle: float) -> Hold:
        """Return it with the gripper turned about the way its fingers part by an angle (rad)."""
        own = self.own.copy()
        own[:3, :3] @= rotation_about((0.0, 1.0, 0.0), np.array(angle))
        return replace(self, own=own)

    def opened(self, hand: Hand, ajar: float) -> Hold:
        """Return it with the gripper open so far that each pad is that far from the thing (m)."""
        wide = self.grasp.opening + 2 * ajar
        pads = hand.opened_from(self.shut, self.grasp.opening, wide)
        return replace(self, pads=pads, share=hand.motion.share(wide))

    def drawn_back(self, distance: float) -> Hold:
        """Return it with the fingers' tips nearer to the thing by a distance (m)."""
        own = self.own.copy()
        own[:3, 3] -= distance * own[:3, 2]
        return replace(self, own=own)

    def on(self, scene: Scene, pose: Pose) -> Floats:
        """Return where the gripper's frame is with the body at a pose, (4, 4) (m)."""
        own = self.own.copy()
        own[:3, 3] *= scene.scale(self.thing)
        return pose_matrix(*pose) @ own


@dataclass(frozen=True, eq=False)
class Holds:
    """Grasps of a thing that a gripper opens wide enough for.

    Attributes:
        each: The grasps.
        closing: The force with which it closes until it feels the thing (N).
        holding: The force with which it holds it (N).
        pressing: The force on each finger from which on the thing may be moved (N): drives that are
            stiff take some steps until they press as they are asked to.
        centre: Centre of mass of the thing in its own frame, (3,) (m).
    """

    each: tuple[Hold, ...]
    closing: float
    holding: float
    pressing: float
    centre: Floats

    def lever(self, hold: Hold) -> float:
        """Return how far the thing's centre of mass is from where a grasp holds it (m).

        It does not count where a joint moves what is held: something else carries the rest.
        """
        if hold.body != hold.thing:
            return 0.0
        return float(np.linalg.norm(hold.own[:3, 3] - self.centre))

    @property
    def bodies(self) -> tuple[str, ...]:
        """The bodies that they belong to, each once."""
        return tuple(dict.fromkeys(hold.body for hold in self.each))


def holds_of(hand: Hand, body: str, thing: ObjectDescriptor, parts: Sequence[str] = ()) -> Holds:
    """Return the grasps of a thing that a gripper opens wide enough for.

    Args:
        hand: Whose gripper.
        body: The thing's name in the world.
        thing: Says where it is grasped.
        parts: What may be held, by the names that its grasps have; all of it if there are none.

    Raises:
        TaskError: If there are none.
    """
    known = tuple(dict.fromkeys(grasp.part for grasp in thing.grasps))
    if not known:
        raise TaskError(f"{thing.name} has no grasps")
    if unknown := [part for part in parts if part not in known]:
        raise TaskError(f"{thing.name} is grasped at {', '.join(known)}, not at {unknown[0]!r}")
    wanted = [grasp for grasp in thing.grasps if not parts or grasp.part in parts]
    widest = hand.motion.widest_within(SPLAYED)
    grasps = [grasp for grasp in wanted if grasp.opening + AJAR <= widest]
    if not grasps:
        narrow = min(grasp.opening for grasp in wanted)
        raise TaskError(
            f"the gripper of {hand.arm!r} takes what is less than {1e3 * (widest - AJAR):.0f} mm"
            f" wide; {thing.name} is {1e3 * narrow:.0f} mm wide where it is grasped"
        )
    shut = {grasp.opening: hand.shut(grasp.opening) for grasp in grasps}
    closing = {opening: frame for opening, frame in shut.items() if frame is not None}
    if not closing:
        tried = ", ".join(f"{1e3 * opening:.0f}" for opening in sorted(shut))
        raise TaskError(
            f"the gripper of {hand.arm!r} closes on cubes of {tried} mm, as wide as {thing.name} is"
            " where it is grasped, without holding them; robot-layouts robots inspect ROBOT --try"
            " says how it grasps"
        )
    moving, wide = {joint.name for joint in thing.joints}, max(closing)
    each = tuple(
        Hold(
            grasp,
            body,
            part_name(body, grasp.part) if grasp.part in moving else body,
            pose_matrix(grasp.position, grasp.quaternion),
            hand.opened_from(closing[grasp.opening], grasp.opening, grasp.opening + 2 * AJAR),
            closing[grasp.opening],
            hand.motion.share(wide + 2 * AJAR),
        )
        for grasp in grasps
        if grasp.opening in closing
    )
    carried = thing.mass if any(hold.body == body for hold in each) else 0.0
    force = (GENTLE if hand.quick else FIRM) + FIRM_PER_MASS * carried
    return Holds(
        each,
        hand.closing(wide),
        hand.holding(force, wide),
        min(PRESSING * force, ENOUGH),
        np.array(thing.centre_of_mass),
    )

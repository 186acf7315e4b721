"""Scripts as data: waypoints for each robot, and what a script sees of a world."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from objects.solids import part_poses
from robot_layouts.experts.grips import Grip, role_grip
from robot_layouts.kinematics.rotations import Floats, multiply, quaternion_of, rotate
from robot_layouts.simulation import State
from robot_layouts.simulation.world import WorldBody
from robots.gripper_motion import gripper_turn, hand_links, link_tree
from tasks import TaskEnv

OPEN, CLOSED = 1.0, -1.0

Pose = tuple[Floats, Floats]  # position (m) and quaternion wxyz, world


class Scene:
    """What a script sees of one world, as numpy arrays in the world frame.

    Attributes:
        design: Geometry that the task drew for this episode, if it draws any.
        bodies: What the task put into the world, as declared.
    """

    def __init__(self, task: TaskEnv) -> None:
        """Look at the first world of a task as it is now."""
        self._state: State = task.simulation.read()
        self._layout = task.standing()
        self._grip_of: Callable[[str], Grip | None] = partial(role_grip, task)
        world = task.simulation.worlds[0]
        self.design: Any = world.design
        self.bodies: tuple[WorldBody, ...] = tuple(world.bodies.values())

    def body(self, name: str) -> Pose:
        """Return the pose of a body."""
        return _split(self._state.pose(name)[0])

    def joints(self, name: str) -> dict[str, float]:
        """Return where the joints of a body are, by name (m, rad)."""
        (body,) = (body for body in self.bodies if body.name == name)
        return {j.name: float(self._state.joint(name, j.name)[0]) for j in body.joints}

    def part(self, name: str, joint: str, position: float) -> Pose:
        """Return the pose that a part of a body has when its joint is somewhere (m or rad)."""
        (body,) = (body for body in self.bodies if body.name == name)
        there = self.joints(name) | {joint: position}
        root = np.concatenate(self.body(name))[None]
        pose = part_poses(body.joints, root, np.array([list(there.values())]))[joint][0]
        return pose[:3], pose[3:]

    def scale(self, name: str) -> float:
        """Return how much larger a body is in this episode than it was declared, as a factor."""
        return next(body.size for body in self.bodies if body.name == name)

    def base(self, robot: str) -> Floats:
        """Return where the base of a robot or a limb stands, (3,)."""
        return np.array(self._layout.arm(robot).base_position)

    def tcp(self, robot: str) -> Pose:
        """Return the pose of a robot's tool centre point.

        Its z axis is the gripper's approach and its y axis the way the fingers open, if the robot's
        TCP link has them so, as a Panda's; where the TCP is the mean of several links, always. Of
        jaws that swing as they close it is the middle of what their role is to hold; see
        `robot_layouts.experts.grips.role_grip`.
        """
        if (grip := self._grip_of(robot)) is not None:
            return self._between_jaws(robot, grip)
        position, quaternion = _split(self._state.tcp_pose(robot)[0])
        turned = gripper_turn(self._layout.arm(robot).robot)
        return position, quaternion if turned is None else multiply(quaternion, turned)

    def _between_jaws(self, robot: str, grip: Grip) -> Pose:
        link = self._layout.arm(robot).robot.tcp_link
        position, quaternion = _split(self._state.link_pose(robot, link)[0])
        turned = multiply(quaternion, quaternion_of(grip.pose[:3, :3]))
        return position + rotate(quaternion, grip.pose[:3, 3]), turned

    def in_world(self, pose: Pose) -> Pose:
        """Return a pose of this scene's frame, position and quaternion, in the world (m)."""
        return pose

    def qpos(self, robot: str) -> Floats:
        """Return all joints of a robot in its descriptor's order, shape (dof,) (rad, m)."""
        return self._state.qpos(robot)[0].astype(float)

    def grasps(self, robot: str, body: str) -> bool:
        """Return whether a robot's fingers hold a body."""
        return bool(self._state.is_grasping(robot, body)[0])

    def touches(self, robot: str, body: str) -> bool:
        """Return whether a robot's hand touches a body, with its tip or with what surrounds that.

        Args:
            robot: An arm; its hand is what its last joint moves, the gripper included.
            body: The body.
        """
        arm, owner = self._layout.arm(robot).robot, self._layout.owner(robot)
        links = hand_links(arm, link_tree(self._layout[owner].robot))
        return any(self._state.contact_force(owner, link, body).any() for link in links)

    def pressure(self, robot: str, body: str) -> float:
        """Return the force with which a robot's fingers press on a body, the lesser of two (N).

        Args:
            robot: A robot that has fingers.
            body: The body.
        """
        fingers = self._layout.arm(robot).robot.fingers
        assert fingers is not None
        forces = [self._state.contact_force(robot, link, body)[0] for link in fingers.links]
        return float(min(np.linalg.norm(force) for force in forces))


Share = float | Callable[[Scene], float]
"""How far a gripper is open, from 0 to 1, or what works that out from the scene."""


@dataclass(frozen=True)
class Waypoint:
    """One thing that one robot does.

    Attributes:
        name: What it is called in the script of its robot.
        to: Poses of the TCP, worked out from the scene when the waypoint begins; of those in
            reach the one with the shortest way there is taken. Without it and ``turn`` it stays.
        gripper: Action number of the gripper meanwhile, `OPEN` … `CLOSED`; None lets it go on as in
            the waypoint before.
        after: Waypoints of other robots, ``"robot.name"``, that must be done before it begins;
            until then the robot keeps the previous one.
        near: Arm joints count as arrived when all are this near (rad).
        steps: Least number of control steps it takes.
        until: What else must hold for it to be done.
        turn: Instead of ``to``, how far the arm's joints turn, (arm joints,) (rad), worked out from
            where they are when the waypoint begins; both in the order of the robot's arm joints.
        most: Number of control steps after which, if it is not done, the script has failed.
        at: Instead of ``to``, where the TCP should be, (3,) (m, world), turned in any way: for arms
            of too few joints to choose that too.
        joints: Instead of ``to``, postures of the arm, each (arm joints,) (rad), worked out from
            the scene when the waypoint begins; the one with the shortest way there is taken.
        share: Instead of ``gripper``, how far the gripper is open meanwhile, from 0 to 1, worked
            out when the waypoint begins if it is a function of the scene; see
            `robots.gripper_motion.GripperMotion`.
        squeeze: Instead of both, the force with which its fingers close meanwhile (N), or what
            works that out from the scene at every step.
        progress: How much of its way the arm is to have gone, from 0 to 1, worked out from the
            scene at every step; without it, it goes as fast as it can.
        pushes: Whether the TCP pushes a body that slides: it goes no quicker than that this slides
            on about as far as the waypoint leads, and must come near its end.
        pace: Share of its greatest speed at which the arm moves at most, as long as its gripper
            goes on like this.
    """

    name: str
    to: Callable[[Scene], Sequence[Pose]] | None = None
    gripper: float | None = OPEN
    after: tuple[str, ...] = ()
    near: float = 0.05
    steps: int = 0
    until: Callable[[Scene], bool] | None = None
    turn: Callable[[Floats], Floats] | None = None
    most: int | None = None
    at: Callable[[Scene], Floats] | None = None
    joints: Callable[[Scene], Sequence[Floats]] | None = None
    share: Share | None = None
    squeeze: float | Callable[[Scene], float] | None = None
    progress: Callable[[Scene], float] | None = None
    pushes: bool = False
    pace: float = 1.0


Script = Mapping[str, Sequence[Waypoint]]


def _split(row: NDArray[np.float32]) -> Pose:
    return row[:3].astype(float), row[3:].astype(float)

"""Arms with grippers, asked for many grips at once: which are in reach, and in which posture."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import pi

import numpy as np
from numpy.typing import NDArray

from robot_layouts.experts.grips import MIDDLE_DEPTHS, Grip, grip_of, swings
from robot_layouts.experts.script import Pose, Scene
from robot_layouts.kinematics.rotations import (
    Floats,
    inverse_pose,
    pose_matrix,
    quaternion_of,
    rotation_about,
)
from robot_layouts.kinematics.solve import IkGoal, scattered, shortfalls, solve
from robots.action_split import is_gripper
from robots.gripper_motion import aiming_joints, gripper_motion, hand_links, link_tree
from robots.urdf.tcp import find_tcp
from tasks import TaskEnv

FULL = 6  # joints with which an arm may turn its gripper in any way
PLACE = 2e-3  # m that a posture may miss
TURN, ROUGH_TURN = 0.03, 0.35  # rad that it may miss; with fewer joints
TURN_WORTH = 0.02  # m that a turn by 1 rad is worth to an arm of fewer joints
FIRST_ITERATIONS, ITERATIONS = 12, 30
NEAR, NEAR_TURN = 0.1, 0.8  # m and rad from a goal after the first of them
RANDOM_STARTS = 3
QUICK = 2.0  # times that quick drives nearly settle in a control step
FIRMNESSES = (1.0, 2.5, 4.0)  # factors on the force that holds a cube; the first that suffices
CLOSING, STEP = 60.0, 4e-4  # N with which fingers close, at least; m per step, at least
YIELD = 6e-5  # m that quick fingers are driven into what they hold, at least
LEAST_SIDE = 0.012  # m; of the smallest cube that they are tried with


@dataclass(frozen=True, eq=False)
class HandPostures:
    """Postures of a hand.

    Attributes:
        which: Number of the pose that each was asked for, (k,).
        qpos: All joints of the robot, (k, dof) (rad, m).
        turns: Orientation of the frame that was to be brought there, (k, 3, 3), world.
        off: By how much that is turned otherwise than was asked for, (k,) (rad).
    """

    which: NDArray[np.intp]
    qpos: Floats
    turns: Floats
    off: Floats

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self.which)

    def __getitem__(self, some: NDArray[np.intp]) -> HandPostures:
        """Return some of them, in that order."""
        return HandPostures(self.which[some], self.qpos[some], self.turns[some], self.off[some])


class Hand:
    """An arm and its gripper, wherever it stands.

    Attributes:
        arm: Its name in the layout.
        owner: The robot that it belongs to.
        motion: How its gripper moves.
        length: How far it reaches (m).
        quick: Whether its fingers are where they are driven to after each control step.
        columns: Indices of the arm's joints among the robot's, those of a head or a torso that are
            driven with it included.
        base: Pose of the robot's base in the world, (4, 4) (m).
        links: Names of the hand's links.
    """

    def __init__(self, task: TaskEnv, arm: str) -> None:
        """Take an arm of a task.

        Raises:
            DescriptorError: If it has no fingers.
            AssetError: If robot files cannot be found.
        """
        layout = task.standing()
        own, self.owner = layout.arm(arm).robot, layout.owner(arm)
        robot = layout[self.owner].robot
        self._robot, self._limb = robot, layout.arm_name(arm).removeprefix(self.owner)
        self.arm, self.motion, self.length = arm, gripper_motion(own), own.reach
        self.columns = [robot.joints.index(joint) for joint in own.arm_joints]
        self._gripper = [robot.joints.index(joint) for joint in self.motion.joints]
        pose = layout[self.owner].base_pose
        self.base = pose_matrix(pose.position, pose.quaternion)
        whole = link_tree(robot)
        self.links = hand_links(own, whole)
        self._tree = whole.towards(find_tcp(own, whole).needed)
        self._tcp = find_tcp(own, self._tree)
        self._aiming = [robot.joints.index(joint) for joint in aiming_joints(robot, own)]
        few = len(self._aiming) < FULL
        self._turn, self._worth = (ROUGH_TURN, TURN_WORTH) if few else (TURN, 1.0)
        self._simulator, seconds = task.scenario.simulator, 1 / task.scenario.control_frequency
        grippers = [g for name, g in own.action_split.groups.items() if is_gripper(name) and g.size]
        self.quick = all(
            np.min(group.stiffness) * seconds > QUICK * np.max(group.damping) for group in grippers
        )
        self._random = scattered(self._tree.limits[self._aiming], RANDOM_STARTS)

    def grip(
        self, side: float, depth: float, firmness: float = 1.0, *, shaken: bool = True
    ) -> Grip | None:
        """Return how it holds a cube, as it was seen to in physics; None if it does not.

        Args:
            side: Of the cube (m).
            depth: How far before the middle of its pads the cube's middle is when they close, as a
                share of its side.
            firmness: Factor on the usual force with which it holds the cube.
            shaken: Whether the cube must stay in the hand when that is shaken.

        Raises:
            RobotLayoutsError: If the robot cannot be built.
        """
        side, simulator = round(side, 6), self._simulator
        return grip_of(self._robot, self._limb, side, depth, firmness, simulator, shaken=shaken)

    def qpos(self, scene: Scene) -> Floats:
        """Return all joints of its robot now, (dof,) (rad, m)."""
        return scene.qpos(self.owner)

    def share(self, scene: Scene) -> float:
        """Return how far its gripper is open now, from 0 to 1."""
        return self.motion.share_at(self.qpos(scene)[self._gripper])

    def like(self, scene: Scene, posture: Floats) -> Floats:
        """Return a posture of the arm with all other joints where they are now, (dof,) (rad, m)."""
        qpos = self.qpos(scene)
        qpos[self.columns] = posture[self.columns]
        return qpos

    def joints(self, qpos: Floats) -> Floats:
        """Return the arm's joints among all of its robot, (…, arm joints) (rad)."""
        return qpos[..., self.columns]

    def opened(self, qpos: Floats, share: float) -> Floats:
        """Return postures with the gripper open by a share, (…, dof) (rad, m)."""
        opened = qpos.copy()
        opened[..., self._gripper] = self.motion.positions(share)
        return opened

    def link(self, qpos: Floats) -> Floats:
        """Return the pose of the TCP link in postures, (k, 4, 4) (m, world)."""
        return self.base @ self._tree.forward(qpos)[:, self._tcp.turned]

    def turns(self, qpos: Floats) -> Floats:
        """Return the orientation of the gripper's frame in postures, (k, 3, 3), world."""
        return self.link(qpos)[:, :3, :3] @ self.motion.turn

    def held(self, scene: Scene, body: str) -> Floats:
        """Return the pose of a body in the TCP link's frame, (4, 4) (m)."""
        return inverse_pose(self.link(self.qpos(scene)[None])[0]) @ pose_matrix(*scene.body(body))

    def brought(self, qpos: Floats, held: Floats) -> Pose:
        """Return where what it holds is in a posture, (dof,) (rad, m); see `held`."""
        pose = self.link(qpos[None])[0] @ held
        return pose[:3, 3], quaternion_of(pose[:3, :3])

    def shut(self, opening: float) -> Floats | None:
        """Return the frame of the gripper where it holds what is so wide, (4, 4) (m), or None.

        It is that of `robots.gripper_motion` with its origin in the middle of the thing, in the TCP
        link's frame. Jaws that turn as they close are seen to hold a cube in physics first; if they
        do not, there is none.

        Args:
            opening: How wide (m).
        """
        if not swings(self.motion, opening):
            return self.pointing(self.motion.middle(self.motion.share(opening)))
        side = max(opening, LEAST_SIDE)
        grips = (self.grip(side, depth, shaken=False) for depth in MIDDLE_DEPTHS)
        grip = next((grip for grip in grips if grip is not None), None)
        if grip is None:
            return None
        return self.opened_from(self.pointing(grip.shut[:3, 3]), side, opening)

    def opened_from(self, shut: Floats, opening: float, wider: float) -> Floats:
        """Return the frame of `shut` with the gripper open, the thing halfway between the jaws.

        Args:
            shut: See there.
            opening: How wide the thing is (m).
            wider: How far the gripper is open (m).
        """
        frame, middle = shut.copy(), self.motion.middle
        frame[:3, 3] += middle(self.motion.share(wider)) - middle(self.motion.share(opening))
        return frame

    def closing(self, opening: float) -> float:
        """Return the force with which it closes until it feels what is so wide (m) (N)."""
        return max(CLOSING, self.motion.force(STEP, self.motion.share(opening)))

    def holding(self, force: float, opening: float) -> float:
        """Return the force to ask for so that it holds what it moves by a force (N).

        Of what quick drives press with, little is left once they have settled.

        Args:
            force: With which the thing is to be held (N).
            opening: How wide it is (m).
        """
        least = self.motion.force(YIELD, self.motion.share(opening)) if self.quick else 0.0
        return max(force, least)

    def pointing(self, place: Floats) -> Floats:
        """Return the gripper's frame with its origin at a place, in the TCP link's, (4, 4) (m)."""
        frame = np.eye(4)
        frame[:3, :3], frame[:3, 3] = self.motion.turn, place
        return frame

    def reach(
        self,
        places: Floats,
        turns: Floats,
        frame: Floats,
        starts: Floats,
        *,
        scatter: bool = True,
        loose: bool = False,
    ) -> HandPostures:
        """Return the postures that bring a frame of the TCP link to poses, for each at most one.

        Args:
            places: Where its origin is to be, (n, 3) (m, world).
            turns: How it is to be turned there, (n, 3, 3), world.
            frame: Its pose in the TCP link's frame, (4, 4) (m).
            starts: Postures to begin from, (s, dof) (rad, m); that which comes nearest to the first
                of them is returned.
            scatter: Whether to begin from a few random postures as well.
            loose: Whether the gripper may be turned otherwise by as much as an arm of few joints.
        """
        if scatter:
            starts = np.concatenate([starts, self.scattered(starts[0])])
        n, s = len(places), len(starts)
        root = np.linalg.inv(self.base)
        goal = IkGoal(
            np.repeat(places @ root[:3, :3].T + root[:3, 3], s, axis=0),
            (self._tcp.turned,),
            np.repeat(root[:3, :3] @ turns @ frame[:3, :3].T, s, axis=0),
            self._tcp.turned,
            frame[:3, 3],
        )
        qpos = self._descended(goal, np.tile(starts, (n, 1)), TURN_WORTH if loose else self._worth)
        missing, turned = shortfalls(self._tree, goal, qpos)
        fits = (missing < PLACE) & (turned < (ROUGH_TURN if loose else self._turn))
        ways = np.abs(qpos - starts[0])[:, self.columns].max(axis=1)
        ways = np.where(fits, ways, np.inf).reshape(n, s)
        which = np.flatnonzero(np.isfinite(ways.min(axis=1)))
        chosen = which * s + ways.argmin(axis=1)[which]
        reached = self.link(qpos[chosen])[:, :3, :3] @ frame[:3, :3]
        return HandPostures(which, qpos[chosen], reached, turned[chosen])

    def scattered(self, qpos: Floats) -> Floats:
        """Return the same few random postures of the arm every time, (k, dof) (rad, m).

        Args:
            qpos: All other joints, (dof,) (rad, m).
        """
        more = np.tile(qpos, (RANDOM_STARTS, 1))
        more[:, self._aiming] = self._random
        return more

    def _descended(self, goal: IkGoal, rows: Floats, worth: float) -> Floats:
        """Bring rows of postures towards a goal; those that are far from it soon are left there."""
        qpos = solve(self._tree, goal, rows, self._aiming, FIRST_ITERATIONS, worth).qpos
        missing, turned = shortfalls(self._tree, goal, qpos)
        near = np.flatnonzero((missing < NEAR) & (turned < NEAR_TURN))
        if len(near):
            assert goal.rotation is not None
            some = replace(goal, position=goal.position[near], rotation=goal.rotation[near])
            rows = qpos[near]
            qpos[near] = solve(self._tree, some, rows, self._aiming, ITERATIONS, worth).qpos
        return qpos

    def way(self, one: Floats, other: Floats) -> Floats:
        """Return how far the joint has to turn that turns farthest, (k,) (rad)."""
        return np.abs(one - other)[..., self.columns].max(axis=-1)


def box_grips(turn: Floats, around: int = 12) -> Floats:
    """Return how a gripper may be turned to hold a box by two faces, (n, 3, 3), world.

    Args:
        turn: Orientation of the box, (3, 3), world.
        around: How many approaches about each way in which the fingers may part.
    """
    grips: list[Floats] = []
    for axis in range(3):
        for side in (1, -1):
            opening = side * turn[:, axis]
            first = turn[:, (axis + 1) % 3]
            for i in range(around):
                approach = rotation_about(opening.tolist(), np.array(2 * pi * i / around)) @ first
                grips.append(np.stack([np.cross(opening, approach), opening, approach], axis=1))
    return np.array(grips)


def offsets(turns: Floats, back: float) -> Floats:
    """Return how far a gripper's middle lies from what it approaches, (n, 3) (m).

    Args:
        turns: Orientations of the gripper's frame, (n, 3, 3).
        back: How far before it (m).
    """
    return -back * turns[:, :, 2]


def between(one: Floats, other: Floats) -> Floats:
    """Return the cosine between the approaches of grippers, (…,).

    Args:
        one: Orientations of one's frame, (…, 3, 3).
        other: Of the other's, (…, 3, 3).
    """
    return (one[..., 2] * other[..., 2]).sum(axis=-1)

"""Scripted motions that grasp, carry and push, as actions: contact that random actions never make.

They only need to touch things, not to solve the task. Each is planned by playing it once in an
environment of ours.
"""

import functools
from collections.abc import Callable, Container, Mapping, Sequence
from math import atan2, cos, pi, sin

import numpy as np
import sapien

import tasks
from robot_layouts.simulation.sapien3.arms import SapienArm
from robot_layouts.simulation.sapien3.backend import worlds_below
from robot_layouts.simulation.solvers import InverseKinematics
from tasks.episode import Episode

OPEN, CLOSED = 1.0, -1.0
STEP = 0.1  # rad that an arm's action of 1 asks for


class Puppeteer:
    """Plays an environment by target poses and writes down the actions."""

    def __init__(self, task_id: str, seed: int) -> None:
        self.env = tasks.make(task_id)
        self.env.reset(seed=seed)
        self.world = worlds_below(self.env.simulation)[0]
        self.seed = seed
        self.actions: list[np.ndarray] = []

    def episode(self) -> Episode:
        return Episode(self.seed, np.array(self.actions))

    def move(
        self,
        steps: int,
        grip: float,
        targets: Mapping[str, tuple[Sequence[float], Sequence[float]]],
    ) -> None:
        """Move TCPs towards poses (m, wxyz) for some steps.

        Other robots keep their joints, and so does one that cannot reach its pose.
        """
        goals = {}
        for robot, placement in self.env.layout.items():
            qpos = self.world.robots[robot].articulation.qpos
            goals[robot] = qpos[: len(placement.robot.arm_joints)]
            if robot in targets:
                solution = InverseKinematics(SapienArm(self.world, robot)).solve(
                    *targets[robot], qpos
                )
                goals[robot] = goals[robot] if solution is None else solution
        self.follow(steps, grip, goals, targets)

    def follow(
        self,
        steps: int,
        grip: float,
        goals: Mapping[str, np.ndarray],
        grippers: Container[str],
    ) -> None:
        """Move arms towards joint positions (rad) for some steps, and some of the grippers."""
        for _ in range(steps):
            action = np.full(self.env.layout.action_dim, OPEN, np.float32)
            for robot, part in self.env.action_split.items():
                qpos = self.world.robots[robot].articulation.qpos
                delta = (goals[robot] - qpos[: len(goals[robot])]) / STEP
                action[part][: len(delta)] = np.clip(delta, -1, 1)
                if robot in grippers:
                    action[part][len(delta) :] = grip
            self.play(action)

    def shake(self, robot: str, steps: int, grip: float) -> None:
        """Move one arm at random, the gripper as it is."""
        rng = np.random.default_rng(self.seed)
        for _ in range(steps):
            action = np.full(self.env.layout.action_dim, OPEN, np.float32)
            for name, part in self.env.action_split.items():
                arm = len(self.env.layout[name].robot.arm_joints)
                action[part][:arm] = rng.uniform(-1, 1, arm) if name == robot else 0
                if name == robot:
                    action[part][arm:] = grip
            self.play(action)

    def play(self, action: np.ndarray) -> None:
        self.actions.append(action)
        self.env.step(action)

    def place(self, body: str) -> tuple[np.ndarray, float]:
        """Position (m) and yaw (rad) of a body."""
        pose = self.world.bodies[body].entity.pose
        return np.array(pose.p), yaw_of(pose.q)


def downwards(yaw: float) -> tuple[float, ...]:
    """Orientation (wxyz) of a hand that points down, turned by a yaw (rad)."""
    return (0.0, cos(yaw / 2), sin(yaw / 2), 0.0)


def nearest_quarter(yaw: float, to: float) -> float:
    """The yaw that looks the same on a cube and is nearest to another (rad)."""
    return to + (yaw - to + pi / 4) % (pi / 2) - pi / 4


def grasp_and_shake(
    puppeteer: Puppeteer, robot: str, yaw_at_rest: float, approach: int = 14, body: str = "cube"
) -> None:
    """Grasp a body from above, lift it, shake it, and end with it in the hand."""
    (x, y, z), yaw = puppeteer.place(body)
    hand = downwards(nearest_quarter(yaw, yaw_at_rest))
    puppeteer.move(approach, OPEN, {robot: ((x, y, z + 0.08), hand)})
    puppeteer.move(8, OPEN, {robot: ((x, y, z), hand)})
    puppeteer.move(5, CLOSED, {robot: ((x, y, z), hand)})
    puppeteer.move(10, CLOSED, {robot: ((x, y, z + 0.12), hand)})
    puppeteer.shake(robot, 10, CLOSED)


def pick_cube(puppeteer: Puppeteer) -> None:
    """Grasp, lift, shake, hold."""
    grasp_and_shake(puppeteer, "arm", 0.0)


def pick_cube_so100(puppeteer: Puppeteer) -> None:
    """Bring the jaws over the cube and close them; it mostly slips away, but it is touched."""
    (x, y, z), _ = puppeteer.place("cube")
    for height, steps, grip in ((0.05, 25, 0.0), (0.0, 30, 0.0), (0.0, 15, CLOSED)):
        goal = jaws_down(puppeteer, "arm", np.array([x, y, z + height]))
        puppeteer.follow(steps, grip, {"arm": goal}, ["arm"])
    puppeteer.shake("arm", 10, CLOSED)


def jaws_down(puppeteer: Puppeteer, robot: str, position: np.ndarray) -> np.ndarray:
    """Arm joints (rad) that bring the mean of two jaw tips near a position (m), jaws down.

    Found by drawing joints, ever nearer to the best so far: this arm has too few joints for
    inverse kinematics of a pose.
    """
    simulated = puppeteer.world.robots[robot]
    model = simulated.articulation.create_pinocchio_model()
    names = [link.name for link in simulated.articulation.links]
    tips = [names.index(link) for link in simulated.descriptor.tcp_position_links]
    hand = names.index(simulated.descriptor.tcp_link)
    limits = np.concatenate([joint.limits for joint in simulated.joints])
    start = simulated.articulation.qpos.astype(float)
    arm = len(simulated.descriptor.arm_joints)

    def cost(joints: np.ndarray) -> float:
        model.compute_forward_kinematics(np.append(joints, start[arm:]))
        first, second = ((simulated.base_pose * model.get_link_pose(i)).p for i in tips)
        frame = simulated.base_pose * model.get_link_pose(hand)
        tilt = 1 - frame.to_transformation_matrix()[2, 1]  # the jaws point along -y
        return float(np.linalg.norm((first + second) / 2 - position) + 0.02 * tilt)

    rng = np.random.default_rng(puppeteer.seed)
    best, least, spread = start[:arm], cost(start[:arm]), 1.0
    for _ in range(1500):
        drawn = np.clip(best + rng.normal(0, spread, arm), *limits[:arm].T)
        if (found := cost(drawn)) < least:
            best, least = drawn, found
        spread = max(spread * 0.997, 0.02)
    return best


def poke_cube(puppeteer: Puppeteer) -> None:
    """Grasp the peg, which lies nearer than the cube."""
    grasp_and_shake(puppeteer, "arm", 0.0, body="peg")


def two_robot_pick_cube(puppeteer: Puppeteer) -> None:
    """The left arm lays the cube down in the middle, the right one takes it up."""
    grasp_and_shake(puppeteer, "left", pi / 2)
    hand = downwards(pi / 2)
    puppeteer.move(12, CLOSED, {"left": ((0.0, -0.1, 0.2), hand)})  # up, wherever it was shaken to
    puppeteer.move(20, CLOSED, {"left": ((0.0, 0.03, 0.1), hand)})
    puppeteer.move(8, CLOSED, {"left": ((0.0, 0.03, 0.03), hand)})
    puppeteer.move(3, OPEN, {"left": ((0.0, 0.03, 0.03), hand)})
    puppeteer.move(12, OPEN, {"left": ((0.0, -0.2, 0.3), hand)})
    grasp_and_shake(puppeteer, "right", -pi / 2, approach=28)


def push_t(puppeteer: Puppeteer) -> None:
    """Drive the stick through the T, twice, from two sides."""
    hand = downwards(0.0)
    for angle in (0.3, 2.2):
        (x, y, _), _ = puppeteer.place("Tee")
        dx, dy = cos(angle), sin(angle)
        puppeteer.move(12, OPEN, {"arm": ((x - 0.17 * dx, y - 0.17 * dy, 0.12), hand)})
        puppeteer.move(6, OPEN, {"arm": ((x - 0.17 * dx, y - 0.17 * dy, 0.02), hand)})
        puppeteer.move(14, OPEN, {"arm": ((x + 0.08 * dx, y + 0.08 * dy, 0.02), hand)})
        puppeteer.move(4, OPEN, {"arm": ((x + 0.08 * dx, y + 0.08 * dy, 0.12), hand)})


def bend(puppeteer: Puppeteer, steps: int, joints: Mapping[str, float]) -> None:
    """Move all joints of a robot towards some positions (rad) for some steps; 0 if left out."""
    robot = puppeteer.world.robots["robot"]
    (group,) = robot.descriptor.action_split.groups.values()
    goal = np.array([joints.get(joint, 0.0) for joint in group.joints])
    widest = np.array([upper for _, upper in group.ranges])
    for _ in range(steps):
        delta = (goal - robot.articulation.qpos[robot.active_index]) / widest
        puppeteer.play(np.clip(delta, -1.0, 1.0).astype(np.float32))


def lift_box(puppeteer: Puppeteer) -> None:
    """Turn to the box, press both hands on it, turn on with it, and let it go."""
    for steps, turn, roll, pitch in (
        (14, -1.55, 1.25, 0.0),
        (6, -1.55, 1.25, 0.3),
        (14, -1.55, -0.3, 0.3),
        (16, 1.45, -0.4, 0.3),
        (6, 1.45, 1.25, 0.3),
    ):
        joints = {"left_shoulder_roll_joint": roll, "right_shoulder_roll_joint": -roll}
        for side in ("left", "right"):
            joints |= {f"{side}_shoulder_pitch_joint": pitch, f"{side}_elbow_pitch_joint": -0.2}
        bend(puppeteer, steps, {"torso_joint": turn, **joints})


def close_on_apple(puppeteer: Puppeteer) -> None:
    """Bring the right hand over the apple, down on it, close it, and push."""
    (x, y, z), _ = puppeteer.place("apple")
    fingers = {f"right_{number}_joint": 1.4 for number in ("three", "four", "five", "six")}
    fingers |= {"right_one_joint": -0.5, "right_two_joint": -0.8}
    for steps, place, closed in (
        (14, (x - 0.08, y + 0.006, z + 0.138), {}),
        (14, (x, y + 0.006, z + 0.018), {}),
        (10, (x, y + 0.006, z + 0.018), fingers),
        (8, (x + 0.05, y + 0.056, z + 0.018), fingers),
    ):
        bend(puppeteer, steps, right_arm_at(puppeteer, place) | closed)


def right_arm_at(puppeteer: Puppeteer, position: Sequence[float]) -> dict[str, float]:
    """Return the joints (rad) of a humanoid's right arm that bring its hand to a place (m)."""
    robot = puppeteer.world.robots["robot"]
    model = robot.articulation.create_pinocchio_model()
    hand = [link.name for link in robot.articulation.links].index("right_tcp_link")
    names = [joint.name for joint in robot.joints]
    arm = np.array([name.startswith(("right_shoulder", "right_elbow")) for name in names])
    goal = robot.base_pose.inv() * sapien.Pose(list(position), [0.837, 0.478, 0.254, 0.081])
    joints, *_ = model.compute_inverse_kinematics(
        hand, goal, initial_qpos=np.zeros(len(names)), active_qmask=arm.astype(int)
    )
    return {name: q for name, q, own in zip(names, joints.tolist(), arm, strict=True) if own}


def turn_valve(puppeteer: Puppeteer) -> None:
    """Swing all fingers to and fro, so that they push the spokes; found by trying."""
    swing = np.repeat([1.19, 0.11, -0.41], 3)  # of the fingers' first joints, second and third
    phases = np.array([7.77, 5.42, 6.76, *[0.11] * 3, *[2.75] * 3])
    inwards = np.array([-0.42, 0.42, 0.42, *[0.71] * 3, *[0.53] * 3])  # at first
    for step in range(60):
        action = swing * np.sin(0.13 * step + phases) + inwards * (step < 10)
        puppeteer.play(action.astype(np.float32))


def fmb_assembly(puppeteer: Puppeteer) -> None:
    """Grasp the bridge, let it fall into the fixture, and strike the assembly."""
    grasp_and_shake(puppeteer, "arm", pi / 2, approach=28, body="bridge_grasp")
    hand = downwards(pi / 2)
    puppeteer.move(12, CLOSED, {"arm": ((0.05, 0.25, 0.15), hand)})
    puppeteer.move(8, OPEN, {"arm": ((0.05, 0.25, 0.12), hand)})
    puppeteer.move(12, OPEN, {"arm": ((0.13, 0.0, 0.2), hand)})
    puppeteer.move(10, CLOSED, {"arm": ((0.13, 0.02, 0.05), hand)})


def draw(puppeteer: Puppeteer) -> None:
    """Press a stick on the canvas and draw a bow; lift it, and draw another dot."""
    for steps, joints in ((45, (0, 1, 0, -0.4)), (15, (1, 0, 0, 0)), (15, (0, -1)), (20, (0, 1))):
        for _ in range(steps):
            puppeteer.play(np.array([*joints, *[0] * (7 - len(joints))], np.float32))


def touch_something(puppeteer: Puppeteer) -> None:
    """Reach for the first movable body with every robot in turn; for tasks not listed below."""
    bodies = [
        b.name for b in puppeteer.env.simulation.worlds[0].bodies.values() if b.kind == "dynamic"
    ]
    for robot, placement in puppeteer.env.layout.items():
        if bodies:
            yaw_at_rest = yaw_of(placement.base_quaternion)
            grasp_and_shake(puppeteer, robot, yaw_at_rest, body=bodies[0])
        else:
            puppeteer.shake(robot, 40, CLOSED)


def yaw_of(quaternion: Sequence[float]) -> float:
    """Yaw (rad) of an orientation (wxyz) that only turns about z."""
    return 2 * atan2(quaternion[3], quaternion[0])


# Motions made for a task; `touch_something` serves the others.
MOTIONS: dict[str, Callable[[Puppeteer], None]] = {
    "FMBAssembly1Easy-v1": fmb_assembly,
    "PickCube-v1": pick_cube,
    "PickCubeSO100-v1": pick_cube_so100,
    "PokeCube-v1": poke_cube,
    "PushT-v1": push_t,
    **{f"RotateValveLevel{level}-v1": turn_valve for level in range(5)},
    "TableTopFreeDraw-v1": draw,
    "TwoRobotPickCube-v1": two_robot_pick_cube,
    "UnitreeG1PlaceAppleInBowl-v1": close_on_apple,
    "UnitreeG1TransportBox-v1": lift_box,
}


@functools.cache
def touching_episode(task_id: str, seed: int) -> Episode:
    """Return the scripted motion of a task, planned for a seed."""
    puppeteer = Puppeteer(task_id, seed)
    MOTIONS.get(task_id, touch_something)(puppeteer)
    return puppeteer.episode()

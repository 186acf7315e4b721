"""Tries a robot out: stands it alone, steps it, moves each action number and its TCP.

A robot whose base drives stands on a floor.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import product, takewhile
from typing import NamedTuple

import numpy as np

from layouts import Layout, single
from objects.shapes import Plane, Shape
from robot_layouts.simulation.backend import CLONING, Overlap, Part
from robot_layouts.simulation.checks.overlaps import empty, stand, starting_overlaps
from robot_layouts.simulation.maths import Array, Floats
from robot_layouts.simulation.physics import PhysicsSettings
from robot_layouts.simulation.simulation import Simulation
from robot_layouts.simulation.world import World
from robots import ActionNumber, RobotDescriptor
from robots.urdf.model import ModelJoint, UrdfModel
from robots.urdf.reading import read_model
from robots.urdf.summary import read_urdf

NAME = "robot"  # its name in the layout

KICK = 0.1  # rad or m in the first step; a robot that holds still moves by less
STILL = 0.1  # rad/s or m/s after `HELD` steps of holding still
HELD = 20  # steps
EXPLODES = 10.0  # times a joint's largest speed
# A relative number is given until its own joints have moved by half of what one step asks for, two
# steps at most. Others are to move by less than a tenth of what was asked for until then: an arm's
# links push each other. A number that asks for a position or a speed has half a second.
OWN_SHARE, OTHER_SHARE = 0.5, 0.1
RELATIVE_STEPS, ABSOLUTE_STEPS = 2, 10
ABSOLUTE_TIME = 0.5  # s, of those steps
MOST_SHARE = 10.0
LEAST_ASKED = {"rad": 0.1, "m": 0.02}  # by which joints of the other unit are judged

TCP_WAY, TCP_ERROR = 0.05, 0.002  # m
_ON_THE_WAY, _AT_THE_END = 20, 40  # steps


class Moved(NamedTuple):
    """A joint and a number: how far it moved (rad, m), or how fast (rad/s, m/s)."""

    joint: str
    amount: float


class Fastest(NamedTuple):
    """The joint that was the fastest for its limit.

    Attributes:
        joint: Joint name.
        speed: Its speed (rad/s, m/s); infinite if it was not finite.
        limit: What is taken as its limit (rad/s, m/s).
        step: In which step.
    """

    joint: str
    speed: float
    limit: float
    step: int

    @property
    def times(self) -> float:
        """How many times its limit it moved at."""
        return self.speed / self.limit


@dataclass(frozen=True)
class NumberTrial:
    """What an action number did.

    Attributes:
        number: The number.
        asked: How far its leading joint was to move, in a step if it is relative (rad, m).
        least: The one of its own joints that followed least, and its share of that.
        other: The joint of the others that moved most, and its share of what was asked for until
            then; None if there is no other.
    """

    number: ActionNumber
    asked: float
    least: Moved
    other: Moved | None

    @property
    def problem(self) -> str | None:
        """What is wrong with it, or None."""
        if not self.least.amount > OWN_SHARE:
            joint, share = self.least
            return f"{self.number.name} moves {joint} by {percent(share)} of what it asks for"
        if self.other is not None and not self.other.amount < OTHER_SHARE:
            joint, share = self.other
            return f"{self.number.name} also moves {joint}, by {percent(share)} of what it asks for"
        return None


@dataclass(frozen=True)
class Trial:
    """What was seen of a robot that stood alone, without gravity on its links.

    One whose base drives stood on a floor at the height of its root link.

    Attributes:
        robot: The robot.
        overlaps: Its links that are inside each other, or the floor, at the start.
        first_step: The joint that moved most in the first step of holding still (rad, m).
        after_hold: The joint that was fastest after `HELD` steps of it (rad/s, m/s).
        steps: Random steps that it was given.
        fastest: Of them, the fastest joint.
        exploded: Where a joint first was `EXPLODES` times too fast; None if none ever was.
        numbers: What each action number did.
        tcp_way: Farthest that the TCP was moved by one of them (m).
    """

    robot: RobotDescriptor
    overlaps: tuple[Overlap, ...]
    first_step: Moved
    after_hold: Moved
    steps: int
    fastest: Fastest
    exploded: Fastest | None
    numbers: tuple[NumberTrial, ...]
    tcp_way: float

    def unit(self, joint: str) -> str:
        """Return the unit of a joint's position: rad or m."""
        groups = self.robot.action_split.groups.values()
        return next(group.unit for group in groups if joint in group.joints)

    @property
    def stands(self) -> bool:
        """Whether it holds still when it is to."""
        return self.first_step.amount < KICK and self.after_hold.amount < STILL

    @property
    def problems(self) -> tuple[str, ...]:
        """What is wrong, a sentence each, and the likely cause; nothing if it works."""
        problems = tuple(self._problems())
        if not problems or not self.overlaps:
            return problems
        cause = f"the likely cause: at the start {in_itself(self.overlaps[0])}"
        links = sorted({o.one.name for o in self.overlaps if o.other.name == FLOOR})
        if links:
            cause += f"; the descriptor's no_floor_contact={(*links,)} would end that"
        return (*problems, cause)

    def _problems(self) -> Iterator[str]:
        joint, amount = self.first_step
        if not amount < KICK:
            way = f"{amount:.3g} {self.unit(joint)}"
            yield f"it kicks: {joint} moves by {way} in the first step of holding still"
        joint, amount = self.after_hold
        if not amount < STILL:
            speed = f"{amount:.3g} {self.unit(joint)}/s"
            yield f"it does not hold still: {joint} moves at {speed} after {HELD} steps"
        if self.exploded is not None:
            joint, speed, limit, step = self.exploded
            times = f"{speed / limit:.3g} times the {limit:.3g} {self.unit(joint)}/s"
            yield f"it explodes: in step {step} {joint} moves at {times} taken as its limit"
        yield from (trial.problem for trial in self.numbers if trial.problem is not None)
        if not self.tcp_way > 0.0:
            yield f"the TCP, {self.robot.tcp_link}, is moved by no action number"


def try_robot(robot: RobotDescriptor, steps: int = 50, seed: int = 0) -> Trial:
    """Stand a robot alone, hold it still, give it random actions, and move each of its numbers.

    Args:
        robot: The robot.
        steps: Random steps.
        seed: Of the actions.

    Raises:
        RobotLayoutsError: If it cannot be built.
    """
    alone = RobotAlone(single({NAME: robot}))
    overlaps = tuple(starting_overlaps(alone.layout, build=alone.build))
    first, after = alone.hold_still()
    fastest, exploded = alone.play(np.random.default_rng(seed), steps)
    moved = [alone.move(number) for number in robot.describe_action()]
    return Trial(
        robot=robot,
        overlaps=overlaps,
        first_step=first,
        after_hold=after,
        steps=steps,
        fastest=fastest,
        exploded=exploded,
        numbers=tuple(trial for trial, _ in moved),
        tcp_way=max((way for _, way in moved), default=0.0),
    )


def tcp_error(robot: RobotDescriptor) -> float | None:
    """Move a robot's TCP by `TCP_WAY` as inverse kinematics says, and return what was missing (m).

    Of six directions, the one that asks for the shortest way of its joints.

    Args:
        robot: The robot.

    Returns:
        None if no posture was found.

    Raises:
        RobotLayoutsError: If it cannot be built.
    """
    layout = single({NAME: robot}).in_control_mode("pd_joint_pos")
    alone = RobotAlone(layout)
    start = alone.tcp()
    ways = [sign * TCP_WAY * np.eye(3)[axis] for axis, sign in product(range(3), (1, -1))]
    targets = {str(i): tuple((start + way).tolist()) for i, way in enumerate(ways)}
    report = layout.validate(targets=targets, samples=0, workspaces=False)
    reached = [reach for reach in report.reaches if reach.missing < TCP_ERROR / 2]
    if not reached:
        return None
    here = np.array(alone.start)
    best = min(
        reached, key=lambda reach: (not reach.reached, np.abs(np.array(reach.qpos) - here).max())
    )
    for share in np.linspace(0, 1, _ON_THE_WAY).tolist() + [1.0] * _AT_THE_END:
        alone.step(alone.numbers_for(here + share * (np.array(best.qpos) - here)))
    return float(np.linalg.norm(alone.tcp() - targets[best.target]))


def in_itself(overlap: Overlap) -> str:
    """Return an overlap of two links of one robot in words, without the robot's name."""
    return str(
        overlap._replace(one=Part(None, overlap.one.name), other=Part(None, overlap.other.name))
    )


def percent(share: float) -> str:
    """Return a share in words; those of joints that fly off say no more than that."""
    return f"{share:.0%}" if share < MOST_SHARE else f"more than {MOST_SHARE:.0%}"


class RobotAlone:
    """A robot alone in a world, at its start.

    Attributes:
        layout: The robot.
        robot: Its descriptor.
        start: Where its joints start, (dof,) (rad, m).
        build: What else the world holds.
        simulation: The world.
    """

    def __init__(
        self,
        layout: Layout,
        *bodies: tuple[str, Shape],
        physics: PhysicsSettings | None = None,
        simulator: str = CLONING,
    ) -> None:
        """Stand the robot of a layout in a world, with other bodies, by name, that move freely."""
        self.layout = layout
        self.robot, self.start = layout[NAME].robot, layout[NAME].start_qpos
        base = layout[NAME].base_position[2]
        floor = adds_floor(base) if drives_on_floor(self.robot) else empty

        def build(world: World, number: int) -> None:
            floor(world, number)
            for name, shape in bodies:
                world.add(name, shape)

        self.build = build
        self.simulation = Simulation(layout, self.build, 1, physics, simulator=simulator)
        self._limits = self.simulation.index.robots[NAME].speeds
        stand(self.simulation)

    def hold_still(self) -> tuple[Moved, Moved]:
        """Hold it; return what moved most in the first step, and what is fastest in the end."""
        still = self.numbers_for(self.start)
        self.step(still)
        first = self._most(np.abs(self._qpos() - self.start))
        for _ in range(HELD - 1):
            self.step(still)
        return first, self._most(np.abs(self._qvel()))

    def play(self, random: np.random.Generator, steps: int) -> tuple[Fastest, Fastest | None]:
        """Give it random actions; return what was fastest, and what exploded first."""
        self._restart()
        fastest, exploded = self._fastest(0), None
        for step in range(1, steps + 1):
            self.step(random.uniform(*self._bounds()))
            now = self._fastest(step)
            fastest = max(fastest, now, key=lambda one: one.times)
            if exploded is None and now.times > EXPLODES:
                exploded = now
        return fastest, exploded

    def move(self, number: ActionNumber) -> tuple[NumberTrial, float]:
        """Move one number; return what it did, and how far the TCP went (m)."""
        self._restart()
        before, tcp = self._qpos(), self.tcp()
        action = self.numbers_for(self.start)
        asked, action[number.index] = self._ask(number, action[number.index])
        steps = 0
        while True:
            self.step(action)
            steps += 1
            moved = np.nan_to_num(np.abs(self._qpos() - before), nan=np.inf)
            least = self._least(number, moved / asked)
            if (
                steps == ABSOLUTE_STEPS
                or number.relative
                and (steps == RELATIVE_STEPS or least.amount > OWN_SHARE)
            ):
                break
        other = self._other(number, moved, asked * steps if number.relative else asked)
        way = float(np.nan_to_num(np.linalg.norm(self.tcp() - tcp), nan=np.inf))
        return NumberTrial(number, asked, least, other), way

    def _least(self, number: ActionNumber, shares: Array) -> Moved:
        """Return the joint of a number that followed least, and its share of what was asked."""
        group = self.robot.action_split.groups[number.group]
        factors = dict(zip(group.joints, group.followers, strict=True))
        followed = {
            joint: float(shares[self.robot.joints.index(joint)] / abs(factors[joint][0]))
            for joint in number.joints
        }
        if group.asks.drive:  # forward is along two joints
            return Moved(number.joints[0], float(np.linalg.norm(list(followed.values()))))
        joint = min(followed, key=lambda joint: followed[joint])
        return Moved(joint, followed[joint])

    def _other(self, number: ActionNumber, moved: Array, asked: float) -> Moved | None:
        """Return the joint that a number does not drive and that moved most, and its share."""
        own = self.robot.action_split.groups[number.group].unit
        shares = {
            joint: float(way / (asked if unit == own else LEAST_ASKED[unit]))
            for joint, unit, way in zip(self.robot.joints, self._units(), moved, strict=True)
            if joint not in number.joints
        }
        most = max(shares, key=lambda joint: shares[joint], default=None)
        return None if most is None else Moved(most, shares[most])

    def numbers_for(self, qpos: Sequence[float] | Floats) -> Floats:
        """Return the action that asks for joint positions, (A,); 0 where it is relative."""
        joints = dict(zip(self.robot.joints, qpos, strict=True))
        action = np.zeros(self.robot.action_dim, np.float32)
        for number in self.robot.describe_action():
            if not number.relative:
                action[number.index] = self._number_at(number, joints[number.joints[0]])
        return action

    def step(self, action: Array) -> None:
        """Take a control step, unless nothing is left to be stepped."""
        positions = self.simulation.read().joint_positions
        if np.isfinite(positions).all():
            self.simulation.step(np.asarray(action, np.float32)[None], positions)

    def tcp(self) -> Floats:
        """Return where the TCP is, (3,) (m)."""
        return self.simulation.read().tcp_position(NAME)[0].astype(float)

    def _number_at(self, number: ActionNumber, position: float) -> float:
        group = self.robot.action_split.groups[number.group]
        multiplier, offset = group.followers[group.joints.index(number.joints[0])]
        value = (position - offset) / multiplier
        if not number.normalised:
            return value
        return 2 * (value - number.lower) / (number.upper - number.lower) - 1

    def _ask(self, number: ActionNumber, present: float) -> tuple[float, float]:
        """Return how far a number's leading joint is to move, and the number that asks for it.

        It goes where there is more room: away from the nearer limit, or to the farther end.
        """
        if number.relative:
            place = self.robot.joints.index(number.joints[0])
            low, high = self.simulation.index.robots[NAME].limits[place].tolist()
            up = high - self.start[place] >= self.start[place] - low
            room = max(high - self.start[place], self.start[place] - low)
            return min(abs(number.upper if up else number.lower), room), 1.0 if up else -1.0
        least, most = (-1.0, 1.0) if number.normalised else (number.lower, number.upper)
        asks = self.robot.action_split.groups[number.group].asks
        if asks.drive or (asks.velocities and not asks.positions):
            return number.upper * ABSOLUTE_TIME, most
        end = most if most - present >= present - least else least
        scale = (number.upper - number.lower) / 2 if number.normalised else 1.0
        return abs(end - present) * scale, end

    def _units(self) -> list[str]:
        groups = self.robot.action_split.groups.values()
        return [group.unit for group in groups for _ in group.joints]

    def _bounds(self) -> tuple[Floats, Floats]:
        low, high = np.array(self.robot.action_bounds).T
        return low, high

    def _restart(self) -> None:
        """Stand it at its start again, in a world that knows nothing of what was."""
        self.simulation.rebuild([0], self.build)
        stand(self.simulation)

    def _qpos(self) -> Floats:
        return self.simulation.read().qpos(NAME)[0].astype(float)

    def _qvel(self) -> Floats:
        return self.simulation.read().qvel(NAME)[0].astype(float)

    def _most(self, amounts: Floats) -> Moved:
        amounts = np.nan_to_num(amounts, nan=np.inf)
        place = int(amounts.argmax())
        return Moved(self.robot.joints[place], float(amounts[place]))

    def _fastest(self, step: int) -> Fastest:
        speeds = np.nan_to_num(np.abs(self._qvel()), nan=np.inf)
        place = int((speeds / self._limits).argmax())
        limit = float(self._limits[place])
        return Fastest(self.robot.joints[place], float(speeds[place]), limit, step)


FLOOR = "floor"  # its name in a world
UPWARD = (0.7071068, 0.0, -0.7071068, 0.0)  # a plane's normal, +x, turned to +z
LEVEL = 1e-3  # a slide rises by less per m; a turn's axis leans by less (sine)


def drives_on_floor(robot: RobotDescriptor) -> bool:
    """Tell whether a robot's first joints move all of it on a level floor, and turn it there.

    Raises:
        AssetError: If its URDF cannot be found.
    """
    urdf = robot.urdf.locate()
    model = read_model(read_urdf(urdf), urdf.as_posix())
    base = takewhile(lambda joint: _level(joint, model), _base_joints(model))
    return {joint.unit for joint in base} == {"m", "rad"}


def adds_floor(height: float) -> Callable[[World, int], None]:
    """Return what adds a floor to a world, at a height (m)."""
    plane = Plane(position=(0.0, 0.0, height), quaternion=UPWARD)

    def build(world: World, number: int) -> None:
        world.add(FLOOR, plane, kind="static")

    return build


def _base_joints(model: UrdfModel) -> Iterator[ModelJoint]:
    """Yield the joints that carry all that collides, from the root on."""
    link = model.root
    while not any(near in model.collisions for near in model.rigid_with(link)):
        joints = model.moving_on(link)
        if len(joints) != 1:
            return
        yield joints[0]
        link = joints[0].child


def _level(joint: ModelJoint, model: UrdfModel) -> bool:
    """Tell whether a joint leaves the robot on the floor, where the joints before it are at 0."""
    turn = np.eye(3)
    for before in model.path_to(joint.child):
        turn = turn @ before.origin[:3, :3]
    x, y, z = turn @ joint.axis
    return bool(abs(z) < LEVEL) if joint.unit == "m" else bool(np.hypot(x, y) < LEVEL)

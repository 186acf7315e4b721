"""Takes one robot through the waypoints of its script."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import product
from math import pi, remainder, sqrt

import numpy as np

from robot_layouts.experts.driver import ArmDriver
from robot_layouts.experts.geometry import heading
from robot_layouts.experts.grips import Grip, role_grip
from robot_layouts.experts.hands import Hand
from robot_layouts.experts.script import CLOSED, OPEN, Scene, Waypoint
from robot_layouts.experts.tips import pose_solver
from robot_layouts.experts.ways import CANDIDATES, MANY, NoWayError, Ways
from robot_layouts.kinematics.rotations import Floats, inverse, rotate
from robot_layouts.kinematics.solve import by_way
from robot_layouts.simulation.checks.overlaps import RobotsAlone
from tasks import TaskEnv

PATIENCE = 40  # control steps without progress after which an arm counts as blocked
PROGRESS = 1e-3  # rad
VIA = 0.06  # rad: so near an arm comes to each place of a way round before it goes on
SETTLING, LEADING = 0.1, 0.2  # rad from its goal at which an arm settles; share of it per step
# Share of the force with which jaws that swing close, that they hold a cube with: with more it
# slips out in time, with less as it is lifted.
HOLDING = 0.1
# Share of their range that such jaws open in a control step while they still hold a thing, which
# springs out of them if they let go of it at once.
LETTING_GO = 0.02
FIRM = 10  # control steps that they close on after they feel a thing: drives press harder by and by
# What is pushed slides on by v² / 2µg (m): 2µg of bodies on a table (m/s²), and the share of its
# way that a push may lack, unless it stands for so many control steps.
SLOWS, LACKING, STANDS = 2 * 0.3 * 9.81, 0.3, 3
ALL_ROUND = tuple(pi / 4 * k for k in range(1, 8))  # rad
ALIKE = 0.1  # rad: postures whose joints differ less are one
# Rad from a pose, and per control step, when a careful arm goes on; or after so many control steps
# in which it came no nearer.
EXACT, RESTING, RESTED = 0.01, 0.005, 10
AGAIN, WAITING = 4, 100  # control steps after which an arm that waits looks again, and gives up


class StuckError(Exception):
    """A robot cannot go on with its script."""


class BlockedError(StuckError):
    """Something is in its way."""


class _Jaws:
    """What jaws that swing do instead of opening and closing all the way."""

    def __init__(self, task: TaskEnv, robot: str, grip: Grip) -> None:
        self._robot, self._share = robot, grip.share
        self._hand = Hand(task, robot)
        self._closing = self._hand.closing(grip.side)

    def move(self, number: float, scene: Scene) -> tuple[float | None, float | None]:
        """Return how far they open, or the force with which they close (N).

        Args:
            number: Action number of the gripper, 1 to open, -1 to close.
            scene: As it is now.
        """
        held = any(scene.grasps(self._robot, body.name) for body in scene.bodies)
        if number > 0:
            most = self._hand.share(scene) + LETTING_GO if held else 1.0
            return min(self._share, most), None
        return None, HOLDING * self._closing if held else self._closing


class Player:
    """Takes one robot through its waypoints."""

    def __init__(
        self,
        task: TaskEnv,
        robot: str,
        waypoints: Sequence[Waypoint],
        scene: Scene,
        alone: RobotsAlone,
        careful: bool = False,
    ) -> None:
        """Take a robot and what it is to do.

        Args:
            task: Says where it stands.
            robot: Its name in the layout.
            waypoints: What it does, one thing after the other.
            scene: As it is now.
            alone: Tells whether it is inside itself.
            careful: Whether it comes to rest at each pose before it goes on.
        """
        self._robot, self._waypoints = robot, list(waypoints)
        self._driver = ArmDriver(task.layout.arm(robot).robot, 1 / task.scenario.control_frequency)
        if any(waypoint.to is not None for waypoint in waypoints):
            self._kinematics = pose_solver(task, robot)
        if any((waypoint.to or waypoint.joints) is not None for waypoint in waypoints):
            self._alone, self._owner = alone, task.layout.owner(robot)
            joints = task.layout[self._owner].robot.joints
            self._own = [joints.index(joint) for joint in task.layout.arm(robot).robot.arm_joints]
        if any(waypoint.at is not None or waypoint.pushes for waypoint in waypoints):
            self._reach = task.simulation.backend.point_reach(robot)
            self._base = scene.base(robot)
        self._jaws = _Jaws(task, robot, grip) if (grip := role_grip(task, robot)) else None
        self._goal = self._start = self._driver.arm(scene.qpos(robot))
        self._careful, self._before = careful, self._goal
        self._gripper: float = OPEN
        self._share: float | None = None
        self._squeeze: float | Callable[[Scene], float] | None = None
        self._pace = 1.0
        self._leading = np.zeros_like(self._goal)
        self._current: Waypoint | None = None
        self._begun = self._elapsed = 0  # waypoints begun; steps taken in the current one
        self._felt = 0  # steps of it since the jaws felt what they close on
        self._later: list[Floats] = []  # where it goes after its goal
        self._ways: Ways | None = None
        self._delayed = 0  # control steps that it has waited for a free way

    def look_around(self, ways: Ways, players: Sequence[Player]) -> None:
        """From now on begin ways only if they are free, and go round what is in the way.

        Args:
            ways: Finds ways.
            players: All arms, this one included.
        """
        self._ways = ways
        self._others = {
            name: player
            for player in players
            if (name := ways.known(player._robot)) and player is not self
        }

    def ahead(self, scene: Scene) -> Floats:
        """Return what lies before the arm, (n, arm joints) (rad), beginning where it is."""
        return np.stack([self._arm(scene), self._goal, *self._later])

    @property
    def place(self) -> str:
        """Where it is in its script, as ``robot.waypoint``."""
        return f"{self._robot}.{self._current.name if self._current else 'start'}"

    def act(self, scene: Scene, done: set[str]) -> Floats:
        """Return the next action numbers; adds what is done to ``done``.

        Raises:
            StuckError: If the next waypoint cannot be reached, or the present one takes too long.
        """
        self._go_on(scene)
        if self._current is not None:
            if self._is_done(self._current, scene):
                done.add(self.place)
            most = self._current.most
            if most is not None and self._elapsed >= most and self.place not in done:
                raise StuckError(f"{self.place} took more than {most} steps")
        if self._may_begin(done):
            self._begin(self._waypoints[self._begun], scene)
        self._elapsed += 1
        qpos = scene.qpos(self._robot)
        goal = self._goal
        if self._current is not None and self._current.progress is not None:
            goal = goal - (1 - self._current.progress(scene)) * (goal - self._start)
        goal = goal + self._lead(goal, scene)
        if self._current is not None and self._current.pushes:
            most = sqrt(SLOWS * self._stroke) / self._driver.quickness
            goal = self._arm(scene) + (goal - self._arm(scene)) * min(1.0, most / self._left(scene))
        share, squeeze = self._share, self._squeeze
        if callable(squeeze):
            squeeze = squeeze(scene)
        if self._jaws is not None and share is None and squeeze is None:
            share, squeeze = self._jaws.move(self._gripper, scene)
        return self._driver.action(goal, self._gripper, qpos, share, squeeze, self._pace)

    def _lead(self, goal: Floats, scene: Scene) -> Floats | float:
        """Return how far beyond a goal an arm is driven, so that its weight does not hold it off.

        It grows while the arm is near a posture that it was asked for as such.
        """
        if self._current is None or self._current.joints is None:
            return 0.0
        away = goal - self._arm(scene)
        if np.abs(away).max() < SETTLING:
            self._leading = np.clip(self._leading + LEADING * away, -SETTLING, SETTLING)
        return self._leading

    def _left(self, scene: Scene) -> float:
        """Return how far the TCP still has to go (m)."""
        arm = self._arm(scene)
        point = self._in_link(scene, arm)
        ends = [self._reach.place_of(point, joints) for joints in (arm, self._goal)]
        return max(float(np.linalg.norm(ends[1] - ends[0])), 1e-6)

    def _in_link(self, scene: Scene, arm: Floats) -> Floats:
        """Return the TCP in its link's frame, (3,) (m)."""
        origin, turned = self._reach.forward(arm)
        return rotate(inverse(turned), scene.tcp(self._robot)[0] - origin)

    def _arm(self, scene: Scene) -> Floats:
        return self._driver.arm(scene.qpos(self._robot))

    def _check_progress(self, away: float) -> None:
        """Give up if the arm is kept from its goal: for `PATIENCE` steps it came no nearer."""
        if away < self._nearest_yet - PROGRESS:
            self._nearest_yet, self._waited = away, 0
        self._waited += 1
        if self._waited > PATIENCE:
            raise BlockedError(f"{self.place} is blocked {away:.2f} rad before its end")

    def _is_done(self, waypoint: Waypoint, scene: Scene) -> bool:
        if self._elapsed < waypoint.steps:
            return False
        moves = any((waypoint.to, waypoint.turn, waypoint.at, waypoint.joints))
        careful = self._careful and waypoint.to is not None
        moved, self._before = self._arm(scene) - self._before, self._arm(scene)
        if moves:
            away = np.abs(self._arm(scene) - self._goal).max()
            if self._later or away > waypoint.near:
                self._check_progress(float(away))
                return False
            if careful and (away > EXACT or np.abs(moved).max() > RESTING):
                self._check_progress(float(away))
                if self._waited < RESTED:
                    return False
            lacks = waypoint.pushes and self._left(scene) > LACKING * self._stroke
            if lacks and self._waited < STANDS:
                self._check_progress(float(away))
                return False
        if waypoint.until is None:
            return True
        self._felt = self._felt + 1 if waypoint.until(scene) else 0
        told = self._share is not None or self._squeeze is not None
        closes = self._jaws is not None and waypoint.gripper == CLOSED and not (moves or told)
        return self._felt > (FIRM if closes else 0)

    def _may_begin(self, done: set[str]) -> bool:
        if self._begun == len(self._waypoints):
            return False
        if self._current is not None and self.place not in done:
            return False
        return all(name in done for name in self._waypoints[self._begun].after)

    def _go_on(self, scene: Scene) -> None:
        """Go to the next place of a way round once the arm is near the one before."""
        if not self._later:
            return
        away = np.abs(self._arm(scene) - self._goal).max()
        if away < VIA:
            self._goal = self._later.pop(0)
            self._nearest_yet, self._waited = np.inf, 0

    def _begin(self, waypoint: Waypoint, scene: Scene) -> None:
        name = f"{self._robot}.{waypoint.name}"
        goals = self._goals(name, waypoint, scene)
        self._start = self._goal
        if goals and self._ways is not None:
            way = self._free_way(name, goals, waypoint, scene)
            if way is None:
                return
            self._goal, *self._later = way
        elif goals:
            sought = waypoint.to is not None or waypoint.joints is not None
            free = (goal for goal in goals if not sought or self._is_free(goal, scene))
            self._goal = next(free, goals[0])
        self._current = waypoint
        if waypoint.gripper is not None:
            share = waypoint.share(scene) if callable(waypoint.share) else waypoint.share
            self._gripper, self._share, self._squeeze = waypoint.gripper, share, waypoint.squeeze
            self._pace = waypoint.pace
        if waypoint.pushes:
            self._stroke = self._left(scene)
        self._begun, self._elapsed, self._felt = self._begun + 1, 0, 0
        self._nearest_yet, self._waited = np.inf, 0

    def _goals(self, name: str, waypoint: Waypoint, scene: Scene) -> list[Floats]:
        """Return arm joints that a waypoint may end at, the shortest way first; none if it stays.

        Raises:
            StuckError: If there are none.
        """
        arm = self._arm(scene)
        if waypoint.to is not None:
            qpos, solutions = scene.qpos(self._robot), self._kinematics.solutions
            goals = [goal for pose in waypoint.to(scene) for goal in solutions(*pose, qpos)]
        elif waypoint.turn is not None:
            goals = [arm + waypoint.turn(arm)]
        elif waypoint.at is not None:
            goals = self._reaching(waypoint.at(scene), scene)
        elif waypoint.joints is not None:
            goals = list(waypoint.joints(scene))
        else:
            return []
        if not goals:
            raise StuckError(f"{name} is out of reach")
        return by_way(goals, arm)

    def _free_way(
        self, name: str, goals: Sequence[Floats], waypoint: Waypoint, scene: Scene
    ) -> list[Floats] | None:
        """Return a way that touches nothing; None while others have to move on before.

        Raises:
            BlockedError: If they do not in time.
        """
        assert self._ways is not None
        self._delayed += 1
        if self._delayed % AGAIN != 1:
            return None
        ahead = {name: player.ahead(scene) for name, player in self._others.items()}
        try:
            way = self._ways.find(self._robot, goals, scene, ahead)
        except NoWayError as error:
            last = self._delayed > WAITING
            if not (last or (error.stays and self._delayed == 1)):
                return None
            try:
                others = self._others_than(goals, waypoint, scene)
                way = self._ways.find(self._robot, others, scene, ahead, MANY)
            except NoWayError:
                if not last:
                    return None
                raise BlockedError(f"{name} is blocked: {error}") from error
        self._delayed = 0
        return list(way)

    def _others_than(
        self, goals: Sequence[Floats], waypoint: Waypoint, scene: Scene
    ) -> list[Floats]:
        """Return more arm joints that a waypoint to a pose may end at.

        They are sought from the present ones with the first joint turned all round.

        Args:
            goals: Those that are known, each (arm joints,) (rad), the shortest way first.
            waypoint: Where it goes.
            scene: As it is now.
        """
        if waypoint.to is None:
            return []
        qpos, first, more = scene.qpos(self._robot), self._own[0], list[Floats]()
        for turn, pose in product(ALL_ROUND, waypoint.to(scene)):
            start = qpos.copy()
            start[first] += turn
            more += self._kinematics.solutions(*pose, start)
        found = list(goals[:CANDIDATES])
        for goal in (*goals[CANDIDATES:], *by_way(more, self._arm(scene))):
            if all(np.abs(goal - known).max() > ALIKE for known in found):
                found.append(goal)
        return found[CANDIDATES:]

    def _is_free(self, goal: Floats, scene: Scene) -> bool:
        """Return whether the robot is not inside itself with the arm at a goal."""
        qpos = scene.qpos(self._owner)
        qpos[self._own] = goal
        overlaps = self._alone.overlaps({self._owner: qpos})
        return not any(o.one.robot == o.other.robot == self._owner for o in overlaps)

    def _reaching(self, place: Floats, scene: Scene) -> list[Floats]:
        """Return arm joints that bring the TCP to a place.

        They are sought from the present ones, and from those turned towards the place by the
        first joint, which turns an arm about its base. Where those lead nowhere, as they may from
        limits of joints, they are sought with the other joints in the middle of their ranges.
        """
        arm, tip = self._reach.arm(scene.qpos(self._robot)), scene.tcp(self._robot)[0]
        point = self._in_link(scene, arm)
        about = remainder(heading(self._base, place) - heading(self._base, tip), 2 * pi)
        starts = [arm + about * side * (np.arange(len(arm)) == 0) for side in (0, 1, -1)]
        goals = [self._reach.solve(point, place, start) for start in starts]
        found = [goal for goal in goals if goal is not None]
        if found:
            return found
        start = np.array([starts[1][0], *self._reach.middle[1:]])
        goal = self._reach.solve(point, place, start)
        return [] if goal is None else [goal]

"""``python -m benchmarks skills``: how often skills of experts succeed, by robots and objects.

Each object that can be grasped is picked by arms that differ, twenty are handed over between two
of them, and five are lifted together by two unlike ones. Files of one gripper are robosuite's:
``pip install --no-deps robosuite==1.5.2``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import closing
from functools import cache, partial
from math import pi
from pathlib import Path
from runpy import run_path

import numpy as np
import torch
from tqdm import tqdm

from benchmarks.records import (
    DOCS,
    read_record,
    table,
    versions_of,
    write_page,
    write_record,
)
from layouts import Layout, Placement
from objects import ObjectRegistry
from objects.registry import CATALOGUE
from robot_layouts.experts import (
    Scene,
    Script,
    first_success,
    grasp,
    hand_over,
    lift,
    lift_together,
)
from robot_layouts.experts.holds import AJAR, SPLAYED
from robot_layouts.kinematics.rotations import multiply, rotate
from robots import RobotDescriptor, RobotLayoutsError, RobotRegistry
from robots.grafting import with_gripper
from robots.gripper_motion import gripper_motion, link_tree
from robots.urdf.tcp import find_tcp
from tasks import Area, MultiRobotTask, Object, State, TaskEnv, make, register_task
from tasks.maths import Array

REACH = 0.855  # m; of a Panda, for which the lengths here hold
ROBOTIQ = "ur5_with_robotiq"
PICKERS = ("panda", "ur5_with_panda", ROBOTIQ, "so101")
EXAMPLE = DOCS.parent / "examples/robotiq.py"
HANDS = ("panda", "ur5_with_panda")
OBJECTS = tuple(
    name for name in CATALOGUE if (thing := ObjectRegistry.load(name)).grasps and not thing.joints
)
HANDED = (
    *("beam", "bolt", "bottle", "box", "bracket", "brick", "can", "cup", "gear", "hammer", "jug"),
    *("mug", "pan", "peg", "plug", "pot_lid", "rack", "screwdriver", "shaft", "spoon"),
)
TOGETHER = ("tray", "pot_two_handles", "beam", "tote", "box")
TRIES = 3  # of a hand-over, which takes other grasps each time
LEVEL = 0.01  # of what is turned by 0.2 rad
FROM_BASE, APART = 0.55, 0.62  # of a reach; of the sum of two
CLEAR, FARTHER = 0.2, 0.65  # of a reach; where a hand begins nearer to a thing, that lies farther
FLAT = 0.005  # m; between what is held and the table, for the thinnest of fingers


def skills(*, seeds: int = 1, only: tuple[str, ...] = (), out: Path = DOCS / "skills.json") -> int:
    """Let arms pick things, hand them over, and lift them together.

    Args:
        seeds: How many episodes of each; those in the record are not played again.
        only: Arms that pick; or ``hand over``, ``lift together``. All if there are none.
        out: The record, written after every episode; the page is beside it.

    Raises:
        RobotLayoutsError: If something cannot be read or written.
    """
    torch.set_num_threads(1)
    record = read_record(out, versions={}, episodes={})
    cases = [case for case in _cases() if not only or case[0] in only]
    for group, name, begin in tqdm(cases, disable=None):
        known = record["episodes"].get(group, {}).get(name, {})
        if all(str(seed) in known for seed in range(seeds)):
            continue
        seen = record["episodes"].setdefault(group, {}).setdefault(name, {})
        for seed, reason in _played(begin, seeds):
            seen[str(seed)] = reason
        record["versions"] = versions_of("sapien", "ompl", "python-fcl")
        write_record(out, record)
    episodes = record["episodes"]
    rows = [_row(group, seen) for group, seen in episodes.items()]
    failures = [line for group, seen in episodes.items() for line in _failures(group, seen)]
    shown = table(("", "episodes", "too large or flat", "of the others succeed"), rows)
    write_page(out, "skills", versions=record["versions"], table=shown, failures=failures)
    return 0


Begin = Callable[[], tuple[TaskEnv, Callable[[Scene], list[Script]]]]


def _cases() -> Iterator[tuple[str, str, Begin]]:
    for robot in PICKERS:
        for name in OBJECTS:
            yield robot, name, partial(_begun, robot, name)
    for name in HANDED:
        yield "hand over", name, _Both("hand over", name).begin
    for name in TOGETHER:
        yield "lift together", name, _Both("lift together", name).begin


def _played(begin: Begin, seeds: int) -> Iterator[tuple[int, str]]:
    """Yield why each seed fails; nothing if it does not."""
    env, scripts = begin()
    with closing(env):
        for seed in range(seeds):
            try:
                yield seed, first_success(env, seed, scripts).reason
            except RobotLayoutsError as error:
                yield seed, str(error).removeprefix("no plan: ")


@cache
def robot_of(name: str) -> RobotDescriptor:
    """Return a robot of the catalogue, or, by ``ARM_with_HAND``, an arm with another's hand."""
    if name == ROBOTIQ:
        return run_path(str(EXAMPLE))["UR5_WITH_ROBOTIQ"]
    arm, _, hand = name.partition("_with_")
    robot = RobotRegistry.load(arm)
    return with_gripper(robot, hand) if hand else robot


def _begun(robot: str, name: str) -> tuple[TaskEnv, Callable[[Scene], list[Script]]]:
    return _Picking(robot, name).begin()


class _Picking:
    """A thing before one arm, which is to lift it."""

    def __init__(self, robot: str, name: str) -> None:
        self._robot, self._name = robot, name

    def begin(self) -> tuple[TaskEnv, Callable[[Scene], list[Script]]]:
        robot, thing = robot_of(self._robot), ObjectRegistry.load(self._name)
        scale = robot.reach / REACH
        layout = Layout({"arm": Placement(robot, (-_away(robot) - 0.1, 0.0, 0.0))})
        env = _task(f"Pick{self._robot}{self._name}", layout, self._name, scale, _picked)
        by = 0.08 * scale

        def scripts(scene: Scene) -> list[Script]:
            taken = grasp(env, "arm", "thing", thing, up=by)
            return [{"arm": (*taken, *lift(env, "arm", "thing", by))}]

        return env, scripts


def _away(robot: RobotDescriptor) -> float:
    """Return how far from its base a thing lies (m), so that a hand does not begin at it."""
    tree, qpos = link_tree(robot), np.array(Placement(robot).start_qpos, float)
    hand = find_tcp(robot, tree).places(tree.forward(qpos[None]))[0]
    apart = float(np.linalg.norm(hand - (FROM_BASE * robot.reach, 0.0, 0.0)))
    return (FROM_BASE if apart > CLEAR * robot.reach else FARTHER) * robot.reach


class _Both:
    """A thing between two arms."""

    def __init__(self, what: str, name: str) -> None:
        self._what, self._name = what, name

    def begin(self) -> tuple[TaskEnv, Callable[[Scene], list[Script]]]:
        left, right = map(robot_of, HANDS)
        thing, scale = ObjectRegistry.load(self._name), min(left.reach, right.reach) / REACH
        apart = APART * (left.reach + right.reach)
        over = self._what == "hand over"
        # The giver has the thing before itself; together, it is in the middle.
        near = FROM_BASE * left.reach if over else apart * left.reach / (left.reach + right.reach)
        layout = Layout(
            {
                "left": Placement(left, (-0.1, -near, 0.0), rpy=(0.0, 0.0, pi / 2)),
                "right": Placement(right, (-0.1, apart - near, 0.0), rpy=(0.0, 0.0, -pi / 2)),
            }
        )
        name = f"{'HandOver' if over else 'LiftTogether'}{self._name}"
        done = _handed if over else _lifted
        yaw = (-pi, pi) if over else (pi / 2 - 0.3, pi / 2 + 0.3)
        env = _task(name, layout, self._name, scale, done, yaw)

        def scripts(scene: Scene) -> list[Script]:
            if over:
                return [hand_over(env, "left", "right", "thing", thing)] * TRIES
            return [lift_together(env, ["left", "right"], "thing", thing, 0.1)]

        return env, scripts


def _task(
    name: str,
    where: Layout,
    of: str,
    scale: float,
    done: Callable[[State, float], Array],
    yaw: tuple[float, float] = (-pi, pi),
) -> TaskEnv:
    half, height = 0.04 * scale, ObjectRegistry.load(of).height()

    class Work(MultiRobotTask):
        """Something is done with a thing."""

        layout = where
        max_episode_steps = 700
        thing = Object(of, spawn=Area(x=(-0.1 - half, -0.1 + half), y=(-half, half), yaw=yaw))

        def evaluate(self, state: State) -> dict[str, Array]:
            """Success: it is done."""
            return {"success": done(state, height)}

    task_id = f"{name}-v1"
    register_task(task_id)(Work)
    return make(task_id, obs_mode="none", check_layout=False)


def _picked(state: State, height: float) -> Array:
    """Tell where the arm holds the thing 2 cm above the table."""
    return (state.position("thing")[:, 2] > height + 0.02) & state.is_grasping("arm", "thing")


def _handed(state: State, height: float) -> Array:
    """Tell where the right arm alone holds the thing, and the left one has drawn back."""
    alone = state.is_grasping("right", "thing") & ~state.is_grasping("left", "thing")
    high = state.position("thing")[:, 2] > height + 0.03
    return alone & high & (state.tcp_distance("left", "thing") > 0.08)


def _lifted(state: State, height: float) -> Array:
    """Tell where both arms hold the thing 8 cm above the table, and it is level."""
    both = state.is_grasping("left", "thing") & state.is_grasping("right", "thing")
    turned = state.pose("thing")[:, 3:]
    level = turned[:, 1] ** 2 + turned[:, 2] ** 2 < LEVEL
    return both & level & (state.position("thing")[:, 2] > height + 0.08)


def _row(group: str, seen: Mapping[str, Mapping[str, str]]) -> list[str]:
    reasons = [reason for episodes in seen.values() for reason in episodes.values()]
    solved = reasons.count("")
    unfit = sum(
        _is_unfit(reason) or (bool(reason) and group in PICKERS and _lies_flat(group, name))
        for name, episodes in seen.items()
        for reason in episodes.values()
    )
    share = f"{solved} of {len(reasons) - unfit} ({100 * solved / (len(reasons) - unfit):.0f} %)"
    return [_shown(group), str(len(reasons)), str(unfit), share]


def _is_unfit(reason: str) -> bool:
    """Return whether a thing is wider than the gripper opens, or lies too flat to reach under."""
    flat = "has no room to take" in reason and " and table-workspace overlap" in reason
    return flat or "takes what is less than" in reason


@cache
def _lies_flat(robot: str, name: str) -> bool:
    """Return whether a finger would be in the table in each grasp that a gripper opens for."""
    thing, motion = ObjectRegistry.load(name), gripper_motion(robot_of(robot))
    widest = motion.widest_within(SPLAYED)
    grasps = [grasp for grasp in thing.grasps if grasp.opening + AJAR <= widest]
    if not grasps:
        return True
    rest, opening = np.array(thing.rest()), np.array([grasp.opening for grasp in grasps])
    turned = multiply(rest, np.array([grasp.quaternion for grasp in grasps]))
    steep = np.abs(rotate(turned, np.array([0.0, 1.0, 0.0]))[:, 2])  # sine of how fingers close
    place = thing.height() + rotate(rest, np.array([grasp.position for grasp in grasps]))[:, 2]
    return bool((place - steep * opening / 2 < steep * FLAT).all())


def _failures(group: str, seen: Mapping[str, Mapping[str, str]]) -> Iterator[str]:
    for name, episodes in seen.items():
        for seed, reason in episodes.items():
            if reason:
                yield f"{_shown(group)}, {name}, seed {seed}: {reason}"


def _shown(group: str) -> str:
    return f"`grasp`, {group}" if group in PICKERS else f"`{group.replace(' ', '_')}`"

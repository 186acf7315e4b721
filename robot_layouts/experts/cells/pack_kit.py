"""CellPackKit: all arms take their parts, and let them into their pockets by turns."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from itertools import pairwise, product

from robot_layouts.experts.cells.moves import carry, cube_holds, stand_back
from robot_layouts.experts.grasps import need_fingers
from robot_layouts.experts.rehearsal import Plan, first_success
from robot_layouts.experts.script import Scene, Script, Waypoint
from robot_layouts.kinematics.rotations import Floats
from tasks import TaskEnv
from tasks.cells.pack_kit import PARTS, TALL

ORDERS = (  # in which arms put their parts down, those that face each other first
    ("south", "north", "east", "west"),
    ("east", "west", "south", "north"),
)
UP = 0.012  # above its middle a part is held (m)


def pack_kit(task: TaskEnv, seed: int) -> Plan:
    """Return the actions of all arms, (T, A), that fill the kit.

    Raises:
        TaskError: If an arm has no fingers, or cannot reach what it should.
    """
    need_fingers(task, "filling the kit", *PARTS)
    return first_success(
        task,
        seed,
        lambda scene: [_script(task, scene, *each) for each in product((False, True), ORDERS)],
        as_declared=True,
    )


def _script(task: TaskEnv, start: Scene, patient: bool, order: Sequence[str]) -> Script:
    """Return a script by whether arms wait for their turns where they began, and by their order."""
    before = {arm: [f"{other}.wait"] for other, arm in pairwise(order)}
    away = {arm: _back(task, arm, start) if patient else stand_back(task, arm) for arm in order}
    return {arm: (*_packing(task, arm, before.get(arm, []), patient), away[arm]) for arm in order}


def _back(task: TaskEnv, arm: str, start: Scene) -> Waypoint:
    """Return the waypoint that brings an arm back to where it began."""
    robot, qpos = task.layout.arm(arm).robot, start.qpos(arm)
    posture = qpos[[robot.joints.index(joint) for joint in robot.arm_joints]]
    return Waypoint("wait", joints=lambda scene: [posture], near=0.3)


def _packing(
    task: TaskEnv, arm: str, turn_of: Sequence[str], patient: bool
) -> tuple[Waypoint, ...]:
    part = PARTS[arm]
    *steps, _ = carry(
        task,
        arm,
        part,
        cube_holds(part, UP),
        partial(_in_pocket, pocket=f"pocket_{arm}"),
        drop=0.004,
        around=0.01,
        turn_of=turn_of,
        taking=turn_of if patient else (),
    )
    return tuple(steps)


def _in_pocket(scene: Scene, pocket: str) -> Floats:
    return scene.body(pocket)[0] + (0.0, 0.0, TALL + 0.002)

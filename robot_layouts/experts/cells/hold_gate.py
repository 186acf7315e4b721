"""CellHoldGate: one pulls the gate open and stays, one brings the bar, one takes it through."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from math import pi

import numpy as np

from robot_layouts.experts.geometry import backed_off, gripper_facing, yaw_of
from robot_layouts.experts.grasps import (
    YAWS,
    bringing,
    held_at,
    in_reach,
    move_joint,
    moved_along,
    need_fingers,
    pick,
    thing_grips,
)
from robot_layouts.experts.reaching import reaching
from robot_layouts.experts.rehearsal import Plan, first_success
from robot_layouts.experts.script import CLOSED, OPEN, Pose, Scene, Script, Waypoint
from robot_layouts.kinematics.rotations import inverse, rotate
from tasks import TaskEnv
from tasks.cells.hold_gate import LONG, THICK, CellHoldGate

PULLS = 10  # in how many parts the leaf is pulled open
USUAL = 0.02, LONG - 0.05
# Each: in how many parts the bar moves; how wide the leaf opens (rad); how far before the gate the
# bar's middle is when it changes hands, and how far from its middle it is held (m).
TRIED = ((6, 1.5, *USUAL), (9, 1.5, *USUAL), (9, 1.3, *USUAL), (9, 1.3, -0.04, LONG / 2))
AWAY = np.array([0.4, 0.0, 0.3])  # where the giver goes in the end, from its base (m)
LEVEL = pi / 2 + 0.01  # rad; of a hand that pulls at the handle, with room for rounding
BEFORE = 0.18  # m; of a hand from the handle, before it goes straight there
START, OUT = 0.32, -0.32  # of the bar's middle before the gate and behind it (m)
ASIDE, UP = 0.04, 0.01  # of the bar on its way, from the middle of the gate, and lifted (m)


def hold_gate(task: TaskEnv, seed: int) -> Plan:
    """Return the actions of all arms, (T, A), that bring the bar through the gate.

    Raises:
        TaskError: If an arm has no fingers, or cannot reach what it should.
    """
    need_fingers(task, "handing a bar through a gate", *task.layout.arms)
    return first_success(
        task, seed, lambda scene: [_script(task, *tried) for tried in TRIED], as_declared=True
    )


def _script(task: TaskEnv, count: int, wide: float, end: float, held: float) -> Script:
    above, *others = pick("taker", "bar", partial(_grips, side=-held), ready=0.03, around=0.01)
    first, *then = pick("giver", "bar", partial(_grips, side=held), ready=0.03, around=0.01)
    opened, handed = f"porter.gate.leaf {PULLS - 1}", f"giver.there {count - 1}"
    return {
        "porter": _holding(task, wide, ["taker.over", "giver.leave"]),
        "giver": (
            replace(first, after=(opened,)),
            *then,
            Waypoint("lift", partial(_raised, robot="giver", by=UP), CLOSED),
            *_along("giver", "before", START, 1),
            *_along("giver", "there", end, count),
            Waypoint("release", None, OPEN, steps=3, after=("taker.grasp bar",)),
            Waypoint("back", _backed, OPEN),
            Waypoint("rise", partial(_raised, robot="giver", by=0.1), OPEN),
            reaching(task, "giver", "leave", lambda scene: scene.base("giver") + AWAY, near=0.1),
        ),
        "taker": (
            replace(above, after=(handed,)),
            *others,
            *_along("taker", "out", OUT, count, after=["giver.release"]),
            Waypoint("over", _over, CLOSED, near=0.03),
            Waypoint("lower", _lowered, CLOSED, near=0.02),
            Waypoint("release", None, OPEN, steps=3),
            Waypoint("rise", partial(_raised, robot="taker", by=0.1), OPEN),
        ),
    }


def _holding(task: TaskEnv, wide: float, done: Sequence[str]) -> tuple[Waypoint, ...]:
    handle = thing_grips(CellHoldGate.gate.descriptor, "gate", 0.08, lean=LEVEL)
    grips = in_reach(task, "porter", handle, above=BEFORE, on=partial(_pull, wide=wide))
    shutting = move_joint("porter", "gate", "leaf", 0.0, steps=PULLS)
    return (
        Waypoint("before", lambda scene: [backed_off(grip, BEFORE) for grip in grips(scene)]),
        *pick("porter", "gate.leaf", grips, ready=0.01, around=0.004),
        *move_joint("porter", "gate", "leaf", wide, steps=PULLS),
        *(
            replace(waypoint, name=f"shut {i}", after=() if i else tuple(done))
            for i, waypoint in enumerate(shutting)
        ),
    )


def _pull(scene: Scene, grip: Pose, wide: float) -> list[Pose]:
    return [moved_along(scene, "gate", "leaf", share * wide, grip) for share in (0.3, 0.6, 1.0)]


def _grips(scene: Scene, side: float) -> list[Pose]:
    """Straight down over one end of the bar, the fingers on its long sides."""
    position, quaternion = scene.body("bar")
    place = position + rotate(quaternion, np.array([side, 0.0, 0.0]))
    return [(place, gripper_facing(yaw_of(quaternion) + way, 0.0)) for way in (0.0, pi)]


def _along(
    robot: str, name: str, end: float, count: int, after: Sequence[str] = ()
) -> tuple[Waypoint, ...]:
    """Return the waypoints that bring the bar straight through the gate to so far before it (m)."""

    def then(scene: Scene, left: int) -> list[Pose]:
        place, quaternion = scene.body("gate")
        now = rotate(inverse(quaternion), scene.body("bar")[0] - place)[0]
        x, y, _ = place + rotate(quaternion, np.array([now + (end - now) / left, ASIDE, 0.0]))
        return [bringing(scene, robot, "bar", (np.array([x, y, THICK + UP]), quaternion))]

    return tuple(
        Waypoint(
            f"{name} {i}", partial(then, left=count - i), CLOSED, after=() if i else tuple(after)
        )
        for i in range(count)
    )


def _raised(scene: Scene, by: float, robot: str) -> list[Pose]:
    position, quaternion = scene.tcp(robot)
    return [(position + (0.0, 0.0, by), quaternion)]


def _backed(scene: Scene) -> list[Pose]:
    position, quaternion = scene.tcp("giver")
    return [(position + rotate(scene.body("gate")[1], np.array([0.12, 0.0, 0.0])), quaternion)]


def _over(scene: Scene) -> list[Pose]:
    return held_at(scene, "taker", "bar", scene.body("mark")[0] + (0.0, 0.0, 0.05), YAWS)


def _lowered(scene: Scene) -> list[Pose]:
    return held_at(scene, "taker", "bar", scene.body("mark")[0] + (0.0, 0.0, THICK))

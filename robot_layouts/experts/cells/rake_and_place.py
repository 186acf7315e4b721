"""CellRakeAndPlace: the puller reaches over the blocks with the rake and pulls; two put away."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from math import pi

import numpy as np

from robot_layouts.experts.cells.moves import Grips, carry, cube_holds
from robot_layouts.experts.geometry import backed_off, gripper_facing, turn, yaw_of
from robot_layouts.experts.grasps import YAWS, bringing, need_fingers, pick
from robot_layouts.experts.reaching import reaching
from robot_layouts.experts.rehearsal import Plan, first_success
from robot_layouts.experts.script import CLOSED, OPEN, Pose, Scene, Script, Waypoint
from robot_layouts.kinematics.rotations import Floats, rotate
from tasks import TaskEnv
from tasks.cells.rake_and_place import HIGH_UP, LONG, PLACERS

BEYOND, UP = 0.06, 0.07  # of the rake's head behind the farther block, and over the table (m)
PULLED, FORTH = 0.06, 0.1  # where its head ends, and how far it goes back from the blocks (m)
AWAY = np.array([0.0, 0.25, 0.5])  # where the puller's hand goes in the end, from its base (m)
ACROSS = np.array([0.0, 1.0, 0.0])  # the way in which fingers part, in the gripper's frame
IN = np.array([0.0, 0.0, 0.06])  # where a block is let go, from its box (m)


def rake_and_place(task: TaskEnv, seed: int) -> Plan:
    """Return the actions of all arms, (T, A), that pull the blocks near and put them away.

    Raises:
        TaskError: If an arm has no fingers, or cannot reach what it should.
    """
    need_fingers(task, "raking and putting away", *task.layout.arms)
    return first_success(
        task,
        seed,
        lambda scene: [
            _script(task, count, holds)
            for holds in (cube_holds, _beside_the_rake)
            for count in (8, 14)
        ],
        as_declared=True,
    )


def _script(task: TaskEnv, count: int, holds: Callable[[str], Grips]) -> Script:
    placing = {
        arm: carry(
            task,
            arm,
            f"block_{arm}",
            holds(f"block_{arm}"),
            partial(_inside, arm=arm),
            height=0.14,
            back=0.02,
            yaws=YAWS,
            taking=[turn_of],
        )
        for arm, turn_of in zip(PLACERS, ("puller.leave", "left.retreat block_left"), strict=True)
    }
    return {"puller": _pull(task, count), **placing}


def _pull(task: TaskEnv, count: int) -> tuple[Waypoint, ...]:
    def head(scene: Scene) -> float:
        return float(scene.body("rake")[0][1]) + LONG

    def brought(scene: Scene, y: float, up: float) -> list[Pose]:
        """The rake straight ahead between the blocks, its head at y."""
        x = np.mean([scene.body(f"block_{arm}")[0][0] for arm in PLACERS])
        return [bringing(scene, "puller", "rake", (np.array([x, y - LONG, up]), turn("z", pi / 2)))]

    def beyond(scene: Scene, up: float) -> list[Pose]:
        return brought(scene, max(scene.body(f"block_{a}")[0][1] for a in PLACERS) + BEYOND, up)

    def pulled(scene: Scene, left: int) -> list[Pose]:
        return brought(scene, head(scene) + (PULLED - head(scene)) / left, 0.002)

    def away(scene: Scene) -> Floats:
        return scene.base("puller") + AWAY

    return (
        *pick("puller", "rake", _grips, ready=0.03, around=0.01, above=0.08),
        Waypoint("raise", lambda scene: brought(scene, head(scene), UP), CLOSED),
        Waypoint("over", partial(beyond, up=UP), CLOSED, near=0.02),
        Waypoint("lower", partial(beyond, up=0.002), CLOSED, near=0.02),
        *(Waypoint(f"pull {i}", partial(pulled, left=count - i), CLOSED) for i in range(count)),
        Waypoint("forth", lambda scene: brought(scene, PULLED + FORTH, 0.002), CLOSED, near=0.02),
        Waypoint("let go", None, OPEN, steps=3),
        Waypoint("rise", lambda scene: [backed_off(scene.tcp("puller"), 0.12)], OPEN),
        reaching(task, "puller", "leave", away, near=0.1),
    )


def _grips(scene: Scene) -> list[Pose]:
    """Straight down over the rake's grip, the fingers on its long sides."""
    position, quaternion = scene.body("rake")
    along = yaw_of(quaternion)
    place = position + (0.0, 0.0, HIGH_UP)
    return [(place, gripper_facing(along + side, 0.0)) for side in (0.0, pi)]


def _beside_the_rake(block: str) -> Grips:
    """Return the grips of a block whose fingers part about along the rake next to it."""

    def grips(scene: Scene) -> list[Pose]:
        along = rotate(scene.body("rake")[1], np.array([1.0, 0.0, 0.0]))
        some = cube_holds(block)(scene)
        return [grip for grip in some if abs(rotate(grip[1], ACROSS) @ along) > np.cos(pi / 4)]

    return grips


def _inside(scene: Scene, arm: str) -> Floats:
    return scene.body(f"box_{arm}")[0] + IN
